"""Unaided navigation beside its closed form: how far a cube drifts by itself, and how far equation
(27) says.
"""

from dataclasses import dataclass

import numpy as np

from dashboard.scene.drawing.drawn import Curve
from dashboard.scene.drawing.page import joined, tag
from dashboard.scene.drawing.palette import GREY, VERMILLION, number
from dashboard.scene.panels.base import DEG, Snapshot
from inertial.constants import MILLI_G
from inertial.navigation.unaided import equivalent_drift, position_error
from messages.contract import gyrofree_pb2 as pb

HOUR = 3600.0
POINTS = 60


@dataclass(frozen=True)
class Unaided:
    """A rate estimator's own navigation since its first standstill ended, against navigation with
    fixes.
    """

    t: np.ndarray  # (n,) s on the device's axis
    since: float  # s, when it began
    error: np.ndarray  # (n,) m, horizontal
    predicted: (
        np.ndarray
    )  # (n,) m, by equation (27) with the biases that the filter with fixes finds now
    bias: float  # m/s^2, horizontal
    drift: float  # rad/s, horizontal

    @property
    def equivalent(self) -> float:
        """rad/s: the constant drift that would explain the newest error."""
        return equivalent_drift(float(self.error[-1]), self.bias, float(self.t[-1] - self.since))


def unaided(s: Snapshot, rate: str, nav: str) -> Unaided | None:
    """None while it has not begun, or began before the window of the charts."""
    t, r = s.rows("rate", rate)
    tn, n = s.rows("nav", nav)
    message = s.device.get("nav", nav).message
    if len(t) < 2 or len(tn) < 2 or len(message.bias_f_b_mps2) != 3 or len(message.q_nb) != 4:
        return None
    p = r["p_n"]
    still = np.flatnonzero(~(np.abs(p).max(axis=1) > 0.0))
    if not len(still) or still[-1] > len(t) - 3:
        return None
    start = int(still[-1]) + 1
    begin = max(float(t[start]), float(tn[0]))
    inside = (t >= begin) & (t <= tn[-1])
    if inside.sum() < 2:
        return None
    # its heading is its own: turned by the difference when navigation with fixes began
    k = int(np.searchsorted(t, tn[0])) if tn[0] > t[start] else start
    turn = float(
        n["yaw"][0 if tn[0] > t[start] else np.searchsorted(tn, t[start])]
        - r["yaw"][min(k, len(t) - 1)]
    )
    c, sn = np.cos(turn), np.sin(turn)
    own = (p[inside][:, :2] - p[start - 1, :2]) @ np.array([[c, sn], [-sn, c]])
    true = np.column_stack([np.interp(t[inside], tn, n["p_n"][:, i]) for i in range(2)])
    error = np.linalg.norm(own - own[0] - (true - true[0]), axis=1)
    b, d = (
        float(np.hypot(*_in_n(message.q_nb, v)[:2]))
        for v in (message.bias_f_b_mps2, message.bias_omega_b_radps)
    )
    predicted = closed_form(b, d, t[inside] - t[start])
    return Unaided(t[inside], float(t[start]), error, predicted, b, d)


def closed_form(bias: float, drift: float, t_s: np.ndarray) -> np.ndarray:
    """Horizontal error (n,) m of equation (27) for a bias and a drift that push the same way;
    lengths, SI.
    """
    found = position_error(
        np.array([bias, 0.0, 0.0]), np.array([0.0, -drift, 0.0]), np.maximum(t_s, 0.0)
    )
    return np.abs(found[:, 0])


def curves_of(u: Unaided) -> list[Curve]:
    """Measured and predicted."""
    return [
        Curve("measured", VERMILLION, u.t, u.error),
        Curve("equation (27)", GREY, u.t, u.predicted, dash=True),
    ]


def table_of(u: Unaided) -> list[tuple[object, str]]:
    """The same in numbers."""
    seconds = number(float(u.t[-1] - u.since), 0, "s")
    return [
        (
            joined([tag("b", "without fixes"), f", off after {seconds}"]),
            number(float(u.error[-1]), 1, "m"),
        ),
        ("by equation (27)", number(float(u.predicted[-1]), 1, "m")),
        (
            "\u00a0 of bias · drift",
            f"{number(u.bias / MILLI_G, 1, 'mg')} · {number(u.drift * DEG, 2, '°/s')}",
        ),
        ("drift that explains it", number(u.equivalent * DEG * HOUR, 0, "°/h")),
    ]


def outage(m: pb.NavSolution, now: float) -> tuple[np.ndarray, np.ndarray] | None:
    """Times (n,) s and error (n,) m by equation (27) since the last fix, of the sigmas stated of
    the biases.
    """
    if len(m.sigma) < 15 or m.fix_age_s <= 0.0:
        return None
    age = np.linspace(0.0, m.fix_age_s, POINTS)
    bias, drift = float(np.max(m.sigma[9:12])), float(np.max(m.sigma[12:15]))
    return now - m.fix_age_s + age, closed_form(bias, drift, age)


def _in_n(q_nb: list[float], v_b: list[float]) -> np.ndarray:
    w, x = q_nb[0], np.array(q_nb[1:])
    v = np.array(v_b)
    return v + 2.0 * np.cross(x, np.cross(x, v) + w * v)
