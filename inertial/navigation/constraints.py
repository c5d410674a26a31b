"""What a car's wheels say: no sideways or vertical speed under way, no speed and no rate at
standstill. E-40, E-41.

Looked at twice a second. The vehicle's axes are the body's turned by two small mounting angles, and
its rear axle, that cannot slide, lies a distance behind the IMU: all three are states of the
filter.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from inertial.navigation.arrays import copy2, fill2
from inertial.navigation.leg import R_F, R_LENGTH, R_W, RING, Leg, Model, carry, close, correct
from inertial.navigation.mechanise import SINCE
from inertial.navigation.update import absorb, factor, innovate

Array = NDArray[np.float64]

ZUPT_ROWS, NHC_ROWS = 6, 2


class Rules(NamedTuple):
    """Constraint settings as the compiled code takes them."""

    every: float  # s between two looks; infinite: never
    sigma_side: float  # m/s
    sigma_up: float  # m/s
    least_speed: float  # m/s, below which wheels say nothing of the direction
    most_turn: float  # rad/s, above which tyres slip
    still_v: float  # m/s, sigma of zero velocity
    still_w: float  # rad/s, sigma of zero rate
    still_speed: float  # m/s, the filter's own speed above which nothing is a standstill
    still_f_change: float  # m/s^2, largest standard deviation of tick means at standstill
    still_w_change: float  # rad/s, likewise
    huber: float  # Mahalanobis distance from which a constraint is weighted down


@njit(cache=True)
def standing(leg: Leg, r: Rules) -> bool:
    """True when the last second looks like a standstill: quiet readings, no turn, no speed
    (E-41).
    """
    ring, x = leg.ring, leg.x
    if math.hypot(x[3], x[4]) > r.still_speed:
        return False
    mean, square, count = np.zeros(6), np.zeros(6), 0
    for k in range(RING - 10, RING):
        T = ring[k, R_LENGTH]
        if T < 0.05:
            continue
        count += 1
        for i in range(3):
            f, w = ring[k, R_F + i] / T, ring[k, R_W + i] / T
            mean[i] += f
            square[i] += f * f
            mean[3 + i] += w
            square[3 + i] += w * w
    if count < 8:
        return False
    for i in range(6):
        mean[i] /= count
        deviation = math.sqrt(max(0.0, square[i] / count - mean[i] * mean[i]))
        if deviation > (r.still_f_change if i < 3 else r.still_w_change):
            return False
        if i >= 3 and abs(mean[i] - x[15 + i]) > 3.0 * r.still_w_change:
            return False
    return True


@njit(cache=True)
def constraint(leg: Leg, m: Model, r: Rules, y: Array, H: Array, R: Array) -> int:
    """Fill y, H and R with what holds now; returns the number of rows, 0 for nothing. The leg stays
    as it is.
    """
    x, ring = leg.x, leg.ring
    last = ring[RING - 1]
    T = last[R_LENGTH]
    if T <= 0.0:
        return 0
    fill2(H, 0.0)
    fill2(R, 0.0)
    if standing(leg, r):
        for i in range(3):
            y[i] = x[3 + i]
            H[i, 3 + i] = 1.0
            R[i, i] = r.still_v * r.still_v
            # computed minus true rate: what is left of the bias
            y[3 + i] = last[R_W + i] / T - x[18 + i]
            H[3 + i, 12 + i] = 1.0
            R[3 + i, 3 + i] = r.still_w * r.still_w
        return ZUPT_ROWS
    if m.car < 0:
        return 0
    v_n = x[3:6]
    C = x[6:15].reshape(3, 3)
    v, w = np.empty(3), np.empty(3)
    for i in range(3):
        v[i] = C[0, i] * v_n[0] + C[1, i] * v_n[1] + C[2, i] * v_n[2]
        w[i] = last[R_W + i] / T - x[18 + i]
    if v[0] < r.least_speed or abs(w[2]) > r.most_turn:
        return 0
    pitch, yaw, axle = x[29], x[30], x[31]
    y[0] = v[1] - yaw * v[0] - w[2] * axle
    y[1] = v[2] + pitch * v[0] + w[1] * axle
    cross = np.array(((0.0, -v_n[2], v_n[1]), (v_n[2], 0.0, -v_n[0]), (-v_n[1], v_n[0], 0.0)))
    for j in range(3):
        side = C[j, 1] - yaw * C[j, 0]
        up = C[j, 2] + pitch * C[j, 0]
        H[0, 3 + j] = side
        H[1, 3 + j] = up
        for i in range(3):
            H[0, i] -= side * cross[j, i]
            H[1, i] -= up * cross[j, i]
    H[0, 14], H[1, 13] = -axle, axle  # the rate that is left over turns the axle about the IMU
    H[0, m.car + 1], H[0, m.car + 2] = -v[0], -w[2]
    H[1, m.car], H[1, m.car + 2] = v[0], w[1]
    R[0, 0], R[1, 1] = r.sigma_side * r.sigma_side, r.sigma_up * r.sigma_up
    return NHC_ROWS


@njit(cache=True)
def constrain(leg: Leg, m: Model, r: Rules, scratch: Array, c: Array) -> bool:
    """Apply what holds now, the estimate being c (n,), and start a new leg; scratch (3, n, n).
    False: nothing held.
    """
    leg.acc[SINCE] = 0.0
    H, y, R = np.empty((7, m.n)), np.empty(7), np.empty((7, 7))
    rows = constraint(leg, m, r, y, H, R)
    if rows == 0:
        return False
    close(leg, m)
    leg.acc[SINCE] = 0.0
    P = scratch[0]
    carry(leg.P, leg.Phi, leg.Q, 1.0, scratch[1], P)
    PHt, S, G, u = np.empty((m.n, 7)), np.empty((7, 7)), np.empty((7, 7)), np.empty(7)
    innovate(P, y, H, R, rows, PHt, S)
    nis = factor(S, y, rows, G, u)
    if not nis >= 0.0:
        return False
    d = math.sqrt(nis / rows)
    if d > r.huber:  # wheels slip and ground shakes: less weight, never none
        for i in range(rows):
            for j in range(rows):
                more = S[i, j] * (d / r.huber - 1.0)
                S[i, j] += more
                R[i, j] += more
        factor(S, y, rows, G, u)
    absorb(P, PHt, G, u, rows, c)
    copy2(P, leg.P)
    correct(leg, m, c)
    return True
