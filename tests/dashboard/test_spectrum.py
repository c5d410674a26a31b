"""The spectrum of a signal that is known, and that holes are no part of it."""

import numpy as np
import pytest

from dashboard.scene.panels.motion.spectrum import density, unbroken

PERIOD = 0.01


def test_white_noise_has_its_density_and_a_tone_its_place():
    rng = np.random.default_rng(1)
    f, p = density(rng.normal(0.0, 2.0, 60_000), PERIOD)
    assert np.median(p) == pytest.approx(2.0 * PERIOD * 4.0, rel=0.3)  # one-sided: 2 sigma² T
    t = np.arange(6000) * PERIOD
    f, p = density(np.sin(2 * np.pi * 7.0 * t), PERIOD)
    assert f[p.argmax()] == pytest.approx(7.0, abs=2 * f[0])
    assert np.sum(p) * f[0] == pytest.approx(0.5, rel=0.05)  # the power of a sine


def test_the_longest_stretch_without_a_hole_is_taken():
    t = np.arange(1000) * PERIOD
    y = np.arange(1000.0)
    y[300] = np.nan
    keep = np.ones(1000, dtype=bool)
    keep[700:720] = False
    found, period = unbroken(t[keep], y[keep])
    assert (found[0], found[-1]) == (301.0, 699.0) and period == pytest.approx(PERIOD)
    assert len(unbroken(t[:2], y[:2])[0]) == 0
