"""The first state of a products filter: of a body at rest, or of one that turns already; compiled.

At a start while turning the products give omega but for its sign, and only as well as their biases
are known; gravity, turning in the body, gives the rest, the sign as well. A filter is no way to
begin there: with so wide a P its first few corrections are far from linear. So the most probable
state of the first samples is found for both signs (E-46).
"""

import numpy as np
from numpy.typing import NDArray

from inertial.rate import products_kernel as kernel
from inertial.rate import turns
from inertial.rate.compiling import lean, making
from inertial.rate.observed import Sensor
from inertial.rate.products_kernel import (
    ALPHA,
    GRAVITY,
    LATE,
    LEVEL,
    PP,
    Q_NB,
    REST,
    REST_VARIANCE,
    SIGN,
    Tuning,
)
from inertial.rate.products_model import (
    BIASES,
    FIRST,
    SECOND,
    STATES,
    TURNED,
    measured_force,
    measured_force_jacobian,
    measured_products,
    measured_products_jacobian,
    transition,
    transition_jacobian,
)
from inertial.rate.still import COUNT, DEPTH, FILLED, Watch

Array = NDArray[np.float64]

FEWEST, MOST = 8, 64  # samples of the first and the last fit
FITS = (8, 12, 16, 24, 32, 48, 64)  # samples of every fit; it begins with what the one before found
SURE_FROM = 32  # samples; the sign is not decided by fewer
ROUNDS = 14  # of Gauss and Newton, at most
# rad/s, sigma of omega about what the products say, in the fit: it is for the samples to tell
ANY_RATE = 5.0
FREE = (1.0, 0.0, 0.0, 1.0, 0.0, 1.0)  # all of omega' is integrated


@making
def begin(core: Array, s: Sensor, t: Tuning, mean: Array, theta_b: Array) -> None:
    """First state from the mean y (12,) of a short standstill (E-36)."""
    core[:] = 0.0
    P = core[STATES:PP].reshape(STATES, STATES)
    up = mean[9:12] / np.sqrt(np.sum(mean[9:12] ** 2))
    core[12:15] = GRAVITY * up
    for i in range(12):
        for j in range(12):
            P[BIASES[i], BIASES[j]] = t.bias * s.drift[i, j]
    for i in range(3):
        P[i, i] = t.still_rate / 25.0
        P[18 + i, 18 + i] = t.pivot
        for j in range(3):
            along = up[i] * up[j]
            P[12 + i, 12 + j] = t.gravity * along + t.tilt * ((1.0 if i == j else 0.0) - along)
    core[ALPHA : ALPHA + 3] = core[LATE : LATE + 3] = mean[0:3]
    core[SIGN] = t.still_rate / 25.0
    core[Q_NB : Q_NB + 4] = level(up)
    for k in range(12):
        core[REST_VARIANCE + k] = core[LEVEL + k] = t.bias * s.drift[k, k]
    for i in range(s.n):
        core[REST + i] = (
            theta_b[i, 0] * core[12] + theta_b[i, 1] * core[13] + theta_b[i, 2] * core[14]
        )


@making
def level(up: Array) -> Array:
    """q_nb of a body at rest whose up is `up`; x_b points north, or z_b where x_b is vertical
    (E-11).
    """
    ahead = np.array([1.0, 0.0, 0.0]) if abs(up[0]) < 0.999 else np.array([0.0, 0.0, 1.0])
    north = ahead - np.sum(ahead * up) * up
    north /= np.sqrt(np.sum(north * north))
    east = np.array(
        [
            north[1] * up[2] - north[2] * up[1],
            north[2] * up[0] - north[0] * up[2],
            north[0] * up[1] - north[1] * up[0],
        ]
    )
    C = np.empty((3, 3))
    C[0], C[1], C[2] = north, east, -up
    w = C[0, 0] + C[1, 1] + C[2, 2]
    squares = np.array(
        [1.0 + w, 1.0 - w + 2.0 * C[0, 0], 1.0 - w + 2.0 * C[1, 1], 1.0 - w + 2.0 * C[2, 2]]
    )
    a, b, c = C[2, 1] - C[1, 2], C[0, 2] - C[2, 0], C[1, 0] - C[0, 1]
    xy, xz, yz = C[0, 1] + C[1, 0], C[0, 2] + C[2, 0], C[1, 2] + C[2, 1]
    table = np.array(
        [
            [squares[0], a, b, c],
            [a, squares[1], xy, xz],
            [b, xy, squares[2], yz],
            [c, xz, yz, squares[3]],
        ]
    )
    q = table[np.argmax(squares)]
    q = q / np.sqrt(np.sum(q * q))
    return q if q[0] >= 0.0 else -q


@making
def mean(w: Watch, window: int) -> Array:
    """Mean y (12,) of the newest samples."""
    out = np.zeros(12)
    for k in range(1, window + 1):
        out += w.y[(w.n[COUNT] - k) % DEPTH] / window
    return out


@making
def _outer(y: Array) -> Array:
    Z = np.empty((3, 3))
    for k in range(6):
        Z[FIRST[k], SECOND[k]] = Z[SECOND[k], FIRST[k]] = y[3 + k]
    return Z


@making
def turning(w: Watch, s: Sensor, t: Tuning) -> bool:
    """Do the products of the newest samples say that the body turns, and not the axes' biases?"""
    if w.n[FILLED] < FEWEST or not s.plain:
        return False
    n = min(w.n[FILLED], 32)
    size = np.linalg.eigvalsh(_outer(mean(w, n)))[2]
    return size > 0.0 and size * size > t.start_turning * (t.bias * s.drift[3, 3] + s.R_c[0, 0] / n)


@making
def begin_turning(
    core: Array,
    other: Array,
    first: Array,
    other_first: Array,
    w: Watch,
    s: Sensor,
    t: Tuning,
    n: int,
) -> float:
    """States after the newest n samples for both signs of omega, the likelier in core (E-46).

    first, other_first: their states x (22,) at the first sample, from the fit before unless n is
    FEWEST. Returns by how much core is likelier, log of the ratio.
    """
    y = mean(w, n)
    sizes, directions = np.linalg.eigh(_outer(y))
    size = max(sizes[2], 0.1)
    for sign in (1.0, -1.0):
        c, x = (core, first) if sign > 0.0 else (other, other_first)
        begin(c, s, t, y, s.theta_b)
        for i in range(3):
            c[i] = sign * np.sqrt(size) * directions[i, 2]
        if n == FEWEST:
            x[:STATES] = c[:STATES]
    ratio = _fit(core, first, w, s, t, n, y, size) - _fit(other, other_first, w, s, t, n, y, size)
    if not ratio >= 0.0:
        for k in range(len(core)):
            core[k], other[k] = other[k], core[k]
        for k in range(STATES):
            first[k], other_first[k] = other_first[k], first[k]
    return abs(ratio) if np.isfinite(ratio) else 0.0


@making
def _fit(
    core: Array, first: Array, w: Watch, s: Sensor, t: Tuning, n: int, y_mean: Array, size: float
) -> float:
    """Most probable state after the newest n samples, from a guess `first` of that at their first:
    log evidence.

    core holds what is known before any sample; first becomes the most probable state at the first.

    Gauss and Newton with the filter's own model (E-30 to E-35) and what is known before any sample.
    omega' that the pivot is told by is the mean: noise in it would seem to say that the centre is
    on the axis.
    """
    P, prior = core[STATES:PP].reshape(STATES, STATES), core[:STATES].copy()
    for i in range(3):
        P[i, :] = 0.0
        P[:, i] = 0.0
        P[i, i] = ANY_RATE**2
        P[12 + i, 12 + i] += t.pivot * size * size  # centripetal acceleration was taken for gravity
    P[TURNED, TURNED] = 1e-8
    know, M, SQ, noise = np.linalg.inv(P), s.M.copy(), s.SQ.copy(), np.zeros((9, 9))
    noise[:6, :6] = s.R_c
    start, best, x, lowest = first[:STATES].copy(), prior, prior, np.inf
    N, moved, H, r = know.copy(), np.eye(STATES), np.zeros((9, STATES)), np.zeros(9)
    rounds, damp, last, size_of, pull = 0, 1e-3, np.inf, know, prior
    while True:
        x, moved, away = start.copy(), np.eye(STATES), start - prior
        N, g = know.copy(), -(know @ away)
        misfit = -np.sum(away * g)
        arm = start[18] ** 2 + start[19] ** 2 + start[20] ** 2
        felt = np.sqrt(start[12] ** 2 + start[13] ** 2 + start[14] ** 2)
        misfit += (
            GRAVITY - felt
        ) ** 2 / t.gravity  # the size of u is known, whatever its direction
        for i in range(3):
            g[12 + i] += start[12 + i] / felt * (GRAVITY - felt) / t.gravity
            for j in range(3):
                N[12 + i, 12 + j] += start[12 + i] * start[12 + j] / (felt * felt * t.gravity)
                noise[6 + i, 6 + j] = s.R_p[i, j] + (
                    t.centre + arm * s.R_alpha[0, 0] / n if i == j else 0.0
                )
        weight = np.linalg.inv(noise)
        for ago in range(n - 1, -1, -1):
            k = (w.n[COUNT] - 1 - ago) % DEPTH
            y = w.y[k].copy()
            if ago < n - 1:
                before = x
                alpha = 0.5 * (y[0:3] + w.y[(k - 1) % DEPTH, 0:3])
                x = transition(before, alpha, SQ, w.dt[k], True)
                moved = transition_jacobian(before, x, SQ, w.dt[k], True) @ moved
            H[:6] = measured_products_jacobian(x, M)
            H[6:] = measured_force_jacobian(x, y_mean[0:3] - x[3:6], SQ)
            r[:6] = y[3:9] - measured_products(x, M)
            r[6:] = y[9:12] - measured_force(x, y_mean[0:3] - x[3:6], SQ)
            G = H @ moved
            GW = np.ascontiguousarray(G.T) @ weight
            N += GW @ G
            g += GW @ r
            misfit += np.sum(r * (weight @ r))
        rounds += 1
        if misfit < lowest or rounds == ROUNDS:
            best, damp, last = start, 0.1 * damp, lowest - misfit
            lowest = misfit
            if last < 0.2 or rounds == ROUNDS:  # x, N and moved belong to it
                break
            size_of, pull = N, g
        else:  # too far
            damp *= 10.0
        start = best + np.linalg.solve(size_of + damp * np.diag(np.diag(size_of)), pull)
        if rounds == ROUNDS - 1:
            start = best
    first[:STATES] = best
    evidence = -0.5 * (misfit + np.linalg.slogdet(N)[1])
    up = best[12:15] / np.sqrt(np.sum(best[12:15] ** 2))
    core[:STATES] = x
    P[:, :] = moved @ np.linalg.inv(N) @ np.ascontiguousarray(moved.T)
    for i in range(STATES):
        for j in range(i):
            P[i, j] = P[j, i] = 0.5 * (P[i, j] + P[j, i])
    dt = w.dt[(w.n[COUNT] - 1) % DEPTH]
    for i in range(3):
        for j in range(3):
            P[i, j] += n * dt * dt * s.R_alpha[i, j]
        core[ALPHA + i], core[LATE + i] = w.y[(w.n[COUNT] - 1) % DEPTH, i], y_mean[i]
    core[SIGN] = 0.0
    core[Q_NB : Q_NB + 4] = level(up)
    whole = (n - 1) * dt
    middle = 0.5 * (best[0:3] + x[0:3])
    _turn(core, whole * middle[0], whole * middle[1], whole * middle[2])
    return evidence


@lean
def _turn(core: Array, v0: float, v1: float, v2: float) -> None:
    q = (core[Q_NB], core[Q_NB + 1], core[Q_NB + 2], core[Q_NB + 3])
    core[Q_NB], core[Q_NB + 1], core[Q_NB + 2], core[Q_NB + 3] = turns.product(
        q, turns.quaternion(v0, v1, v2)
    )


@lean
def carry(core: Array, work: Array, y: Array, dt: float, s: Sensor, t: Tuning) -> None:
    """State one sample y (12,), dt (s) later, by its omega' alone: between two fits."""
    x, P, before = core[:STATES], core[STATES:PP], (core[0], core[1], core[2])
    alpha = (
        0.5 * (core[ALPHA] + y[0]),
        0.5 * (core[ALPHA + 1] + y[1]),
        0.5 * (core[ALPHA + 2] + y[2]),
    )
    kernel.predict(x, P, work, alpha, FREE, dt, True, s, (0.0, 0.0, 0.0))
    kernel.add_noise(P, FREE, dt, True, s, t)
    half = 0.5 * dt
    _turn(core, half * (before[0] + x[0]), half * (before[1] + x[1]), half * (before[2] + x[2]))
    for i in range(3):
        core[ALPHA + i] = y[i]
