"""Layouts against the paper's matrices and the table of section 4 of the gyro-free reference."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from inertial.layouts.catalogue import CUBE, LAYOUTS
from inertial.layouts.layout import GeometryError, Layout, products, products_matrix

law = settings(deadline=None, max_examples=50)  # the first call may compile
numbers = st.floats(-20.0, 20.0)
vectors = st.tuples(numbers, numbers, numbers).map(np.array)


@pytest.mark.parametrize(
    ("name", "kappa", "gdop", "rank"),
    [
        ("cube", "1.414", "1.0607", 12),
        ("chen-6", "1.000", "1.7321", 6),
        ("nine", "1.225", "1.5811", 6),
        ("edges-12", "2.000", "1.2748", 12),
        ("stars-12", "1.732", "1.0000", 8),
    ],
)
def test_quality_of_the_published_layouts(name, kappa, gdop, rank):
    for half_side in (1.0, 0.05):  # kappa and GDOP compare layouts, not sizes
        layout = LAYOUTS[name](half_side)
        assert f"{layout.kappa:.3f}" == kappa
        assert f"{layout.gdop:.4f}" == gdop
        assert layout.rank == rank


def test_the_cube_has_the_normal_matrix_of_the_paper():
    J = CUBE(1.0).J
    np.testing.assert_allclose(J.T @ J, np.diag([8.0, 8.0, 8.0, 4.0, 4.0, 4.0]), atol=1e-12)


def test_twelve_unknowns_of_the_cube_have_condition_number_two():
    assert np.linalg.cond(CUBE(1.0).field_matrix) == pytest.approx(2.0, abs=1e-9)


@law
@given(omega=vectors)
def test_the_cube_needs_no_feedback(omega):
    cube = CUBE(0.05)
    np.testing.assert_allclose(cube.S @ cube.quadratic(omega), np.zeros(6), atol=1e-9)


@law
@given(omega=vectors)
def test_feedback_terms_of_the_nine_axis_layout(omega):
    nine = LAYOUTS["nine"](0.05)
    x, y, z = omega
    np.testing.assert_allclose(
        (nine.S @ nine.quadratic(omega))[:3], [y * z, x * z, x * y], atol=1e-9
    )


def test_equations_of_the_nine_axis_layout():
    S = LAYOUTS["nine"](0.5).S  # L = 1
    np.testing.assert_allclose(S[0], [0, 0, 0, 0, 1, 1, 0, 0, 0], atol=1e-12)
    np.testing.assert_allclose(S[3], np.array([1, -1, 0, 0, 0, 0, 1, 0, 0]) / 3, atol=1e-12)


@law
@given(omega=vectors)
def test_chen_needs_feedback_in_the_specific_force_only(omega):
    chen = LAYOUTS["chen-6"](0.05)
    np.testing.assert_allclose((chen.S @ chen.quadratic(omega))[:3], np.zeros(3), atol=1e-9)


def test_first_row_of_the_edge_layout():
    a = np.round(10 * np.abs(LAYOUTS["edges-12"](1.0).S[0]), 9).reshape(4, 3)
    assert a.tolist() == [[0, 1, 0], [0, 1, 0], [0, 1, 2], [0, 3, 2]]


@law
@given(omega=vectors)
def test_specific_force_of_the_edge_layout(omega):
    edges = LAYOUTS["edges-12"](0.5)
    assert (edges.S @ edges.quadratic(omega))[5] == pytest.approx(
        -(omega[0] ** 2 + omega[1] ** 2) / 4, abs=1e-9
    )


@law
@given(omega=vectors, r=vectors, theta=vectors)
def test_quadratic_part_is_the_double_cross_product(omega, r, theta):
    q = products_matrix(r[None, :], theta[None, :]) @ products(omega)
    np.testing.assert_allclose(
        q, [theta @ np.cross(omega, np.cross(omega, r))], atol=1e-8, rtol=1e-9
    )


def test_axes_on_one_plane_are_refused():
    cube = CUBE(0.05)
    flat = Layout("flat", cube.r_b * [1, 1, 0], cube.theta_b)
    with pytest.raises(GeometryError, match="observe only 9 of the 12 unknowns"):
        _ = flat.field_inverse


def test_axes_on_one_line_cannot_see_the_angular_acceleration():
    line = Layout(
        "line", np.repeat([[0.0, 0, 0], [0.1, 0, 0]], 3, axis=0), np.tile(np.eye(3), (2, 1)), 0.1
    )
    with pytest.raises(GeometryError, match="observe only 5 of the 6 unknowns"):
        _ = line.S
    assert line.gdop == float("inf")


@pytest.mark.parametrize(
    ("r", "theta", "message"),
    [
        (np.zeros((6, 3)), np.ones((6, 3)), "axis 1 has length 1.73205, want 1"),
        (np.zeros((5, 3)), np.ones((6, 3)), r"positions \(5, 3\) and directions \(6, 3\)"),
        (np.full((6, 3), np.nan), np.tile(np.eye(3), (2, 1)), "not all finite"),
    ],
)
def test_arrays_that_cannot_be_axes_are_refused(r, theta, message):
    with pytest.raises(GeometryError, match=message):
        Layout("odd", r, theta)
