"""Radii, gravity and rates against published values and each other."""

import math

import numpy as np
import pytest

from inertial.navigation.earth import (
    E2,
    OMEGA,
    A,
    earth_rate,
    gravity,
    ned_between,
    radii,
    transport_rate,
)


def test_radii_at_equator_and_pole() -> None:
    b = A * math.sqrt(1.0 - E2)
    assert radii(0.0) == pytest.approx((b * b / A, A), rel=1e-14)
    assert radii(math.pi / 2) == pytest.approx((A * A / b, A * A / b), rel=1e-12)


@pytest.mark.parametrize(
    ("latitude", "published"), [(0.0, 9.7803253359), (45.0, 9.80619777), (90.0, 9.8321849378)]
)
def test_gravity_on_the_ellipsoid(latitude: float, published: float) -> None:
    assert gravity(math.radians(latitude), 0.0) == pytest.approx(published, abs=2e-8)


def test_gravity_falls_by_a_third_of_a_milligal_per_metre() -> None:
    L = math.radians(45.0)
    assert gravity(L, 100.0) - gravity(L, 0.0) == pytest.approx(-3.086e-4, abs=1e-6)


def test_rates() -> None:
    L, h = math.radians(37.759), 1468.0
    assert np.linalg.norm(earth_rate(L)) == pytest.approx(OMEGA, rel=1e-15)
    R_N, R_E = radii(L)
    north, east, down = transport_rate(L, h, 30.0, 20.0)
    assert north == 20.0 / (R_E + h)
    assert east == -30.0 / (R_N + h)
    assert down == pytest.approx(north * -math.tan(L))


def test_ned_between_goes_over_the_antimeridian() -> None:
    north, east, down = ned_between(0.0, math.pi - 1e-6, 5.0, 1e-6, -math.pi + 1e-6, 2.0)
    assert (north, east, down) == pytest.approx(
        (1e-6 * (radii(0.0)[0] + 5.0), 2e-6 * (A + 5.0), 3.0), rel=1e-9
    )
