"""The spectrum of a signal that is known, and that holes are no part of it."""

import time
from types import SimpleNamespace

import numpy as np
import pytest
import viser
from support.feeder import Feeder

from dashboard.data.store import Store
from dashboard.scene.panels import Snapshot
from dashboard.scene.panels.motion.spectrum import Spectrum, _scales
from logs.figures.spectrum import density, unbroken

PERIOD = 0.01


class Direct:
    """Puts straight into a store."""

    def __init__(self, store: Store) -> None:
        self.store = store

    def put(self, topic, device, message, estimator="") -> None:
        self.store.put(topic, device, estimator, message)


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


def test_the_page_draws_the_signal_that_is_chosen():
    store = Store()
    feeder = Feeder(Direct(store))
    for k in range(600):
        feeder.cube(k * 0.01)
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        folder = server.gui.add_folder("page")
        page = Spectrum(SimpleNamespace(gui=server.gui), folder)
        device = store.device("cube-01")
        page.update(Snapshot(store, device, 0.0, device.t_newest, time.monotonic(), True))
        assert {"psd"} <= set(page._plots)
        assert "ωz · products filter" in page._choice.options
        x, y = page._plots["psd"].data
        assert len(x) == len(y) > 20 and (x > 0).all() and (y > 0).all()
    finally:
        server.stop()


@pytest.mark.parametrize("lowest, highest", [(0.033, 49.9), (0.1, 50.0), (10.0, 10.0), (1e-9, 3.0)])
def test_a_logarithmic_axis_has_limits_of_its_own(lowest, highest):
    across = _scales(np.array([lowest, highest]))["x"]
    low, high = across["range"]
    assert across["auto"] is False and 0.0 < low <= lowest and high >= highest and high > low
