"""Laws of rotations at identity, near it and at random; tilt from gravity; both twins agree."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from inertial import rotation
from inertial.core import native
from inertial.rotation import (
    conjugate,
    euler_angles,
    euler_matrix,
    followed,
    from_matrix,
    from_rotation_vector,
    level,
    multiply,
    roll_pitch,
    rotate,
    rotation_vector,
    skew,
    to_matrix,
    turn_matrix,
    upright,
)

law = settings(deadline=None, max_examples=50)
numbers = st.floats(-3.0, 3.0)
turns = st.one_of(
    st.just(np.zeros(3)),
    st.tuples(numbers, numbers, numbers).map(lambda v: 1e-8 * np.array(v)),
    st.tuples(numbers, numbers, numbers).map(np.array),
)
RNG = np.random.default_rng(8)
TURNS = np.concatenate([RNG.normal(0, s, (400, 3)) for s in (1.0, 0.1, 1e-7)] + [np.zeros((1, 3))])


@law
@given(v=turns)
def test_rotation_vector_agrees_with_an_independent_library(v):
    np.testing.assert_allclose(turn_matrix(v), Rotation.from_rotvec(v).as_matrix(), atol=1e-12)


@law
@given(v=turns)
def test_exp_and_log_are_inverse(v):
    v = v * min(1.0, 3.0 / max(1e-9, np.linalg.norm(v)))
    np.testing.assert_allclose(rotation_vector(turn_matrix(v)), v, atol=1e-9)


@law
@given(v=turns, u=turns)
def test_quaternion_product_is_the_product_of_turns(v, u):
    p, q = from_rotation_vector(v), from_rotation_vector(u)
    np.testing.assert_allclose(to_matrix(multiply(p, q)), to_matrix(p) @ to_matrix(q), atol=1e-12)
    np.testing.assert_allclose(to_matrix(conjugate(p)), to_matrix(p).T, atol=1e-15)
    np.testing.assert_allclose(rotate(p, u), to_matrix(p) @ u, atol=1e-12)


@law
@given(v=turns)
def test_matrix_to_quaternion_and_back(v):
    C = turn_matrix(v)
    np.testing.assert_allclose(to_matrix(from_matrix(C)), C, atol=1e-12)
    assert from_matrix(C)[0] >= 0.0


def test_half_turns_about_each_axis_keep_their_quaternion():
    for axis in np.eye(3):
        C = 2.0 * np.outer(axis, axis) - np.eye(3)
        np.testing.assert_array_equal(from_matrix(C), [0.0, *axis])


@law
@given(v=turns, u=turns)
def test_skew_is_the_cross_product(v, u):
    np.testing.assert_allclose(skew(v) @ u, np.cross(v, u), atol=1e-12)


@law
@given(st.floats(-3.1, 3.1), st.floats(-1.55, 1.55), st.floats(-3.1, 3.1))
def test_euler_angles_are_the_zyx_sequence(roll, pitch, yaw):
    C_nb = euler_matrix(roll, pitch, yaw)
    truth = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix()
    np.testing.assert_allclose(C_nb, truth, atol=1e-12)
    assert euler_angles(C_nb) == pytest.approx((roll, pitch, yaw), abs=1e-6)
    assert roll_pitch(-9.8 * C_nb[2]) == pytest.approx((roll, pitch), abs=1e-6)


def test_a_cube_at_rest_that_reads_one_g_on_z_stands_upright():
    np.testing.assert_allclose(
        to_matrix(level(np.array([0.0, 0.0, 9.8]))), np.diag([1.0, -1.0, -1.0]), atol=1e-12
    )


@law
@given(v=turns)
def test_levelling_turns_the_specific_force_up_and_x_north(v):
    f_b = turn_matrix(v) @ np.array([0.0, 0.0, 9.8])
    if np.hypot(f_b[1], f_b[2]) < 0.1:
        return  # x_b vertical: refused, tested below
    C_nb = to_matrix(level(f_b))
    np.testing.assert_allclose(C_nb @ f_b, [0.0, 0.0, -9.8], atol=1e-9)
    assert C_nb[1, 0] == pytest.approx(0.0, abs=1e-9)
    assert C_nb[0, 0] > 0.0


@pytest.mark.parametrize("f_b", [[0.0, 0.0, 0.0], [9.8, 0.0, 0.0], [np.nan, 0.0, 9.8]])
def test_levelling_refuses_what_has_no_tilt(f_b):
    with pytest.raises(ValueError, match="tilt from gravity"):
        level(np.array(f_b))
    with pytest.raises(ValueError, match="tilt from gravity"):
        native.rotation.level(np.array(f_b))


@law
@given(v=st.tuples(numbers, numbers, numbers).map(lambda v: 0.05 * np.array(v)))
def test_tilt_correction_puts_up_upright_and_keeps_the_heading(v):
    up_b = turn_matrix(v) @ np.array([0.0, 0.0, 1.0])
    q = np.array([0.0, 1.0, 0.0, 0.0])
    for _ in range(3):  # each step leaves the cube of the error
        q = upright(q, up_b)
    np.testing.assert_allclose(to_matrix(q) @ up_b, [0.0, 0.0, -1.0], atol=1e-7)
    np.testing.assert_array_equal(upright(q, np.zeros(3)), q)


def test_turns_after_one_another_follow_the_products():
    q = followed([1.0, 0.0, 0.0, 0.0], TURNS[:50])
    for k in range(50):
        np.testing.assert_array_equal(q[k + 1], multiply(q[k], from_rotation_vector(TURNS[k])))


def test_core_and_numpy_twin_give_the_same_bits():
    q, q2 = from_rotation_vector(TURNS), from_rotation_vector(TURNS[::-1])
    C = to_matrix(q)
    one_turn = {
        "from_rotation_vector": (TURNS,),
        "to_matrix": (q,),
        "from_matrix": (C,),
        "rotation_vector": (C,),
        "euler_matrix": tuple(TURNS.T),
        "euler_angles": (C,),
        "multiply": (q, q2),
        "roll_pitch": (TURNS,),
        "upright": (q, TURNS),
    }
    for name, inputs in one_turn.items():
        stacked = getattr(rotation, name)(*inputs)
        stacked = np.stack(stacked, axis=-1) if isinstance(stacked, tuple) else stacked
        single = [getattr(native.rotation, name)(*one) for one in zip(*inputs, strict=True)]
        assert np.array(single).tobytes() == stacked.tobytes(), name
    for f_b in TURNS[:400]:
        assert native.rotation.level(f_b).tobytes() == level(f_b).tobytes()
