"""The window of core/navigation/alignment.cpp in readable numpy (E-80)."""

import numpy as np

from inertial.elementary import applied, product
from inertial.rotation import turn_matrix


def carried(t, f_b, omega_b, times, bias_accel, bias_gyro):
    """C_0k (m, 3, 3) and u (m, 3) in the body at times[0], at each of times[1:]; sample i acts from
    t[i - 1] to t[i].
    """
    C, u, now = np.eye(3), np.zeros(3), times[0]
    out, waiting = [], list(times[1:])
    for until, f, omega in zip(t, f_b, omega_b, strict=True):
        while waiting and now < until:
            dt = min(until, waiting[0]) - now
            after = product(C, turn_matrix((omega - bias_gyro) * dt))
            u = u + applied(0.5 * (C + after), f - bias_accel) * dt
            C, now = after, now + dt
            if now < waiting[0] - 1e-9:
                break
            now = waiting.pop(0)
            out.append((C, u))
    out += [(C, u)] * len(waiting)
    return np.array([c for c, _ in out]), np.array([u for _, u in out])
