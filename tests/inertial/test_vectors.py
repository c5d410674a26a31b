"""Rows of 22 numbers: what is compiled against the same in plain words; rows of a filter into
messages.
"""

import numpy as np
import pytest
from numba import njit

from estimator.packed import RowFields
from inertial.rate import vectors
from messages.contract import gyrofree_pb2 as pb


@njit
def _all(P, G, x, a):
    vectors.combine(G, 24, P, (0, 44, 66), (1.0, a, -a))
    vectors.combine(G, 48, G, (24, 0), (a, 0.5))  # a row of the same array
    vectors.combine(G, 24, G, (24,), (-2.0,))  # the very row
    vectors.add(x, 0, G, (0, 24, 48), (a, 1.0, 2.0))
    vectors.take_out(P, G, (0, 24, 48))
    vectors.scale(P, x, 0)


def test_compiled_rows_are_what_the_plain_words_say():
    rng = np.random.default_rng(1)
    P, G, x = rng.normal(size=484), rng.normal(size=72), rng.normal(size=22)
    P = (P.reshape(22, 22) + P.reshape(22, 22).T).ravel()
    one, other = (P.copy(), G.copy(), x.copy()), (P.copy(), G.copy(), x.copy())
    _all(*one, 0.3)
    _all.py_func(*other, 0.3)
    for compiled, plain in zip(one, other, strict=True):
        np.testing.assert_allclose(compiled, plain, rtol=1e-13, atol=1e-13)
    square = one[0].reshape(22, 22)
    assert np.array_equal(square, square.T)  # to the bit
    for row in (22, 46, 70):  # between the rows nothing is touched
        assert np.array_equal(one[1][row : row + 2], G[row : row + 2])


def test_rows_become_the_fields_of_a_message():
    rows = np.random.default_rng(2).normal(size=(3, 20))
    fields = RowFields(pb.RateEstimate, omega_ib_b_radps=(4, 3), nis=(0, 1), bias=(7, 12))
    wire = fields.wire(rows)
    assert len(wire) == 3 * fields.size
    for k, row in enumerate(rows):
        message = pb.RateEstimate.FromString(wire[k * fields.size : (k + 1) * fields.size])
        assert message == pb.RateEstimate(omega_ib_b_radps=row[4:7], nis=row[0], bias=row[7:19])
    with pytest.raises(TypeError, match="RateEstimate.still is not"):
        RowFields(pb.RateEstimate, still=(0, 1))
