"""A start while turning, after the fact: once the sign of omega is decided, what came before is
corrected (E-57).

Not for live estimates, which say only what was known then. omega at an earlier sample is omega at a
later one less what omega' gave between them; the later one is chosen, within two seconds of turning
after the decision, so that the first sample is known best.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from inertial.rate.batch import Phase
from inertial.rate.products_model import TURNED, squares
from inertial.rotation import from_rotation_vector, level, multiply, to_matrix

if TYPE_CHECKING:
    from inertial.rate.products_ekf import ProductsFilter

Array = NDArray[np.float64]

SUFFIX = "+resolved"  # of the names of estimates that were corrected
AFTER = 200  # samples after the decision from which one is chosen
PART = 8  # samples between those that are looked at


@dataclass(frozen=True)
class Resolved:
    """What is known afterwards of the first n samples, and what that changes later."""

    omega_b: Array  # (n, 3) rad/s
    P: Array  # (n, 3, 3) (rad/s)^2
    angle_z: Array  # (n,) rad, from the first sample
    q_nb: Array  # (n, 4), levelled at the first sample
    later_angle: float  # rad, to add to angles after them
    later_turn: Array  # (4,) to multiply attitudes after them by, from the left

    def into(self, omega_b: Array, P: Array, angle_z: Array, q_nb: Array) -> None:
        """Correct what was said live, arrays over all samples, in place."""
        n = len(self.omega_b)
        omega_b[:n], P[:n], angle_z[:n], q_nb[:n] = self.omega_b, self.P, self.angle_z, self.q_nb
        angle_z[n:] += self.later_angle
        for k in range(n, len(q_nb)):
            q_nb[k] = multiply(self.later_turn, q_nb[k])


def resolve(core: "ProductsFilter", t_s: Array, f_axis: Array) -> Resolved | None:
    """Run a fresh filter over a log without gaps: times (n,), s, readings (n, N), m/s^2.

    None when it does not begin while turning, or its sign is never decided.
    """
    t_s, f_axis = (
        np.ascontiguousarray(t_s),
        np.ascontiguousarray(f_axis),
    )  # a log's columns lie apart
    n, best, decided, phases = len(t_s), None, -1, np.zeros(0, np.uint8)
    for first in range(0, n, PART):
        part = core.rows(t_s[first : first + PART], f_axis[first : first + PART])
        phases = np.concatenate([phases, part["phase"]])
        last, now, two = part["phase"][-1], len(phases) - 1, phases == Phase.TWO_SIGNS
        if last != Phase.WAITING and not two.any():
            return None
        if not two.any() or last == Phase.TWO_SIGNS:
            continue
        if part["still"][-1]:
            break
        decided = decided if decided >= 0 else now
        x, P, q_nb = core.native.x, core.native.P[:6, :6], core.native.q_nb
        spread = float(np.trace(_then(P, t_s[now] - t_s[0], 0.0, core)))
        if best is None or spread < best[0]:
            best = spread, now, x, P, q_nb
        if now >= decided + AFTER:
            break
    return (
        None if best is None else _back(core, t_s[: best[1] + 1], f_axis[: best[1] + 1], *best[2:])
    )


def _then(P: Array, seconds: float, dt: float, core: "ProductsFilter") -> Array:
    """Covariance of omega so many seconds earlier, from P (6, 6) of [omega, b_alpha]."""
    J = np.hstack([np.eye(3), seconds * np.eye(3)])
    return J @ P @ J.T + seconds * dt * core.sensor.R_alpha


def _back(
    core: "ProductsFilter", t_s: Array, f_axis: Array, x: Array, P: Array, q_nb: Array
) -> Resolved:
    """From the state at the last of these samples to the first."""
    s, n = core.sensor, len(t_s)
    alpha = f_axis @ s.W[:3].T
    omega, spread, angle, q = np.empty((n, 3)), np.empty((n, 3, 3)), np.empty(n), np.empty((n, 4))
    omega[-1], angle[-1], q[-1] = x[:3], x[TURNED], q_nb
    for k in range(n - 1, -1, -1):
        if k < n - 1:
            dt = t_s[k + 1] - t_s[k]
            gained = 0.5 * (alpha[k] + alpha[k + 1]) - x[3:6] - s.SQ_alpha @ squares(omega[k + 1])
            omega[k] = omega[k + 1] - dt * gained
            middle = 0.5 * (omega[k] + omega[k + 1])
            angle[k], q[k] = (
                angle[k + 1] - dt * middle[2],
                multiply(q[k + 1], from_rotation_vector(-dt * middle)),
            )
        spread[k] = _then(P, t_s[-1] - t_s[k], (t_s[-1] - t_s[0]) / max(n - 1, 1), core)
    up_b = to_matrix(q[0]).T @ np.array([0.0, 0.0, -1.0])
    turn = multiply(level(up_b), q[0] * np.array([1.0, -1.0, -1.0, -1.0]))
    q = np.array([multiply(turn, one) for one in q])
    return Resolved(omega, spread, angle - angle[0], q, -float(angle[0]), turn)
