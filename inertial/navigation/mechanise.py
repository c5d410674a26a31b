"""The compiled loop over IMU samples: strapdown.step with everything held in registers, and sums
for the error model.

The nominal state is x (NOMINAL,): the 21 numbers of strapdown, then scale factors of both triads,
latencies of the receiver, and what a car's wheels tell of the mounting; slices below. Positions on
the ellipsoid change little in an interval of 0.1 s, so that the Earth's terms are carried to first
order from its start (next terms below 1e-13), which saves all trigonometry per sample. Equations
E-24, E-25, E-37.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from inertial.navigation.earth import OMEGA, gravity, radii

Array = NDArray[np.float64]

NOMINAL = 32
SCALE_F, SCALE_W = slice(21, 24), slice(24, 27)  # 1, measured / true - 1
LAG_P, LAG_V = 27, 28  # s, by which the receiver's position and velocity are older than they say
MOUNT_PITCH, MOUNT_YAW, AXLE = 29, 30, 31  # rad, rad, m: see constraints

TICK = 0.1  # s, after which the sums are folded into those of the interval, see leg
INTERVAL = 0.5  # s, after which Phi and Q are brought up to date

# acc: integrals over the open tick, and what the mechanisation froze at the start of the interval
SUM_F_N, SUM_C, SUM_F, SUM_W = 0, 3, 12, 15
TICK_LENGTH, TIME, SINCE = (
    18,
    19,
    20,
)  # s in the open tick; s, time of x; s since the last constraint was looked at
# 21..32: L, h, sin L, cos L, tan L, 1/n, 1/e, g, dg/dh, dg/dL, dn/dL, de/dL
# over the ticks of the open interval: f_n and C once and twice integrated, [f_n x] U1 likewise, f,
# w, length
S1, U1, U2, M1, M2, S2, F1, W1, LENGTH = 33, 36, 45, 54, 63, 72, 75, 78, 81
# the last whole sample, f then w, and what the readings shake: noise density squared of each of the
# six (E-51)
LAST, SHAKE = 82, 88
ACC = 94
SHAKE_MEMORY = 1.0  # s


@njit(cache=True)
def freeze(x: Array, acc: Array) -> None:
    """Take the Earth's terms at x for the interval that starts."""
    L, h = x[0], x[2]
    R_N, R_E = radii(L)
    g = gravity(L, h)
    acc[21], acc[22] = L, h
    acc[23], acc[24], acc[25] = math.sin(L), math.cos(L), math.tan(L)
    acc[26], acc[27] = 1.0 / (R_N + h), 1.0 / (R_E + h)
    acc[28], acc[29] = g, (gravity(L, h + 1.0) - gravity(L, h - 1.0)) * 0.5
    acc[30] = (gravity(L + 1e-4, h) - gravity(L - 1e-4, h)) / 2e-4
    N1, E1 = radii(L + 1e-4)
    N0, E0 = radii(L - 1e-4)
    acc[31], acc[32] = (N1 - N0) / 2e-4, (E1 - E0) / 2e-4


@njit(cache=True)
def mechanise(
    x: Array, acc: Array, t: Array, f: Array, w: Array, start: int, stop: int, until: float
) -> int:
    """Run samples start..stop-1 of t (n,) s, f and w (n, 3) to the end of the open tick, or to time
    `until`.

    Sample k acts from the time of the state to t[k]; the one that reaches over `until` acts in
    part. Returns the first sample not used up. In place; the state is the same to the bit however
    the samples are cut into calls.
    """
    L, l, h, vN, vE, vD = x[0], x[1], x[2], x[3], x[4], x[5]
    c00, c01, c02, c10, c11, c12, c20, c21, c22 = (
        x[6],
        x[7],
        x[8],
        x[9],
        x[10],
        x[11],
        x[12],
        x[13],
        x[14],
    )
    ba0, ba1, ba2, bg0, bg1, bg2 = x[15], x[16], x[17], x[18], x[19], x[20]
    sa0, sa1, sa2, sg0, sg1, sg2 = x[21], x[22], x[23], x[24], x[25], x[26]
    n0, n1, n2 = acc[0], acc[1], acc[2]
    m00, m01, m02, m10, m11, m12, m20, m21, m22 = (
        acc[3],
        acc[4],
        acc[5],
        acc[6],
        acc[7],
        acc[8],
        acc[9],
        acc[10],
        acc[11],
    )
    q0, q1, q2, r0, r1, r2 = acc[12], acc[13], acc[14], acc[15], acc[16], acc[17]
    length, time = acc[18], acc[19]
    l0, l1, l2, l3, l4, l5 = acc[82], acc[83], acc[84], acc[85], acc[86], acc[87]
    v0, v1, v2, v3, v4, v5 = acc[88], acc[89], acc[90], acc[91], acc[92], acc[93]
    k = start
    if l0 == 0.0 and l1 == 0.0 and l2 == 0.0 and k < stop:  # nothing seen yet
        j = k - 1 if k > 0 else k
        l0, l1, l2, l3, l4, l5 = f[j, 0], f[j, 1], f[j, 2], w[j, 0], w[j, 1], w[j, 2]
    if length <= 0.0 and acc[81] <= 0.0:
        freeze(x, acc)
    L0, h0, s0, k0, t0, in0, ie0 = acc[21], acc[22], acc[23], acc[24], acc[25], acc[26], acc[27]
    g0, g_h, g_L, n_L, e_L = acc[28], acc[29], acc[30], acc[31], acc[32]
    while k < stop:
        end = t[k] if t[k] < until else until
        dt = end - time
        if dt > 0.0:
            f0, f1, f2, w0, w1, w2 = f[k, 0], f[k, 1], f[k, 2], w[k, 0], w[k, 1], w[k, 2]
            q0, q1, q2 = q0 + f0 * dt, q1 + f1 * dt, q2 + f2 * dt
            r0, r1, r2 = r0 + w0 * dt, r1 + w1 * dt, r2 + w2 * dt
            f0, f1, f2 = f0 - ba0 - sa0 * f0, f1 - ba1 - sa1 * f1, f2 - ba2 - sa2 * f2
            a, b, c = (
                (w0 - bg0 - sg0 * w0) * dt,
                (w1 - bg1 - sg1 * w1) * dt,
                (w2 - bg2 - sg2 * w2) * dt,
            )
            # the Earth here
            dL, dh = L - L0, h - h0
            s, o = s0 + k0 * dL, k0 - s0 * dL
            tan = t0 + (1.0 + t0 * t0) * dL
            inv_n, inv_e = in0 - in0 * in0 * (dh + n_L * dL), ie0 - ie0 * ie0 * (dh + e_L * dL)
            i0, i2 = OMEGA * o, -OMEGA * s
            e0, e1 = vE * inv_e, -vN * inv_n
            e2 = -e0 * tan
            # Exp of the body's turn: series, whose next term is below 1e-17 for less than 0.1 rad
            angle2 = a * a + b * b + c * c
            if angle2 < 1e-2:
                ks = 1.0 - angle2 * (
                    1.0 / 6.0 - angle2 * (1.0 / 120.0 - angle2 * (1.0 / 5040.0 - angle2 / 362880.0))
                )
                kc = 0.5 - angle2 * (
                    1.0 / 24.0
                    - angle2 * (1.0 / 720.0 - angle2 * (1.0 / 40320.0 - angle2 / 3628800.0))
                )
            else:
                angle = math.sqrt(angle2)
                ks, kc = math.sin(angle) / angle, (1.0 - math.cos(angle)) / angle2
            b00, b11, b22 = (
                1.0 - kc * (b * b + c * c),
                1.0 - kc * (a * a + c * c),
                1.0 - kc * (a * a + b * b),
            )
            ab, ac, bc = kc * a * b, kc * a * c, kc * b * c
            b01, b10, b02, b20, b12, b21 = (
                ab - ks * c,
                ab + ks * c,
                ac + ks * b,
                ac - ks * b,
                bc - ks * a,
                bc + ks * a,
            )
            d00, d01, d02 = (
                c00 * b00 + c01 * b10 + c02 * b20,
                c00 * b01 + c01 * b11 + c02 * b21,
                c00 * b02 + c01 * b12 + c02 * b22,
            )
            d10, d11, d12 = (
                c10 * b00 + c11 * b10 + c12 * b20,
                c10 * b01 + c11 * b11 + c12 * b21,
                c10 * b02 + c11 * b12 + c12 * b22,
            )
            d20, d21, d22 = (
                c20 * b00 + c21 * b10 + c22 * b20,
                c20 * b01 + c21 * b11 + c22 * b21,
                c20 * b02 + c21 * b12 + c22 * b22,
            )
            # n turns by 1e-6 rad a sample: Exp(-u) to second order
            u0, u1, u2 = (i0 + e0) * dt, e1 * dt, (i2 + e2) * dt
            uu = 0.5 * (u0 * u0 + u1 * u1 + u2 * u2)
            p = 0.5 * (u0 * d00 + u1 * d10 + u2 * d20)
            d00, d10, d20 = (
                d00 - u1 * d20 + u2 * d10 + u0 * p - uu * d00,
                d10 - u2 * d00 + u0 * d20 + u1 * p - uu * d10,
                d20 - u0 * d10 + u1 * d00 + u2 * p - uu * d20,
            )
            p = 0.5 * (u0 * d01 + u1 * d11 + u2 * d21)
            d01, d11, d21 = (
                d01 - u1 * d21 + u2 * d11 + u0 * p - uu * d01,
                d11 - u2 * d01 + u0 * d21 + u1 * p - uu * d11,
                d21 - u0 * d11 + u1 * d01 + u2 * p - uu * d21,
            )
            p = 0.5 * (u0 * d02 + u1 * d12 + u2 * d22)
            d02, d12, d22 = (
                d02 - u1 * d22 + u2 * d12 + u0 * p - uu * d02,
                d12 - u2 * d02 + u0 * d22 + u1 * p - uu * d12,
                d22 - u0 * d12 + u1 * d02 + u2 * p - uu * d22,
            )
            c00, c01, c02 = 0.5 * (c00 + d00), 0.5 * (c01 + d01), 0.5 * (c02 + d02)
            c10, c11, c12 = 0.5 * (c10 + d10), 0.5 * (c11 + d11), 0.5 * (c12 + d12)
            c20, c21, c22 = 0.5 * (c20 + d20), 0.5 * (c21 + d21), 0.5 * (c22 + d22)
            fN = c00 * f0 + c01 * f1 + c02 * f2
            fE = c10 * f0 + c11 * f1 + c12 * f2
            fD = c20 * f0 + c21 * f1 + c22 * f2
            n0, n1, n2 = n0 + fN * dt, n1 + fE * dt, n2 + fD * dt
            m00, m01, m02 = m00 + c00 * dt, m01 + c01 * dt, m02 + c02 * dt
            m10, m11, m12 = m10 + c10 * dt, m11 + c11 * dt, m12 + c12 * dt
            m20, m21, m22 = m20 + c20 * dt, m21 + c21 * dt, m22 + c22 * dt
            c00, c01, c02, c10, c11, c12, c20, c21, c22 = (
                d00,
                d01,
                d02,
                d10,
                d11,
                d12,
                d20,
                d21,
                d22,
            )
            x0, x1, x2 = 2.0 * i0 + e0, e1, 2.0 * i2 + e2
            wN = vN + dt * (fN - (x1 * vD - x2 * vE))
            wE = vE + dt * (fE - (x2 * vN - x0 * vD))
            wD = vD + dt * (fD - (x0 * vE - x1 * vN) + g0 + g_h * dh + g_L * dL)
            new_L = L + 0.5 * (vN + wN) * dt * inv_n
            half = 0.5 * (L + new_L) - L0
            l += 0.5 * (vE + wE) * dt * inv_e / (k0 - s0 * half)
            h -= 0.5 * (vD + wD) * dt
            L, vN, vE, vD = new_L, wN, wE, wD
            length += dt
            time = end
        if t[k] > until:
            break
        if k > 0:
            whole = t[k] - t[k - 1]
            part = min(1.0, whole / SHAKE_MEMORY)
            a, b, c = f[k, 0] - l0, f[k, 1] - l1, f[k, 2] - l2
            v0, v1, v2 = (
                v0 + part * (0.5 * whole * a * a - v0),
                v1 + part * (0.5 * whole * b * b - v1),
                v2 + part * (0.5 * whole * c * c - v2),
            )
            a, b, c = w[k, 0] - l3, w[k, 1] - l4, w[k, 2] - l5
            v3, v4, v5 = (
                v3 + part * (0.5 * whole * a * a - v3),
                v4 + part * (0.5 * whole * b * b - v4),
                v5 + part * (0.5 * whole * c * c - v5),
            )
        l0, l1, l2, l3, l4, l5 = f[k, 0], f[k, 1], f[k, 2], w[k, 0], w[k, 1], w[k, 2]
        k += 1
        if length >= TICK - 1e-6:
            break
    x[0], x[1], x[2], x[3], x[4], x[5] = L, l, h, vN, vE, vD
    x[6], x[7], x[8], x[9], x[10], x[11], x[12], x[13], x[14] = (
        c00,
        c01,
        c02,
        c10,
        c11,
        c12,
        c20,
        c21,
        c22,
    )
    acc[0], acc[1], acc[2] = n0, n1, n2
    acc[3], acc[4], acc[5], acc[6], acc[7], acc[8], acc[9], acc[10], acc[11] = (
        m00,
        m01,
        m02,
        m10,
        m11,
        m12,
        m20,
        m21,
        m22,
    )
    acc[12], acc[13], acc[14], acc[15], acc[16], acc[17] = q0, q1, q2, r0, r1, r2
    acc[18], acc[19] = length, time
    acc[82], acc[83], acc[84], acc[85], acc[86], acc[87] = l0, l1, l2, l3, l4, l5
    acc[88], acc[89], acc[90], acc[91], acc[92], acc[93] = v0, v1, v2, v3, v4, v5
    return k
