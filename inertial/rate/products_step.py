"""One sample through a products filter: biases, prediction, corrections, navigation; all in place
(E-30 to E-39).
"""

import numpy as np
from numpy.typing import NDArray

from inertial.rate import products_kernel as kernel
from inertial.rate import turns, unscented
from inertial.rate.compiling import fused
from inertial.rate.observed import Sensor
from inertial.rate.products_correct import by_force, by_products, by_standstill
from inertial.rate.products_kernel import (
    ALPHA,
    BEFORE,
    DENSITY,
    FORCE,
    FORCE_NIS,
    FORCE_USED,
    FORGET,
    GRAVITY,
    LATE,
    LEVEL,
    MISFIT,
    NIS,
    P_N,
    PP,
    Q_NB,
    REST,
    REST_BIAS,
    REST_VARIANCE,
    SIGN,
    UKF,
    USED,
    V_N,
    Three,
    Tuning,
)
from inertial.rate.products_model import BIASES, FIRST, SECOND, STATES
from inertial.rate.vectors import combine, scale

Array = NDArray[np.float64]

SURE = 16.0  # of |omega|^2 over its variance: the sign is certain, products may narrow the variance
LATELY = 1.0 / 16.0  # weight of one sample in the mean omega' that the pivot is told by


@fused
def step(
    core: Array,
    work: Array,
    s: Sensor,
    t: Tuning,
    y: Array,
    at: Three,
    dt: float,
    turning: bool,
    fixed: bool,
    grow: float,
    out: Array,
) -> None:
    """core (flat state) takes one sample y = [alpha_m, c_m, p_m] (12,), dt (s) after the last.

    at: omega that the products are linear about, not a number: that of the state. turning is what
    the still detector denies; fixed: about an axis that keeps its direction; grow: s of bias growth
    due now, 0 for most samples. work (WORK,) is for the filter's own use; out (OUT,) tells what the
    corrections said.
    """
    x, P = core[:STATES], core[STATES:PP]
    if grow > 0.0:
        _grow(core, P, work, s, t, grow, turning)
    for row in range(0, PP, STATES):
        combine(work, BEFORE + row, core, (row,), (1.0,))
    earth_b = _earth(core, t)
    force_nis, force_density = 0.0, 1.0
    w0, w1, w2 = x[0], x[1], x[2]
    fixed = fixed and w0 * w0 + w1 * w1 + w2 * w2 > t.axis_from
    alpha = (
        0.5 * (core[ALPHA] + y[0]),
        0.5 * (core[ALPHA + 1] + y[1]),
        0.5 * (core[ALPHA + 2] + y[2]),
    )
    _predict(x, P, work, alpha, dt, turning, fixed, turning, s, t, earth_b)
    if t.method == UKF:
        nis, density = unscented.by_products(x, P, work, y, s, t, out)
    else:
        if np.isnan(at[0]):
            at = (x[0], x[1], x[2])
        nis, density = by_products(x, P, work, y, at, s, t, out)
    used = nis <= t.products_gate
    if not used:  # a damaged sample: its omega' must not be integrated either
        for k in range(PP):
            core[k] = work[BEFORE + k]
        alpha = (core[ALPHA], core[ALPHA + 1], core[ALPHA + 2])
        _predict(x, P, work, alpha, dt, turning or not used, fixed, turning, s, t, earth_b)
        for i in range(3):
            P[23 * i] += t.unseen_alpha * dt * dt
    f_b = (x[12], x[13], x[14])
    if used:
        if t.centre_sees:
            free = (alpha[0] - x[3], alpha[1] - x[4], alpha[2] - x[5])
            late = (core[LATE] - x[3], core[LATE + 1] - x[4], core[LATE + 2] - x[5])
            force_nis, force_density = by_force(
                x, P, work, (y[9], y[10], y[11]), free, late, turning, s, t
            )
        if not turning:
            by_standstill(x, P, work, (y[0], y[1], y[2]), earth_b, s, t)
        for i in range(3):
            core[LATE + i] += LATELY * (core[ALPHA + i] - core[LATE + i])
            core[ALPHA + i] = y[i]
        f_b = (y[9] - x[15], y[10] - x[16], y[11] - x[17])
    out[NIS], out[USED], out[FORCE_NIS] = nis, 1.0 if used else 0.0, force_nis
    out[FORCE_USED] = 1.0 if force_nis <= t.force_gate else 0.0
    out[MISFIT] = min(nis, t.products_gate) + min(force_nis, t.force_gate)
    out[DENSITY] = density * force_density
    _sign(core, P, s, dt, turning)
    _navigate(core, 0.5 * (w0 + x[0]), 0.5 * (w1 + x[1]), 0.5 * (w2 + x[2]), f_b, dt, earth_b)


@fused
def _predict(
    x: Array,
    P: Array,
    work: Array,
    alpha: Three,
    dt: float,
    moving: bool,
    fixed: bool,
    turning: bool,
    s: Sensor,
    t: Tuning,
    earth_b: Three,
) -> None:
    """Prediction by the filter's method, with noise. moving: omega' is integrated; turning: the
    detector's word.
    """
    N = kernel.along_axis(x[0], x[1], x[2], fixed, moving)
    if t.method == UKF:
        unscented.predict(x, P, alpha, N, dt, moving, s, earth_b)
    else:
        kernel.predict(x, P, work, alpha, N, dt, moving, s, earth_b)
    if t.method == FORGET and turning:
        _forget(P, s, t, dt)
    else:
        kernel.add_noise(P, N, dt, moving, s, t)


@fused
def _forget(P: Array, s: Sensor, t: Tuning, dt: float) -> None:
    """Exponential forgetting (E-47): P grows by its own size, up to what is known before any
    sample.
    """
    for i in range(12):
        known = 4.0 if i < 3 else t.bias * s.drift[i - 3, i - 3]
        if P[23 * i] < known:
            root = np.exp(0.5 * t.forget * dt)
            for j in range(STATES):
                P[STATES * i + j] *= root
                P[STATES * j + i] *= root


@fused
def _earth(core: Array, t: Tuning) -> Three:
    """Earth's rate in b, rad/s; zero unless asked for."""
    north, down = t.earth_north, t.earth_down
    if north == 0.0 and down == 0.0:
        return 0.0, 0.0, 0.0
    C = turns.matrix((core[Q_NB], core[Q_NB + 1], core[Q_NB + 2], core[Q_NB + 3]))
    return C[0] * north + C[6] * down, C[1] * north + C[7] * down, C[2] * north + C[8] * down


@fused
def _grow(
    core: Array, P: Array, work: Array, s: Sensor, t: Tuning, seconds: float, turning: bool
) -> None:
    """What the biases became in `seconds`: a walk, and scale errors (E-37).

    A scale error e of an axis is a bias e (f - f at the last standstill): it comes and goes with
    the readings. So what is known of a bias beyond that at rest, and its deviation, follow the
    readings up and down again.
    """
    x, rest = core[:STATES], core[REST : REST + s.n]
    bias, variance, level = (
        core[REST_BIAS:REST_VARIANCE],
        core[REST_VARIANCE:LEVEL],
        core[LEVEL:REST],
    )
    away, follow = work[0 : s.n], work[s.n : s.n + STATES]
    away[:], follow[:] = 0.0, 1.0
    f0, f1, f2 = x[12], x[13], x[14]
    if turning:  # the centre's own way about the pivot
        w0, w1, w2, r0, r1, r2 = x[0], x[1], x[2], x[18], x[19], x[20]
        wr, ww = w0 * r0 + w1 * r1 + w2 * r2, w0 * w0 + w1 * w1 + w2 * w2
        f0, f1, f2 = f0 + w0 * wr - ww * r0, f1 + w1 * wr - ww * r1, f2 + w2 * wr - ww * r2
    for i in range(s.n):
        reading = s.theta_b[i, 0] * f0 + s.theta_b[i, 1] * f1 + s.theta_b[i, 2] * f2
        if turning:
            for k in range(6):
                reading += s.Q[i, k] * x[FIRST[k]] * x[SECOND[k]]
            away[i] = (reading - rest[i]) ** 2 * t.scale
        else:
            rest[i] = reading
    for k in range(12):
        b = BIASES[k]
        if s.drift[k, k] == 0.0:
            continue
        now = 0.0
        for i in range(s.n):
            now += s.W[k, i] * s.W[k, i] * away[i]
        if not turning:
            bias[k], variance[k], level[k] = x[b], P[23 * b], P[23 * b]
        now += variance[k]
        follow[b] = np.sqrt(now / level[k])
        level[k] = now
        x[b] = bias[k] + follow[b] * (x[b] - bias[k])
    scale(P, work, s.n)
    for k in range(12):
        for l in range(12):
            P[STATES * BIASES[k] + BIASES[l]] += s.drift[k, l] * t.drift * seconds


@fused
def _sign(core: Array, P: Array, s: Sensor, dt: float, turning: bool) -> None:
    """Variance of omega along itself for the question of its sign: products narrow it only where
    the sign is certain.

    The products say the same of omega and -omega; through zero only the integral tells them apart
    (E-43).
    """
    w0, w1, w2 = core[0], core[1], core[2]
    square = w0 * w0 + w1 * w1 + w2 * w2
    if not turning:
        core[SIGN] = max(P[0], P[23], P[46])
    elif square > SURE * core[SIGN]:
        along = w0 * w0 * P[0] + w1 * w1 * P[23] + w2 * w2 * P[46]
        core[SIGN] = (along + 2.0 * (w0 * w1 * P[1] + w0 * w2 * P[2] + w1 * w2 * P[24])) / square
    else:
        core[SIGN] += dt * dt * max(s.R_alpha[0, 0], s.R_alpha[1, 1], s.R_alpha[2, 2])


@fused
def _navigate(
    core: Array, w0: float, w1: float, w2: float, f_b: Three, dt: float, earth_b: Three
) -> None:
    """Attitude by the mean rate w (rad/s), tilt by u; then velocity and position from f_b (E-12,
    E-13).
    """
    turn = turns.quaternion(dt * (w0 - earth_b[0]), dt * (w1 - earth_b[1]), dt * (w2 - earth_b[2]))
    q = turns.product((core[Q_NB], core[Q_NB + 1], core[Q_NB + 2], core[Q_NB + 3]), turn)
    q = turns.upright(q, core[12], core[13], core[14])
    core[Q_NB], core[Q_NB + 1], core[Q_NB + 2], core[Q_NB + 3] = q
    C = turns.matrix(q)
    for i in range(3):
        force = (
            C[3 * i] * f_b[0]
            + C[3 * i + 1] * f_b[1]
            + C[3 * i + 2] * f_b[2]
            + (GRAVITY if i == 2 else 0.0)
        )
        v = core[V_N + i] + 0.5 * dt * (core[FORCE + i] + force)
        core[P_N + i] += 0.5 * dt * (core[V_N + i] + v)
        core[V_N + i], core[FORCE + i] = v, force


@fused
def back(end: Array, now: Array, then: Array, samples: int, dt: float) -> Three:
    """omega that many samples before one with state `end`, by the sums of omega' measured up to now
    and then (E-49).
    """
    return (
        end[0] - dt * (now[0] - then[0] - samples * end[3]),
        end[1] - dt * (now[1] - then[1] - samples * end[4]),
        end[2] - dt * (now[2] - then[2] - samples * end[5]),
    )
