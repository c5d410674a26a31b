"""The field against rigid-body kinematics written with cross products, and against the paper's (25)
and (26).
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from inertial.layouts.catalogue import CUBE, LAYOUTS
from inertial.layouts.layout import CORNERS, WIRING, products
from inertial.rate.field import (
    cube_angular_acceleration,
    cube_specific_force,
    field_from_triads,
    solve,
)

law = settings(deadline=None, max_examples=50)  # the first call may compile
numbers = st.floats(-20.0, 20.0)
vectors = st.tuples(numbers, numbers, numbers).map(np.array)
readings = st.lists(numbers, min_size=12, max_size=12).map(np.array)


def felt(layout, f_b, alpha_b, omega_b):
    """Axis readings by f + alpha x r + omega x (omega x r)."""
    a = f_b + np.cross(alpha_b, layout.r_b) + np.cross(omega_b, np.cross(omega_b, layout.r_b))
    return np.sum(a * layout.theta_b, axis=1)


@law
@given(a=readings)
def test_the_papers_25_and_26_are_the_rows_of_S(a):
    x = CUBE(0.05).S @ a
    np.testing.assert_allclose(cube_angular_acceleration(a, 0.1), x[:3], atol=1e-9)
    np.testing.assert_allclose(cube_specific_force(a), x[3:], atol=1e-12)


@pytest.mark.parametrize("name", ["cube", "edges-12"])
@law
@given(f_b=vectors, alpha_b=vectors, omega_b=vectors)
def test_field_is_recovered_from_its_own_readings(name, f_b, alpha_b, omega_b):
    layout = LAYOUTS[name](0.05)
    field = solve(layout, felt(layout, f_b, alpha_b, omega_b))
    np.testing.assert_allclose(field.f_b, f_b, atol=1e-9)
    np.testing.assert_allclose(field.alpha_b, alpha_b, atol=1e-8)
    np.testing.assert_allclose(field.products, products(omega_b), atol=1e-7)


@law
@given(f_b=vectors, alpha_b=vectors, omega_b=vectors)
def test_readings_do_not_tell_the_sign_of_the_rate(f_b, alpha_b, omega_b):
    cube = CUBE(0.05)
    np.testing.assert_array_equal(
        felt(cube, f_b, alpha_b, omega_b), felt(cube, f_b, alpha_b, -omega_b)
    )


@law
@given(a=readings)
def test_section_6_by_triads_gives_the_same_field(a):
    cube = CUBE(0.05)
    a_b = np.einsum("ji,jik->jk", a.reshape(4, 3), WIRING)
    by_triads, by_axes = field_from_triads(0.05 * CORNERS, a_b), solve(cube, a)
    np.testing.assert_allclose(by_triads.f_b, by_axes.f_b, atol=1e-9)
    np.testing.assert_allclose(by_triads.alpha_b, by_axes.alpha_b, atol=1e-8)
    np.testing.assert_allclose(by_triads.products, by_axes.products, atol=1e-8)


@law
@given(alpha_b=vectors, omega_b=vectors, r=vectors)
def test_gradient_moves_the_specific_force_from_point_to_point(alpha_b, omega_b, r):
    cube = CUBE(0.05)
    field = solve(cube, felt(cube, np.zeros(3), alpha_b, omega_b))
    expected = np.cross(alpha_b, r) + np.cross(omega_b, np.cross(omega_b, r))
    np.testing.assert_allclose(field.gradient @ r, expected, atol=1e-5)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_reading_that_is_no_number_is_refused_by_axis(value):
    a = np.zeros(12)
    a[4] = value
    with pytest.raises(ValueError, match="axis 5 of layout cube reads"):
        solve(CUBE(0.05), a)


def test_a_wrong_number_of_axes_is_refused():
    with pytest.raises(ValueError, match=r"axis readings \(9,\), want \(12,\)"):
        solve(CUBE(0.05), np.zeros(9))
