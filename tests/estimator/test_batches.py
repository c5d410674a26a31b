"""Samples in batches: how they are cut changes no bit; only what is asked for is made; messages
filled at once.
"""

from typing import NamedTuple

import numpy as np
import pytest

from estimator.devices.rate import RateBoard, RateOutput
from estimator.rate_messages import rate_batch
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
from messages.contract import rates

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


class Told(NamedTuple):
    """One sample by one estimator."""

    index: int
    estimator: str
    state: RateState


def fed(faulty, size: int, limit_hz: float = 200.0) -> list[Told]:
    layout, t_s, readings = faulty
    board = RateBoard("cube", layout, ["products-ekf", "least-squares"], limit_hz)
    out = []
    for k in range(0, N, size):
        for o in board.feed(0, k, 0.01, t_s[k : k + size], readings[k : k + size]):
            assert o.index == k + o.row
            out += [
                Told(o.index + o.step * row, o.estimator, o.columns.state(row))
                for row in range(len(o.columns))
            ]
    return sorted(out, key=lambda told: (told.index, told.estimator))


def bits(outputs: list[Told]) -> list[tuple]:
    """Everything that is said, arrays as bytes."""
    plain = []
    for o in outputs:
        state = [getattr(o.state, name) for name in RateState.__slots__]
        parts = (v.tobytes() if isinstance(v, np.ndarray) else v for v in state)
        plain.append((o.index, o.estimator, *parts))
    return plain


@pytest.fixture(scope="module")
def by_tens(faulty):
    return fed(faulty, 10)


def test_how_samples_are_batched_changes_no_bit(faulty, by_tens):
    assert {o.state.excluded for o in by_tens} == {0, 1 << NAMES.index("a21")}
    assert len(by_tens) == 2 * N
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
        P = bound._prior(s, bound.axis_sigma(table.layout, what), q, what) if P is None else P
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


def test_a_batch_says_row_by_row_what_the_states_say():
    """RateBatch against the states one by one, with and without innovation and bound."""
    block, estimator = TableTest(1).block(0), ProductsRate(CUBE(0.05))
    columns = estimator.feed(block.t_s[:700], block.readings[:700])
    batch = pb.AccelBatch(
        header=pb.Header(device="cube", run=7, sequence=9, device_us=5, utc_ns=9), period_s=0.01
    )
    said = RateOutput(3, 103, 2, "e", columns)
    message = rate_batch(batch, "card", said)
    read = list(rates.rows(message))
    assert len(read) == rates.count(message) == 700
    for k in (0, 350, 699):
        s = columns.state(k)
        later = 3 + 2 * k
        expected = pb.RateEstimate(
            header=pb.Header(
                device="cube", run=7, device_us=5 + 10_000 * later, utc_ns=9 + 10**7 * later
            ),
            estimator="e",
            calibration="card",
            for_sequence=9,
            for_index=103 + 2 * k,
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
            bound_sigma_radps=[] if s.bound_sigma is None else s.bound_sigma,
            excluded_mask=s.excluded,
        )
        reason = read[k].sight_reason
        assert bool(reason) == any(s.sight)
        expected.sight_reason = reason
        assert read[k] == expected
        alone = rates.complete(pb.RateBatch.FromString(expected.SerializeToString()))
        assert rates.row(alone, 0) == expected  # an estimate is a batch of one
    assert columns.state(0).bound_sigma is None and columns.state(699).nis_dof == 6


def test_the_fields_of_a_batch_have_the_numbers_of_an_estimate():
    for name, field in pb.RateEstimate.DESCRIPTOR.fields_by_name.items():
        of_batch = pb.RateBatch.DESCRIPTOR.fields_by_name[name]
        assert (of_batch.number, of_batch.type) == (field.number, field.type)
    repeated = {f.name for f in pb.RateBatch.DESCRIPTOR.fields if f.is_repeated}
    assert repeated == {*rates.ROWS, *rates.NUMBERS}
