"""The noise that the rate estimators believe is the one that the axes have."""

from dataclasses import replace

import numpy as np
import pytest
from support.noise_twin import noise

from inertial.constants import MILLI_G
from inertial.layouts.catalogue import CUBE
from inertial.rate.batch import Phase
from inertial.rate.estimators import ProductsRate
from inertial.rate.observed import sensor
from inertial.simulation.disturbed import Disturbance, record
from inertial.simulation.table import SensorModel


def measured(log):
    """Ratios of variance that the filter measured over a log."""
    estimator = ProductsRate(CUBE(0.05))
    estimator.feed(log.t_s, log.readings)
    return estimator.core.native.noise


@pytest.mark.parametrize("profile", ["published", "wobble", "fast", "still"])
def test_published_sensors_are_as_configured(profile):
    assert measured(record(1, profile)) == (1.0, 1.0)


@pytest.mark.parametrize("milli_g", [8.0, 16.0, 40.0])
def test_noise_is_measured_at_rest_and_while_turning(milli_g):
    log = record(2, "wobble", sensor=SensorModel(noise=milli_g * MILLI_G))
    want = (milli_g**2 + 3.9**2 / 12.0) * MILLI_G**2 / 0.0408**2
    np.testing.assert_allclose(measured(log), want, rtol=0.35)


def test_shaking_is_in_the_force_alone():
    quiet, force = measured(record(3, "published", disturbance=Disturbance(20 * MILLI_G)))
    assert quiet < 1.5 and force > 5.0


@pytest.mark.parametrize("milli_g", [2.0, 12.0])
def test_it_is_that_of_its_definition(milli_g):
    log = record(4, "fast", sensor=SensorModel(noise=milli_g * MILLI_G))
    s = sensor(CUBE(0.05))
    np.testing.assert_allclose(measured(log), noise(log.readings @ s.W.T, s), rtol=1e-9)


def test_the_noise_that_a_layout_says_is_believed():
    def noisy(noise):
        layout = CUBE(0.05)
        return replace(layout, sensors=tuple(replace(s, noise=noise) for s in layout.sensors))

    log = record(5, "published", blocks=1)
    quiet, loud = (ProductsRate(noisy(noise)).feed(log.t_s, log.readings) for noise in (0.04, 0.12))
    turning = ~log.still & (quiet.phase == Phase.TURNING) & (loud.phase == Phase.TURNING)
    sigma, more = (np.sqrt(np.einsum("kii->k", said.P)[turning]) for said in (quiet, loud))
    assert turning.sum() > 300 and np.median(more / sigma) > 1.5
