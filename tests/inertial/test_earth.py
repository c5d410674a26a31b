"""Radii, gravity and rates against published values and each other; both twins, bit for bit."""

import math

import numpy as np
import pytest

from inertial import earth
from inertial.constants import EARTH_RATE, ECCENTRICITY2, FLATTENING, SEMI_MAJOR_AXIS
from inertial.core import native
from inertial.earth import earth_rate, gravity, ned_between, radii, transport_rate

RNG = np.random.default_rng(4)
L, LON = RNG.uniform(-1.5, 1.5, 500), RNG.uniform(-math.pi, math.pi, 500)
H, NORTH, EAST = RNG.uniform(-100, 9000, 500), RNG.normal(0, 30, 500), RNG.normal(0, 30, 500)


def test_the_ellipsoid_is_of_one_piece() -> None:
    assert FLATTENING * (2.0 - FLATTENING) == pytest.approx(ECCENTRICITY2, rel=1e-11)


def test_radii_at_equator_and_pole() -> None:
    a = SEMI_MAJOR_AXIS
    b = a * math.sqrt(1.0 - ECCENTRICITY2)
    assert radii(0.0) == pytest.approx((b * b / a, a), rel=1e-14)
    assert radii(math.pi / 2) == pytest.approx((a * a / b, a * a / b), rel=1e-12)


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
    assert np.linalg.norm(earth_rate(L)) == pytest.approx(EARTH_RATE, rel=1e-15)
    R_N, R_E = radii(L)
    north, east, down = transport_rate(L, h, 30.0, 20.0)
    assert north == 20.0 / (R_E + h)
    assert east == -30.0 / (R_N + h)
    assert down == pytest.approx(north * -math.tan(L))


def test_ned_between_goes_over_the_antimeridian() -> None:
    north, east, down = ned_between((0.0, math.pi - 1e-6, 5.0), (1e-6, -math.pi + 1e-6, 2.0))
    assert (north, east, down) == pytest.approx(
        (1e-6 * (radii(0.0)[0] + 5.0), 2e-6 * (SEMI_MAJOR_AXIS + 5.0), 3.0), rel=1e-9
    )


def test_core_and_numpy_twin_give_the_same_bits() -> None:
    functions = {
        "radii": (L,),
        "gravity": (L, H),
        "earth_rate": (L,),
        "transport_rate": (L, H, NORTH, EAST),
    }
    for name, inputs in functions.items():
        whole = getattr(earth, name)(*inputs)
        whole = np.stack(whole, axis=-1) if isinstance(whole, tuple) else whole
        single = [getattr(native.earth, name)(*one) for one in zip(*inputs, strict=True)]
        assert np.array(single).tobytes() == whole.tobytes(), name
    there = (L + 1e-4 * NORTH, LON[::-1], H[::-1])
    whole = np.stack(ned_between((L, LON, H), there), axis=-1)
    single = [
        native.earth.ned_between(*o, *p)
        for o, p in zip(zip(L, LON, H, strict=True), zip(*there, strict=True), strict=True)
    ]
    assert np.array(single).tobytes() == whole.tobytes()
