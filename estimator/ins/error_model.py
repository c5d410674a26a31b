"""Error model of the strapdown mechanisation: F, Phi, Q and the measurement of a GNSS fix.

Error state (15,), error = computed - true, positions in metres:
    psi_n (3, rad)  dv_n (3, m/s)  dN dE dh (m)  B (3, m/s^2)  D (3, rad/s)
with C_true = Exp(psi) C_computed, B and D what is left of the biases after the current estimates. Equations E-26 to
E-31 of docs/equations-ins.md (inmotion-alignment, sections 3 to 5, metres form; each entry is tested against finite
differences of the mechanisation).
"""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from estimator.ins.earth import OMEGA, earth_rate, gravity, ned_between, radii, transport_rate

Array = NDArray[np.float64]

STATES = 15
PSI, DV, DP, B, D = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 12), slice(12, 15)


@dataclass(frozen=True)
class ImuNoise:
    """Noise of a consumer IMU in a moving car, vibration included."""

    accel: float = 0.1  # m/s^2/sqrt(Hz)
    gyro: float = math.radians(0.1)  # rad/s/sqrt(Hz)
    sigma_bias_accel: float = 0.03  # m/s^2, Gauss-Markov
    sigma_bias_gyro: float = math.radians(0.05)  # rad/s, Gauss-Markov
    tau: float = 300.0  # s, of both
    position: float = 1e-3  # m/sqrt(s), keeps the position covariance from closing completely

    def vector(self) -> Array:
        """(17,): diagonal of the noise density G (15), then the two Gauss-Markov rates 1/tau."""
        a = 1.0 / self.tau
        psi, v, p = self.gyro**2, self.accel**2, self.position**2
        ba, bg = 2.0 * a * self.sigma_bias_accel**2, 2.0 * a * self.sigma_bias_gyro**2
        return np.array([psi] * 3 + [v] * 3 + [p] * 3 + [ba] * 3 + [bg] * 3 + [a, a])


@njit(cache=True)
def fill_error_matrix(x: Array, f_n: Array, rate_a: float, rate_g: float, F: Array) -> None:
    """F (15, 15) := continuous error dynamics at nominal x (21,) under specific force f_n (3,) (E-27)."""
    F[:, :] = 0.0
    L, h, vN, vE, vD = x[0], x[2], x[3], x[4], x[5]
    R_N, R_E = radii(L)
    n, e = R_N + h, R_E + h
    s, c, t = math.sin(L), math.cos(L), math.tan(L)
    Os, Oc = OMEGA * s, OMEGA * c
    ie0, ie1, ie2 = earth_rate(L)
    en0, en1, en2 = transport_rate(L, h, vN, vE)
    w0, w1, w2 = ie0 + en0, ie1 + en1, ie2 + en2

    F[0, 1], F[0, 2], F[1, 0], F[1, 2], F[2, 0], F[2, 1] = w2, -w1, -w2, w0, w1, -w0
    F[0, 4], F[1, 3], F[2, 4] = 1.0 / e, -1.0 / n, -t / e
    F[0, 6], F[0, 8] = -Os / n, -vE / (e * e)
    F[1, 8] = vN / (n * n)
    F[2, 6], F[2, 8] = (-Oc - vE / (e * c * c)) / n, vE * t / (e * e)

    F[3, 1], F[3, 2] = -f_n[2], f_n[1]
    F[4, 0], F[4, 2] = f_n[2], -f_n[0]
    F[5, 0], F[5, 1] = -f_n[1], f_n[0]
    F[3, 3], F[3, 4], F[3, 5] = vD / n, -2.0 * Os - 2.0 * vE * t / e, vN / n
    F[4, 3], F[4, 4], F[4, 5] = 2.0 * Os + vE * t / e, (vD + vN * t) / e, 2.0 * Oc + vE / e
    F[5, 3], F[5, 4] = -2.0 * vN / n, -2.0 * Oc - 2.0 * vE / e
    F[3, 6] = (-2.0 * Oc * vE - vE * vE / (e * c * c)) / n
    F[3, 8] = -vN * vD / (n * n) + vE * vE * t / (e * e)
    F[4, 6] = (2.0 * (Oc * vN - Os * vD) + vN * vE / (e * c * c)) / n
    F[4, 8] = -vE * (vD + vN * t) / (e * e)
    F[5, 6] = 2.0 * Os * vE / n
    F[5, 8] = vE * vE / (e * e) + vN * vN / (n * n) - 2.0 * gravity(L, h) / (math.sqrt(R_N * R_E) + h)

    F[6, 3], F[7, 4], F[8, 5] = 1.0, 1.0, -1.0
    F[6, 6], F[6, 8] = -vD / n, -vN / n
    F[7, 6], F[7, 7], F[7, 8] = vE * t / n, -vD / e - vN * t / n, -vE / e
    for i in range(3):
        for j in range(3):
            F[i, 12 + j] = -x[6 + 3 * i + j]
            F[3 + i, 9 + j] = x[6 + 3 * i + j]
        F[9 + i, 9 + i] = -rate_a
        F[12 + i, 12 + i] = -rate_g


@njit(cache=True)
def _multiply(left: Array, right: Array, out: Array) -> None:
    """out := left right for square matrices; zeros of left cost nothing."""
    n = left.shape[0]
    for i in range(n):
        for j in range(n):
            out[i, j] = 0.0
        for k in range(n):
            a = left[i, k]
            if a != 0.0:
                for j in range(n):
                    out[i, j] += a * right[k, j]


@njit(cache=True)
def _multiply_transposed(left: Array, right: Array, out: Array) -> None:
    """out := left right^T, made symmetric: for products that are symmetric but for rounding."""
    n = left.shape[0]
    for i in range(n):
        for j in range(i + 1):
            s = 0.0
            for k in range(n):
                s += left[i, k] * right[j, k]
            out[i, j] = s
            out[j, i] = s


@njit(cache=True)
def accumulate(F: Array, T: float, noise: Array, Phi: Array, Q: Array, work: Array) -> None:
    """Carry Phi and Q (15, 15) in place over T s of constant F (E-28); noise (17,), work is scratch (4, 15, 15).

    Phi_i = I + FT + (FT)^2/2 + (FT)^3/6;  Q_i = T/2 (Phi_i G Phi_i^T + G)
    Phi <- Phi_i Phi;  Q <- Phi_i Q Phi_i^T + Q_i
    """
    n = STATES
    Phi_i, FT, power, scratch = work[0], work[1], work[2], work[3]
    for i in range(n):
        for j in range(n):
            FT[i, j] = F[i, j] * T
            power[i, j] = FT[i, j]
            Phi_i[i, j] = FT[i, j]
        Phi_i[i, i] += 1.0
    for k in range(2, 4):
        _multiply(FT, power, scratch)
        for i in range(n):
            for j in range(n):
                power[i, j] = scratch[i, j] / k
                Phi_i[i, j] += power[i, j]
    # Phi_i (Q + T/2 G) Phi_i^T + T/2 G is the same sum with one product less
    for i in range(n):
        Q[i, i] += 0.5 * T * noise[i]
    _multiply(Phi_i, Q, scratch)
    _multiply_transposed(scratch, Phi_i, Q)
    for i in range(n):
        Q[i, i] += 0.5 * T * noise[i]
    _multiply(Phi_i, Phi, scratch)
    Phi[:, :] = scratch


@njit(cache=True)
def fix_residual(x: Array, w: Array, lever: Array, fix: Array, y: Array, H: Array) -> None:
    """y (6,) and H (6, 15) of a fix (6,: L, l in rad, h in m, v_n in m/s) at nominal x (21,) (E-30).

    w (3,) is the measured rate, lever (3,) the antenna from the IMU in b, m. Rows: north, east, height, v_n.
    """
    C = x[6:15].reshape(3, 3)
    H[:, :] = 0.0
    ie0, ie1, ie2 = earth_rate(x[0])
    eb = np.empty(3)
    for i in range(3):
        eb[i] = w[i] - x[18 + i] - (C[0, i] * ie0 + C[1, i] * ie1 + C[2, i] * ie2)
    a = lever
    swing = np.array((eb[1] * a[2] - eb[2] * a[1], eb[2] * a[0] - eb[0] * a[2], eb[0] * a[1] - eb[1] * a[0]))
    arm_n = np.empty(3)
    swing_n = np.empty(3)
    for i in range(3):
        arm_n[i] = C[i, 0] * a[0] + C[i, 1] * a[1] + C[i, 2] * a[2]
        swing_n[i] = C[i, 0] * swing[0] + C[i, 1] * swing[1] + C[i, 2] * swing[2]
    # from the fix to us, measured with our own radii: the same metres as the error state
    north, east, _ = ned_between(x[0], x[1], x[2], fix[0], fix[1], fix[2])
    y[0] = arm_n[0] - north
    y[1] = arm_n[1] - east
    y[2] = x[2] - fix[2] - arm_n[2]
    for i in range(3):
        y[3 + i] = x[3 + i] + swing_n[i] - fix[3 + i]
        H[3 + i, 3 + i] = 1.0
        H[i, 6 + i] = 1.0
    _cross_rows(arm_n, H[0:3])
    for j in range(3):
        H[2, j] = -H[2, j]  # height is up, the lever's third row is down
    _cross_rows(swing_n, H[3:6])
    for i in range(3):  # -C [a x]
        H[3 + i, 12] = -(C[i, 1] * a[2] - C[i, 2] * a[1])
        H[3 + i, 13] = -(C[i, 2] * a[0] - C[i, 0] * a[2])
        H[3 + i, 14] = -(C[i, 0] * a[1] - C[i, 1] * a[0])


@njit(cache=True)
def _cross_rows(v: Array, rows: Array) -> None:
    """rows[:, 0:3] := [v x]."""
    rows[0, 1], rows[0, 2] = -v[2], v[1]
    rows[1, 0], rows[1, 2] = v[2], -v[0]
    rows[2, 0], rows[2, 1] = -v[1], v[0]
