"""The bound of bound.py along an estimate, in the live path: one step for EVERY samples, by the
filter's kernel (E-48).

Compiled.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from inertial.rate.compiling import fused, making
from inertial.rate.observed import Sensor
from inertial.rate.products_correct import force_rows, products_rows, standstill_rows
from inertial.rate.products_kernel import (
    COV,
    GRAVITY,
    RESIDUAL,
    WORK,
    Three,
    absorb_six,
    absorb_three,
    along_axis,
    factor,
    predict,
    solve,
)
from inertial.rate.products_model import BIASES, STATES

Array = NDArray[np.float64]

EVERY = 8  # samples
KNOWN_RATE = 1e-10  # (rad/s)^2, of a body known to stand

FOLLOWED = np.dtype(
    (
        np.record,
        [
            ("P", "f8", (STATES * STATES,)),
            ("x", "f8", (STATES,)),
            ("work", "f8", (WORK,)),
            ("sigma", "f8", (3,)),  # rad/s
            ("count", "i8"),
            ("known", "i8"),  # there was a standstill
            ("biases", "f8"),  # variances, of bound.Knowledge
            ("tilt", "f8"),
            ("bias", "f8"),
            ("centre", "f8"),
            ("pivot", "f8"),
            ("wander", "f8"),
            ("axis_from", "f8"),
            ("share", "f8"),  # 1 / samples of the first standstill
        ],
    )
)
Followed = np.record


def memory(what: Any) -> Followed:
    """Before any sample; what: bound.Knowledge that knows gravity and a fixed axis."""
    m = np.zeros(1, FOLLOWED)[0]
    m["biases"], m["share"] = what.sigma_axis**2 / what.standstill, 1.0 / what.standstill
    m["tilt"], m["bias"], m["centre"] = (what.tilt * GRAVITY) ** 2, what.bias**2, what.centre**2
    m["pivot"], m["wander"], m["axis_from"] = what.pivot**2, what.axis_wander**2, what.axis_from**2
    return m


@fused
def _up(q: Array) -> Three:
    """-C_bn g_n: what a body at rest feels."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    return (
        -GRAVITY * 2.0 * (x * z - w * y),
        -GRAVITY * 2.0 * (y * z + w * x),
        -GRAVITY * (1.0 - 2.0 * (x * x + y * y)),
    )


@making
def _begin(m: Followed, s: Sensor, u: Three) -> None:
    """What is known after the first standstill; tilt and bias of p are known together, not
    apart.
    """
    P = m.P
    P[:] = 0.0
    for i in range(12):
        for j in range(12):
            P[STATES * BIASES[i] + BIASES[j]] = m.biases * s.drift[i, j]
    C = np.empty((3, 3))
    for i in range(3):
        P[23 * i], P[23 * (18 + i)] = KNOWN_RATE, m.pivot
        for j in range(3):
            across = (1.0 if i == j else 0.0) - u[i] * u[j] / GRAVITY**2
            P[22 * (12 + i) + 12 + j] = m.tilt * across
            P[22 * (15 + i) + 15 + j] = m.bias * s.drift[9 + i, 9 + j]
            C[i, j] = m.tilt * across + m.bias * s.drift[9 + i, 9 + j] + s.R_p[i, j] * m.share
    f = factor(C[0, 0], C[1, 0], C[1, 1], C[2, 0], C[2, 1], C[2, 2])
    G = np.empty((3, 6))
    for j in range(6):
        k = 12 + j
        rows = (
            P[22 * 12 + k] + P[22 * 15 + k],
            P[22 * 13 + k] + P[22 * 16 + k],
            P[22 * 14 + k] + P[22 * 17 + k],
        )
        G[0, j], G[1, j], G[2, j] = solve(f, rows[0], rows[1], rows[2])
    for i in range(6):
        for j in range(6):
            P[22 * (12 + i) + 12 + j] -= G[0, i] * G[0, j] + G[1, i] * G[1, j] + G[2, i] * G[2, j]
    m.known = 1


@fused
def step(
    m: Followed, s: Sensor, omega: Array, alpha: Array, q_nb: Array, still: bool, dt: float
) -> None:
    """One sample of the estimate: omega (3,) rad/s, alpha (3,) rad/s^2, attitude (4,), the still
    detector's word.
    """
    m.count += 1
    if m.count % EVERY != 0 or (m.known == 0 and not still):
        return
    x, P, work, u = m.x, m.P, m.work, _up(q_nb)
    if m.known == 0:
        _begin(m, s, u)
    x[:] = 0.0
    for i in range(3):
        x[i], x[12 + i] = omega[i], u[i]
    w, a, share = (x[0], x[1], x[2]), (alpha[0], alpha[1], alpha[2]), 1.0 / EVERY
    fixed = w[0] ** 2 + w[1] ** 2 + w[2] ** 2 > m.axis_from
    N = along_axis(w[0], w[1], w[2], fixed, not still)
    predict(x, P, work, a, N, EVERY * dt, not still, s, (0.0, 0.0, 0.0))
    if not still:
        _noise(P, N, EVERY * dt * dt, m.wander * EVERY * dt, s)
    x[:] = 0.0
    for i in range(3):
        x[i], x[12 + i], work[RESIDUAL + i], work[RESIDUAL + 3 + i] = w[i], u[i], 0.0, 0.0
    if s.m > 0:
        products_rows(P, work, w, s, share)
        absorb_six(x, P, work, np.inf)
    force_rows(x, P, work, u, a, s, share)
    for i in range(3):
        work[COV + 7 * i] += m.centre * share if not still else 0.0
        work[RESIDUAL + i] = 0.0
    absorb_three(x, P, work, np.inf)
    if still:
        standstill_rows(P, work, s, KNOWN_RATE, share)
        absorb_six(x, P, work, np.inf)
    for i in range(3):
        m.sigma[i] = np.sqrt(P[23 * i])


@fused
def _noise(
    P: Array, N: tuple[float, float, float, float, float, float], f: float, wander: float, s: Sensor
) -> None:
    """P += f N R_alpha N + wander (I - N), on omega."""
    full = ((N[0], N[1], N[2]), (N[1], N[3], N[4]), (N[2], N[4], N[5]))
    for i in range(3):
        for j in range(3):
            value = (wander if i == j else 0.0) - wander * full[i][j]
            for k in range(3):
                for l in range(3):
                    value += f * full[i][k] * s.R_alpha[k, l] * full[l][j]
            P[22 * i + j] += value
