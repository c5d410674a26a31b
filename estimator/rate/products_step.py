"""One sample through a products filter: biases, prediction, corrections, navigation; all in place (E-30 to E-39)."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from estimator.attitude.rotation import from_rotation_vector, multiply, tilt_correction, to_dcm
from estimator.rate import products_kernel as kernel
from estimator.rate import unscented
from estimator.rate.observed import Sensor
from estimator.rate.products_kernel import (
    ALPHA,
    FORCE,
    FORCE_NIS,
    FORCE_USED,
    FORGET,
    GRAVITY,
    LEVEL,
    LIKELIHOOD,
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
    Tuning,
)
from estimator.rate.products_model import BIASES, FIRST, SECOND, STATES

Array = NDArray[np.float64]

SURE = 16.0  # of |omega|^2 over its variance: the sign is certain, products may narrow the variance


@njit(cache=True, error_model="numpy", inline="always")
def step(core: Array, s: Sensor, t: Tuning, y: Array, at: Array, dt: float, turning: bool, fixed: bool, grow: float,
         out: Array) -> None:  # fmt: skip
    """core (flat state) takes one sample y = [alpha_m, c_m, p_m] (12,), dt (s) after the last.

    turning is what the still detector denies; fixed: about an axis that keeps its direction; grow: s of bias growth
    due now, 0 for most samples. out (OUT,) tells what the corrections said.
    """
    x, P = core[:STATES], core[STATES:PP].reshape(STATES, STATES)
    if grow > 0.0:
        _grow(core, P, s, t, grow, turning)
    before, alpha = core[:PP].copy(), np.empty(3)
    earth_b = _earth(core, t)
    nis, logdet, force_nis, force_logdet, used = 0.0, 0.0, 0.0, 0.0, False
    fixed = fixed and x[0] * x[0] + x[1] * x[1] + x[2] * x[2] > t.axis_from
    for attempt in range(2):
        N = kernel.along_axis(x, fixed, turning or attempt == 1)
        for i in range(3):
            last = core[ALPHA + i]
            alpha[i] = 0.5 * (last + y[i]) if attempt == 0 else last
        if t.method == UKF:
            unscented.predict(x, P, alpha, N, dt, turning or attempt == 1, s, earth_b)
        else:
            kernel.predict(x, P, alpha, N, dt, turning or attempt == 1, s, earth_b)
        if t.method == FORGET and turning:
            _forget(P, s, t, dt)
        else:
            kernel.add_noise(P, N, dt, turning or attempt == 1, s, t)
        if attempt == 1:  # a damaged sample: its omega' must not be integrated either
            for i in range(3):
                P[i, i] += t.unseen_alpha * dt * dt
            break
        if t.method == UKF:
            nis, logdet = unscented.by_products(x, P, y[3:9], s, t, out)
        else:
            nis, logdet = kernel.by_products(x, P, y[3:9], x[0:3].copy() if np.isnan(at[0]) else at, s, t, out)
        used = nis <= t.products_gate
        if used:
            break
        core[:PP] = before
    f_b = x[12:15].copy()
    if used:
        if t.centre_sees:
            force_nis, force_logdet = kernel.by_force(x, P, y[9:12], alpha - x[3:6], turning, s, t)
        if not turning:
            kernel.by_standstill(x, P, y[0:3], earth_b, s, t)
        for i in range(3):
            core[ALPHA + i] = y[i]
            f_b[i] = y[9 + i] - x[15 + i]
    out[NIS], out[USED], out[FORCE_NIS] = nis, 1.0 if used else 0.0, force_nis
    out[FORCE_USED] = 1.0 if force_nis <= t.force_gate else 0.0
    out[LIKELIHOOD] = -0.5 * (min(nis, t.products_gate) + logdet + min(force_nis, t.force_gate) + force_logdet)
    _sign(core, P, s, dt, turning)
    _navigate(core, before[0:3], f_b, dt, earth_b)


@njit(cache=True, error_model="numpy")
def _forget(P: Array, s: Sensor, t: Tuning, dt: float) -> None:
    """Exponential forgetting (E-47): P grows by its own size, up to what is known before any sample."""
    for i in range(12):
        known = 4.0 if i < 3 else t.bias * s.drift[i - 3, i - 3]
        if P[i, i] < known:
            root = np.exp(0.5 * t.forget * dt)
            for j in range(STATES):
                P[i, j] *= root
                P[j, i] *= root


@njit(cache=True, error_model="numpy")
def _earth(core: Array, t: Tuning) -> Array:
    """Earth's rate in b, (3,), rad/s; zero unless asked for."""
    earth_n = np.array([t.earth_north, 0.0, t.earth_down])
    if t.earth_north == 0.0 and t.earth_down == 0.0:
        return earth_n
    return np.ascontiguousarray(to_dcm(core[Q_NB : Q_NB + 4]).T) @ earth_n


@njit(cache=True, error_model="numpy")
def _grow(core: Array, P: Array, s: Sensor, t: Tuning, seconds: float, turning: bool) -> None:
    """What the biases became in `seconds`: a walk, and scale errors (E-37).

    A scale error e of an axis is a bias e (f - f at the last standstill): it comes and goes with the readings. So what
    is known of a bias beyond that at rest, and its deviation, follow the readings up and down again.
    """
    x, rest = core[:STATES], core[REST : REST + s.n]
    bias, variance, level = core[REST_BIAS:REST_VARIANCE], core[REST_VARIANCE:LEVEL], core[LEVEL:REST]
    away = np.zeros(s.n)
    for i in range(s.n):
        reading = s.theta_b[i, 0] * x[12] + s.theta_b[i, 1] * x[13] + s.theta_b[i, 2] * x[14]
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
            bias[k], variance[k], level[k] = x[b], P[b, b], P[b, b]
        now += variance[k]
        follow = np.sqrt(now / level[k])
        level[k] = now
        x[b] = bias[k] + follow * (x[b] - bias[k])
        for j in range(STATES):
            P[b, j] *= follow
        for j in range(STATES):
            P[j, b] *= follow
    for k in range(12):
        for l in range(12):
            P[BIASES[k], BIASES[l]] += s.drift[k, l] * t.drift * seconds


@njit(cache=True, error_model="numpy")
def _sign(core: Array, P: Array, s: Sensor, dt: float, turning: bool) -> None:
    """Variance of omega along itself for the question of its sign: products narrow it only where the sign is certain.

    The products say the same of omega and -omega; through zero only the integral tells them apart (E-43).
    """
    w = core[0:3]
    square, along = 0.0, 0.0
    for i in range(3):
        square += w[i] * w[i]
        for j in range(3):
            along += w[i] * P[i, j] * w[j]
    if not turning:
        core[SIGN] = max(P[0, 0], P[1, 1], P[2, 2])
    elif square > SURE * core[SIGN]:
        core[SIGN] = along / square
    else:
        core[SIGN] += dt * dt * max(s.R_alpha[0, 0], s.R_alpha[1, 1], s.R_alpha[2, 2])


@njit(cache=True, error_model="numpy")
def _navigate(core: Array, omega_before: Array, f_b: Array, dt: float, earth_b: Array) -> None:
    """Attitude by the mean rate, tilt by u; then velocity and position from f_b (E-12, E-13)."""
    mean = 0.5 * (omega_before + core[0:3])
    q = multiply(core[Q_NB : Q_NB + 4], from_rotation_vector(dt * (mean - earth_b)))
    q = tilt_correction(q, core[12:15], 1.0)
    core[Q_NB : Q_NB + 4] = q
    C = to_dcm(q)
    for i in range(3):
        force = C[i, 0] * f_b[0] + C[i, 1] * f_b[1] + C[i, 2] * f_b[2] + (GRAVITY if i == 2 else 0.0)
        v = core[V_N + i] + 0.5 * dt * (core[FORCE + i] + force)
        core[P_N + i] += 0.5 * dt * (core[V_N + i] + v)
        core[V_N + i], core[FORCE + i] = v, force
