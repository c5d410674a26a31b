"""Laws of rotations at identity, near it and at random; tilt from gravity."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from inertial.attitude.rotation import (
    from_dcm,
    from_rotation_vector,
    level,
    multiply,
    skew,
    tilt_correction,
    to_dcm,
)

law = settings(deadline=None, max_examples=50)  # the first call may compile
numbers = st.floats(-3.0, 3.0)
turns = st.one_of(
    st.just(np.zeros(3)),
    st.tuples(numbers, numbers, numbers).map(lambda v: 1e-8 * np.array(v)),
    st.tuples(numbers, numbers, numbers).map(np.array),
)


@law
@given(v=turns)
def test_rotation_vector_agrees_with_an_independent_library(v):
    np.testing.assert_allclose(
        to_dcm(from_rotation_vector(v)), Rotation.from_rotvec(v).as_matrix(), atol=1e-12
    )


@law
@given(v=turns, u=turns)
def test_quaternion_product_is_the_product_of_turns(v, u):
    p, q = from_rotation_vector(v), from_rotation_vector(u)
    np.testing.assert_allclose(to_dcm(multiply(p, q)), to_dcm(p) @ to_dcm(q), atol=1e-12)


@law
@given(v=turns)
def test_matrix_to_quaternion_and_back(v):
    C = to_dcm(from_rotation_vector(v))
    np.testing.assert_allclose(to_dcm(from_dcm(C)), C, atol=1e-12)


@law
@given(v=turns, u=turns)
def test_skew_is_the_cross_product(v, u):
    np.testing.assert_allclose(skew(v) @ u, np.cross(v, u), atol=1e-12)


def test_a_cube_at_rest_that_reads_one_g_on_z_stands_upright():
    np.testing.assert_allclose(
        to_dcm(level(np.array([0.0, 0.0, 9.8]))), np.diag([1.0, -1.0, -1.0]), atol=1e-12
    )


@law
@given(v=turns)
def test_levelling_turns_the_specific_force_up_and_x_north(v):
    f_b = to_dcm(from_rotation_vector(v)) @ np.array([0.0, 0.0, 9.8])
    if np.hypot(f_b[1], f_b[2]) < 0.1:
        return  # x_b vertical: refused, tested below
    C_nb = to_dcm(level(f_b))
    np.testing.assert_allclose(C_nb @ f_b, [0.0, 0.0, -9.8], atol=1e-9)
    assert C_nb[1, 0] == pytest.approx(0.0, abs=1e-9)
    assert C_nb[0, 0] > 0.0


@pytest.mark.parametrize("f_b", [[0.0, 0.0, 0.0], [9.8, 0.0, 0.0], [np.nan, 0.0, 9.8]])
def test_levelling_refuses_what_has_no_tilt(f_b):
    with pytest.raises(ValueError, match="tilt from gravity"):
        level(np.array(f_b))


@law
@given(v=st.tuples(numbers, numbers, numbers).map(lambda v: 0.05 * np.array(v)))
def test_tilt_correction_puts_up_upright_and_keeps_the_heading(v):
    up_b = to_dcm(from_rotation_vector(v)) @ np.array([0.0, 0.0, 1.0])
    q = np.array([0.0, 1.0, 0.0, 0.0])
    for _ in range(3):  # each step leaves the cube of the error
        q = tilt_correction(q, up_b, 1.0)
    np.testing.assert_allclose(to_dcm(q) @ up_b, [0.0, 0.0, -1.0], atol=1e-7)
