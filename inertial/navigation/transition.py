"""What a leg is made of, and Phi over one of its intervals. E-27, E-28."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from inertial.navigation.arrays import copy2, fill2, identity
from inertial.navigation.earth import OMEGA
from inertial.navigation.mechanise import F1, M1, M2, S1, S2, SHAKE, U1, U2, W1

Array = NDArray[np.float64]

CORE = 15
MOVING = 9  # rows of Phi that are more than a decay


class Model(NamedTuple):
    """What the error state consists of; integers below 0 mean that a filter does without these
    states.
    """

    n: int
    noise: Array  # (n,) diagonal of G
    decay: Array  # (n - 9,) 1/s
    place: Array  # (n - 9,) where in the nominal state, int64
    # (n - 9,) +1 where the estimated error is added to the nominal, -1 where it is taken off
    sign: Array
    scale: int  # first of six scale factors
    lag: int  # first of two latencies
    car: int  # first of three of a car: mounting pitch, yaw, distance to the rear axle
    shake: float  # share of the readings' shaking that is noise to navigation (E-51)


class Leg(NamedTuple):
    """Everything that changes between two fixes."""

    x: Array  # (NOMINAL,)
    P: Array  # (n, n) just after the last measurement
    Phi: Array  # (n, n) since then, closed intervals
    Q: Array  # (n, n)
    acc: Array  # (ACC,)
    ring: Array  # (RING, RING_COLUMNS) the last ticks, newest last
    work: Array  # (5, n, n) scratch, n at least 15


@njit(cache=True)
def _earth_terms(leg: Leg, T: float, E: Array) -> None:
    """E (9, 9) := T times the terms of F that are there because the Earth is round and turns
    (E-27).
    """
    x, acc = leg.x, leg.acc
    inv_n, inv_e, s, c, t = acc[26] * T, acc[27] * T, acc[23], acc[24], acc[25]
    vN, vE, vD = x[3], x[4], x[5]
    Os, Oc = OMEGA * s * T, OMEGA * c * T
    e0, e1, e2 = vE * inv_e, -vN * inv_n, -vE * t * inv_e
    w0, w1, w2 = Oc + e0, e1, -Os + e2
    rn, re = acc[26], acc[27]
    E[0, 1], E[0, 2], E[1, 0], E[1, 2], E[2, 0], E[2, 1] = w2, -w1, -w2, w0, w1, -w0
    E[0, 4], E[1, 3], E[2, 4] = inv_e, -inv_n, -t * inv_e
    E[0, 6], E[0, 8] = -Os * rn, -e0 * re
    E[1, 8] = -e1 * rn
    E[2, 6], E[2, 8] = (-Oc - e0 / (c * c)) * rn, -e2 * re
    E[3, 3], E[3, 4], E[3, 5] = vD * inv_n, -2.0 * Os - 2.0 * e0 * t, vN * inv_n
    E[4, 3], E[4, 4], E[4, 5] = 2.0 * Os + e0 * t, (vD + vN * t) * inv_e, 2.0 * Oc + e0
    E[5, 3], E[5, 4] = 2.0 * e1, -2.0 * Oc - 2.0 * e0
    E[3, 6] = (-2.0 * Oc * vE - vE * e0 / (c * c)) * rn
    E[3, 8] = e1 * vD * rn + e0 * vE * re * t
    E[4, 6] = (2.0 * (Oc * vN - Os * vD) + vN * e0 / (c * c)) * rn
    E[4, 8] = -e0 * (vD + vN * t) * re
    E[5, 6] = 2.0 * Os * vE * rn
    E[5, 8] = e0 * vE * re - e1 * vN * rn - 2.0 * T * acc[28] * np.sqrt(rn * re)
    E[6, 6], E[6, 8] = -vD * inv_n, -vN * inv_n
    E[7, 6], E[7, 7], E[7, 8] = vE * t * inv_n, -vD * inv_e - vN * t * inv_e, -e0


@njit(cache=True)
def transition(leg: Leg, m: Model, T: float, d: Array, Top: Array) -> None:
    """Upper rows (9, n) of Phi over the interval: the integrals of a flat Earth exactly, the round
    one's to (E-28).
    """
    acc, n = leg.acc, m.n
    main, E = leg.work[0], leg.work[1]
    identity(main)
    up = -1.0  # the third row of position counts height up
    for a in range(2):
        row, s = 3 + 3 * a, (S1 if a == 0 else S2)
        sign = 1.0 if a == 0 else up
        s0, s1, s2 = acc[s], acc[s + 1], acc[s + 2]
        main[row, 1], main[row, 2] = -s2, s1
        main[row + 1, 0], main[row + 1, 2] = s2, -s0
        main[row + 2, 0], main[row + 2, 1] = -s1 * sign, s0 * sign
    main[6, 3], main[7, 4], main[8, 5] = T, T, up * T
    for i in range(3):
        sign = up if i == 2 else 1.0
        for j in range(3):
            k = 3 * i + j
            accel = 0.5 * (1.0 + d[9 + j])
            gyro = 0.5 * (1.0 + d[12 + j])
            main[i, 12 + j] = -acc[U1 + k] * gyro
            main[3 + i, 9 + j] = acc[U1 + k] * accel
            main[3 + i, 12 + j] = -acc[M1 + k] * gyro
            main[6 + i, 9 + j] = sign * acc[U2 + k] * accel
            main[6 + i, 12 + j] = -sign * acc[M2 + k] * gyro
            if m.scale >= 0:  # the reading hardly changes against C: its mean over the interval
                f, w = acc[F1 + j] / T, acc[W1 + j] / T
                main[i, m.scale + 3 + j] = -acc[U1 + k] * w
                main[3 + i, m.scale + j] = acc[U1 + k] * f
                main[3 + i, m.scale + 3 + j] = -acc[M1 + k] * w
                main[6 + i, m.scale + j] = sign * acc[U2 + k] * f
                main[6 + i, m.scale + 3 + j] = -sign * acc[M2 + k] * w
    fill2(E, 0.0)
    _earth_terms(leg, 0.5 * T, E)
    copy2(main, Top)
    for i in range(MOVING):  # Phi = main + (E main + main E) T/2
        for k in range(MOVING):
            a = E[i, k]
            if a != 0.0:
                for j in range(n):
                    Top[i, j] += a * main[k, j]
                for j in range(MOVING):
                    Top[j, k] += main[j, i] * a


@njit(cache=True)
def shaken(acc: Array, m: Model, T: float, out: Array) -> None:
    """Half an interval's noise that comes from the readings' shaking, to out's first six rows and
    columns (E-51).

    Attitude and velocity, in n: an axis that shakes more than its neighbours is noisier than they
    are.
    """
    for i in range(6):
        for j in range(6):
            out[i, j] = 0.0
    for k in range(3):
        gyro, accel = 0.5 * T * m.shake * acc[SHAKE + 3 + k], 0.5 * T * m.shake * acc[SHAKE + k]
        for i in range(3):
            for j in range(3):
                a = (
                    acc[U1 + 3 * i + k] * acc[U1 + 3 * j + k] / (T * T)
                )  # U1 / T is the mean attitude
                out[i, j] += a * gyro
                out[3 + i, 3 + j] += a * accel
