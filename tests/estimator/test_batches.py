"""Samples in batches: how they are cut changes no bit; only what is asked for is made; messages
filled at once.
"""

import numpy as np
import pytest

from estimator.devices.rate import RateBoard, RateOutput
from estimator.packed import Doubles, varint
from inertial.core import native
from inertial.layouts.catalogue import CUBE, LAYOUTS
from inertial.rate import bound
from inertial.rate.batch import RateState
from inertial.rate.estimators import ESTIMATORS, ProductsRate
from inertial.rate.observed import sensor
from inertial.rate.products_model import (
    STATES,
    measured_force_jacobian,
    measured_products_jacobian,
    squares_jacobian,
)
from inertial.simulation.faults import Faults, parse
from inertial.simulation.table import TableTest
from messages.contract import gyrofree_pb2 as pb

NAMES = CUBE(0.05).axis_names
N = 1000


@pytest.fixture(scope="module")
def faulty():
    """Ten seconds with an axis that saturates for a while: it is excluded within a batch, and taken
    back.
    """
    table = TableTest(1)
    block = Faults([parse("a21:saturated@6-6.5", NAMES)]).into(table.block(0))
    return table.layout, block.t_s[:N], block.readings[:N]


def fed(faulty, size: int, limit_hz: float = 200.0) -> list[RateOutput]:
    layout, t_s, readings = faulty
    board = RateBoard("cube", layout, ["products-ekf", "least-squares"], limit_hz)
    out = []
    for k in range(0, N, size):
        out += [
            RateOutput(k + o.row, o.index, o.estimator, o.state)
            for o in board.feed(0, k, 0.01, t_s[k : k + size], readings[k : k + size])
        ]
    return out


def bits(outputs: list[RateOutput]) -> list[tuple]:
    """Everything that is said, arrays as bytes."""
    plain = []
    for o in outputs:
        state = [getattr(o.state, name) for name in RateState.__slots__]
        plain.append(
            (
                o.row,
                o.index,
                o.estimator,
                *(v.tobytes() if isinstance(v, np.ndarray) else v for v in state),
            )
        )
    return plain


@pytest.fixture(scope="module")
def by_tens(faulty):
    return fed(faulty, 10)


def test_how_samples_are_batched_changes_no_bit(faulty, by_tens):
    assert {o.state.excluded for o in by_tens} == {0, 1 << NAMES.index("a21")}
    assert [(o.row, o.estimator) for o in by_tens[:3]] == [
        (0, "products-ekf"),
        (0, "least-squares"),
        (1, "products-ekf"),
    ]
    assert bits(fed(faulty, 1)) == bits(by_tens) == bits(fed(faulty, 37))


def test_what_is_not_published_changes_nothing(faulty, by_tens):
    few = fed(faulty, 37, limit_hz=20.0)
    assert bits(few) == bits([o for o in by_tens if o.index % 5 == 4])


def test_a_batch_with_a_sample_that_cannot_be_used_is_refused_whole():
    block = TableTest(1).block(0)
    for name, make in ESTIMATORS.items():
        estimator = make(CUBE(0.05))
        bad = block.readings[:5].copy()
        bad[3, 2] = np.nan
        with pytest.raises(ValueError, match="axis 3 of layout cube reads nan"):
            estimator.feed(block.t_s[:5], bad)
        with pytest.raises(ValueError, match="time must grow"):
            estimator.feed(block.t_s[[0, 1, 1]], block.readings[:3])
        assert len(estimator.feed(block.t_s[:5], block.readings[:5])) == 5, name


@pytest.mark.parametrize("kind", ["cube", "stars-12", "nine"])
def test_information_of_the_products_is_that_of_matrices(kind):
    s, omega = sensor(LAYOUTS[kind](0.05), 0.04), np.array([0.7, -1.1, 2.3])
    H = s.M @ squares_jacobian(omega)
    expected = np.diag(H.T @ np.linalg.solve(s.R_c, H))
    np.testing.assert_allclose(native.rate_information(omega, s), expected, rtol=1e-9, atol=1e-9)


def test_the_live_bound_is_that_of_whole_matrices():
    """Standstill, then turning on a fixed axis: every step against the same by whole matrices."""
    table, what, n = TableTest(1), bound.IN_USE, 8
    block, s, live = (
        table.block(0),
        sensor(table.layout, what.sigma_axis),
        bound.Along(table.layout),
    )
    P, steps, SQ = None, 0, np.vstack([s.SQ_alpha, s.SQ_force])
    for k in range(700):
        omega, alpha, q = block.omega_b[k], block.alpha_b[k], block.q_nb[k]
        still = not omega.any() and not alpha.any()
        live.step(omega, alpha, q, still, 0.01)
        if (k + 1) % n:
            continue
        P = bound._prior(s, q, what) if P is None else P
        x = np.zeros(STATES)
        x[:3], x[12:15] = omega, bound._up(q)
        P = bound._moved(P, x, alpha, SQ, s, n * 0.01, still, what, n)
        P = bound._seen(P, measured_products_jacobian(x, s.M), s.R_c / n)
        R = s.R_p + (0.0 if still else what.centre**2) * np.eye(3)
        P = bound._seen(P, measured_force_jacobian(x, alpha, SQ), R / n)
        if still:
            R = np.diag([1e-10] * 6)
            R[3:, 3:] = s.R_alpha / n
            P = bound._seen(P, np.eye(6, STATES), R)
        np.testing.assert_allclose(live.sigma, np.sqrt(np.diag(P)[:3]), rtol=1e-4)
        steps += 1
    assert steps == 87 and not still


def test_arrays_become_the_fields_of_a_message():
    rng = np.random.default_rng(1)
    arrays = [rng.normal(size=n) for n in (3, 9, 0, 40)]
    fields = ("omega_ib_b_radps", "omega_covariance", "innovation", "bias")
    message = pb.RateEstimate(estimator="x")
    message.MergeFromString(Doubles(pb.RateEstimate, *fields).wire(*arrays))
    expected = pb.RateEstimate(
        estimator="x", **{f: a.tolist() for f, a in zip(fields, arrays, strict=True)}
    )
    assert message == expected and message.SerializeToString() == expected.SerializeToString()
    assert varint(300) == b"\xac\x02"
    with pytest.raises(TypeError, match="RateEstimate.nis is not"):
        Doubles(pb.RateEstimate, "nis")


def test_a_state_becomes_the_message_it_did():
    """RateMessages against the constructor, with and without innovation and bound."""
    from estimator.rate_messages import RateMessages

    block, estimator = TableTest(1).block(0), ProductsRate(CUBE(0.05))
    said = estimator.feed(block.t_s[:700], block.readings[:700])
    states = [said.state(0), said.state(699)]
    batch = pb.AccelBatch(
        header=pb.Header(device="cube", run=7, sequence=9, device_us=5, utc_ns=9), period_s=0.01
    )
    messages = RateMessages(batch, "card")
    for index, s in enumerate(states):
        header = pb.Header(
            device="cube", run=7, device_us=5 + 10_000 * index, utc_ns=9 + 10**7 * index
        )
        expected = pb.RateEstimate(
            header=header,
            estimator="e",
            calibration="card",
            for_sequence=9,
            for_index=index,
            omega_ib_b_radps=s.omega_b,
            omega_covariance=s.P.ravel(),
            alpha_b_radps2=s.alpha_b,
            f_b_mps2=s.f_b,
            q_nb=s.q_nb,
            angle_z_rad=s.angle_z,
            innovation=s.innovation,
            innovation_sigma=s.innovation_sigma,
            nis=s.nis,
            nis_dof=s.nis_dof,
            still=s.still,
            p_n_m=s.p_n,
            v_n_mps=s.v_n,
            bias=s.bias,
            innovation_unit=s.innovation_unit,
            sight=s.sight,
            sight_reason=s.sight_reason,
            bound_sigma_radps=[] if s.bound_sigma is None else s.bound_sigma,
            excluded_mask=s.excluded,
        )
        said = messages.estimate(index, index, "e", s)
        assert said == expected and said.SerializeToString() == expected.SerializeToString()
    assert (
        states[0].bound_sigma is None and len(states[1].bound_sigma) == 3 and states[1].nis_dof == 6
    )
