"""The navigation filter's kernels in numpy, as on paper: twins of inertial/core/navigation/.

Plain matrices instead of segments that know their zeros, integrals by sums over the samples instead
of ticks; equations E-106 to E-109, E-120, E-129, E-132 of docs/equations-ins.md.
"""

from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inertial.earth import gravity, radii
from inertial.rotation import skew
from tests.inertial.twins.strapdown import State, rates, step

Array = NDArray[np.float64]

PSI, DV, DP, B, D = (slice(k, k + 3) for k in range(0, 15, 3))
HEIGHT_UP = np.diag([1.0, 1.0, -1.0])


def F(x: State, f_n: Array, tau: float) -> Array:
    """(15, 15) of xdot = F x (E-107): numeric derivatives of (E-102) and (E-104) for the Earth's
    terms, the rest as written.
    """
    out = np.zeros((15, 15))
    ie, en = rates(x)
    out[PSI, PSI] = -skew(ie + en)
    out[DV, PSI] = skew(f_n)
    out[DV, B], out[PSI, D] = x.C_nb, -x.C_nb
    out[B, B] = out[D, D] = -np.eye(3) / tau
    for j, h in [(3, 1e-3), (4, 1e-3), (5, 1e-3), (6, 1.0), (7, 1.0), (8, 1.0)]:
        e = np.zeros(15)
        e[j] = h
        plus, minus = (_motion(x, s * e, f_n) for s in (1.0, -1.0))
        out[:9, j] += (plus - minus) / (2.0 * h)
    return out


def _motion(x: State, error: Array, f_n: Array) -> Array:
    """(9,): turn of n, acceleration and velocity in metres, of a state that is wrong by `error`."""
    R_N, R_E = radii(x.latitude)
    n, e = R_N + x.height, (R_E + x.height) * np.cos(x.latitude)
    place = (
        x.latitude + error[6] / n,
        x.longitude + error[7] / e,
        x.height + error[8],
    )
    there = State(*place, x.v_n + error[DV], x.C_nb)
    ie, en = rates(there)
    g_n = np.array([0.0, 0.0, gravity(there.latitude, there.height)])
    N, E = radii(there.latitude)
    metres = np.array(
        [
            there.v_n[0] * n / (N + there.height),
            there.v_n[1] * e / ((E + there.height) * np.cos(there.latitude)),
            -there.v_n[2],
        ]
    )
    return np.concatenate([ie + en, f_n + g_n - np.cross(2.0 * ie + en, there.v_n), metres])


def phi_and_q(x: State, imu: Array, density: Array, tau: float) -> tuple[Array, Array]:
    """Phi and Q (15, 15) over samples imu (n, 7), integrated sample by sample: Phi' = F Phi."""
    Phi, Q, before = np.eye(15), np.zeros((15, 15)), imu[0, 0] - (imu[1, 0] - imu[0, 0])
    for t, *reading in imu:
        dt = t - before
        f_b, omega_b = np.array(reading[:3]), np.array(reading[3:])
        after = step(x, f_b, omega_b, dt)
        f_n = 0.5 * (x.C_nb + after.C_nb) @ (f_b - x.bias_accel)
        A = F(x, f_n, tau) * dt
        one = np.eye(15) + A + 0.5 * A @ A
        half = 0.5 * dt * np.diag(density)
        Phi, Q = one @ Phi, one @ (Q + half) @ one.T + half
        x, before = after, t
    return Phi, Q


def wheels(x: Any, omega_b: Array) -> Array:
    """y (2,) of the wheels (E-120) at the core's Nominal x: sideways and vertical speed of the rear
    axle in the vehicle's axes.
    """
    v = x.C_nb.T @ x.v_n
    w = omega_b - x.bias_gyro
    return np.array(
        [
            v[1] - x.mount_yaw * v[0] - w[2] * x.axle,
            v[2] + x.mount_pitch * v[0] + w[1] * x.axle,
        ]
    )


def crisp_horizon(force: float, rate: float, rules: Any) -> float:
    """1 + No of a fuzzy.FuzzyRules (E-129), over interpolated sets."""
    sets = [
        [np.interp(value, points, ordinates) for ordinates in np.eye(3)]
        for value, points in ((force, rules.force), (rate, rules.rate))
    ]
    weights = np.array([min(p) if rules.minimum else p[0] * p[1] for p in product(*sets)])
    return 1.0 + float(weights @ np.ravel(rules.table) / weights.sum())


def drag_look(
    x: Array, P: Array, dt: float, noise: Array, y: Array, speed: Array, white: Array
) -> tuple[Array, Array, float]:
    """x (7,), P (7, 7) after a prediction and a correction with all axes at once (E-132), and the
    NIS.
    """
    Phi = np.eye(7)
    Phi[0:3, 3:6] = dt * np.eye(3)
    x, P = Phi @ x, Phi @ P @ Phi.T + np.diag([*noise, 0.0])
    H = np.hstack([np.eye(3), np.zeros((3, 3)), speed[:, None]])
    S = H @ P @ H.T + np.diag(white)
    K = P @ H.T @ np.linalg.inv(S)
    e = y - H @ x
    return x + K @ e, P - K @ H @ P, float(e @ np.linalg.solve(S, e))
