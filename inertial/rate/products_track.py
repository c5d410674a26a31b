"""What a products filter says after each sample: one row of numbers, written by the one compiled
loop over samples.

Every way to run a filter goes through `run`, one sample or an hour at a time, so that all give the
same bits.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inertial.rate import bound_live, sight
from inertial.rate import products_kernel as kernel
from inertial.rate import products_run as frame
from inertial.rate import still as stillness
from inertial.rate.bound_live import Followed
from inertial.rate.compiling import lean
from inertial.rate.observed import Sensor
from inertial.rate.products_kernel import Tuning
from inertial.rate.products_model import BIASES, STATES, TURNED

Array = NDArray[np.float64]

# columns of a row; units as in Track
OMEGA, P, ALPHA, F, Q_NB, ANGLE, NIS, INNOVATION, SIGMA = 0, 3, 12, 15, 18, 22, 23, 24, 30
STILL, STARTED, TWO, SIGN = (
    36,
    37,
    38,
    39,
)  # two: two signs are followed; variance of the sign, (rad/s)^2
P_N, V_N, BIAS, BOUND, SIGHT, WIDTH = (
    40,
    43,
    46,
    58,
    61,
    64,
)  # bias: of omega', of p, of the products; bound: rad/s


class Track(NamedTuple):
    """States after each of n samples, as the live steps give them."""

    omega_b: Array  # (n, 3) rad/s
    P: Array  # (n, 3, 3) (rad/s)^2
    alpha_b: Array  # (n, 3) rad/s^2
    f_b: Array  # (n, 3) m/s^2
    q_nb: Array  # (n, 4)
    angle_z: Array  # (n,) rad
    nis: Array  # (n,); 0 without correction
    innovation: Array  # (n, 6)
    innovation_sigma: Array  # (n, 6)
    still: NDArray[np.bool_]  # (n,)
    started: NDArray[np.bool_]  # (n,)


def of(rows: Array) -> Track:
    """Rows (n, WIDTH) by name."""
    return Track(
        rows[:, OMEGA : OMEGA + 3],
        rows[:, P : P + 9].reshape(-1, 3, 3),
        rows[:, ALPHA : ALPHA + 3],
        rows[:, F : F + 3],
        rows[:, Q_NB : Q_NB + 4],
        rows[:, ANGLE],
        rows[:, NIS],
        rows[:, INNOVATION : INNOVATION + 6],
        rows[:, SIGMA : SIGMA + 6],
        rows[:, STILL] > 0.0,
        rows[:, STARTED] > 0.0,
    )


@lean
def run(
    m: frame.Memory,
    w: stillness.Watch,
    s: Sensor,
    t: Tuning,
    c: stillness.Limits,
    b: Followed,
    whole: Sensor,
    follows: bool,
    times: Array,
    samples: Array,
    rows: Array,
) -> None:
    """advance() over samples (n, N) at times (n,), s; rows (n, WIDTH) become what is known after
    each.

    b: the bound along the estimate, of the sensor `whole`; untouched unless follows.
    """
    for k in range(len(times)):
        frame.advance(m, w, s, t, c, times[k], samples[k])
        write(m, w, rows[k])
        row, started, still = rows[k], m.marks[frame.STARTED] == 1, m.marks[frame.STILL] == 1
        row[SIGHT : SIGHT + 3] = sight.VALID if started else sight.BLIND
        if follows and started:
            alpha, q_nb = row[ALPHA : ALPHA + 3], row[Q_NB : Q_NB + 4]
            bound_live.step(b, whole, m.core[0:3], alpha, q_nb, still, m.clock[frame.DT])
        for i in range(3):
            row[BOUND + i] = b.sigma[i] if follows else 0.0
        if started and not still:
            core, out, two = m.core, row[SIGHT : SIGHT + 3], m.marks[frame.BRANCHES] == 2
            variances = (core[STATES], core[STATES + STATES + 1], core[STATES + 2 * STATES + 2])
            sight.judge(core[0:3], variances, row[SIGN], two, s, m.clock[frame.DT], out)


@lean
def write(m: frame.Memory, w: stillness.Watch, row: Array) -> None:
    """The filter's state as a row, without bound and sight."""
    core, y = m.core, w.y[(w.n[stillness.COUNT] - 1) % stillness.DEPTH]
    started = m.marks[frame.STARTED] == 1
    for i in range(3):
        row[OMEGA + i], row[ALPHA + i], row[F + i] = (
            core[i],
            y[i] - core[3 + i],
            y[9 + i] - core[15 + i],
        )
        row[P_N + i], row[V_N + i] = core[kernel.P_N + i], core[kernel.V_N + i]
        row[BIAS + i], row[BIAS + 3 + i] = core[3 + i], core[15 + i]
        for j in range(3):
            row[P + 3 * i + j] = core[STATES + STATES * i + j]
        if not started:
            row[P + 4 * i] = frame.UNKNOWN_RATE**2
    for i in range(4):
        row[Q_NB + i] = core[kernel.Q_NB + i]
    for i in range(6):
        row[BIAS + 6 + i] = core[BIASES[3 + i]]
        row[INNOVATION + i], row[SIGMA + i] = m.out[kernel.INNOVATION + i], m.out[kernel.SIGMA + i]
    row[ANGLE], row[NIS], row[SIGN] = core[TURNED], m.out[kernel.NIS], core[kernel.SIGN]
    row[STARTED], row[STILL] = 1.0 if started else 0.0, 1.0 if m.marks[frame.STILL] == 1 else 0.0
    row[TWO] = 1.0 if m.marks[frame.BRANCHES] == 2 else 0.0
    if m.marks[frame.BRANCHES] == 2:
        _between(m, row)


@lean
def _between(m: frame.Memory, row: Array) -> None:
    """omega and the angle become the mean over both signs by their probability, P the covariance
    about it (E-46).
    """
    wrong = 1.0 / (1.0 + np.exp(m.clock[frame.BALANCE]))
    for i in range(3):
        row[OMEGA + i] += wrong * (m.other[i] - m.core[i])
        for j in range(3):
            at = STATES + STATES * i + j
            apart = (m.other[i] - m.core[i]) * (m.other[j] - m.core[j])
            row[P + 3 * i + j] = (
                (1.0 - wrong) * m.core[at] + wrong * m.other[at] + wrong * (1.0 - wrong) * apart
            )
    row[ANGLE] += wrong * (m.other[TURNED] - m.core[TURNED])
