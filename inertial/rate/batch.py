"""What a rate estimator says: columns over the samples of a batch, and one sample of them.

Frames and units as everywhere: b body, n north-east-down, SI, quaternions w x y z.
"""

import math
from dataclasses import dataclass, fields, replace
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from inertial.rate import sight
from inertial.rate.rows import Rows

Array = NDArray[np.float64]

KEEP_STILL, WAITING = "finding biases: keep still", "no standstill yet: keep still"
LOST = "; the filter lost its covariance and began anew: this motion or layout is not for it"
TACHOMETER = "tachometer"


class Phase(IntEnum):
    """What an estimator is doing."""

    WAITING = 0
    TWO_SIGNS = 1
    STILL = 2
    TURNING = 3
    STILL_AT_START = 4
    INTEGRATING = 5

    @property
    def text(self) -> str:
        """For people."""
        return _TEXTS[self]


_TEXTS = {
    Phase.WAITING: KEEP_STILL,
    Phase.TWO_SIGNS: "turning, sign of the rate unknown",
    Phase.STILL: "still",
    Phase.TURNING: "turning",
    Phase.STILL_AT_START: "still at the start",
    Phase.INTEGRATING: "integrating",
}


@dataclass(slots=True)
class RateState:
    """Rotation and motion by one estimator, at one sample. Arrays are parts of the batch's columns:
    read them, do not write.
    """

    omega_b: Array  # rad/s, (3,), of b against inertial
    P: Array  # (rad/s)^2, (3, 3), covariance of omega_b
    alpha_b: Array  # rad/s^2, (3,)
    f_b: Array  # m/s^2, (3,), specific force of the centre, bias removed
    q_nb: Array  # (4,)
    angle_z: float  # rad, integral of omega_z since the start
    innovation: Array  # of this sample's correction; empty when there was none
    innovation_sigma: Array
    nis: float  # normalised innovation squared
    nis_dof: int  # its degrees of freedom; 0 without correction
    still: bool  # the zero-velocity detector's word
    p_n: Array  # m, (3,), inertial navigation from the end of the first standstill, no aiding
    v_n: Array  # m/s, (3,)
    # equivalent biases: omega' rad/s^2 (3), p m/s^2 (3), and products (6) where estimated
    bias: Array
    phase: str = ""  # for people: "finding biases: keep still", ...
    innovation_unit: str = ""
    # of sight.VALID, AMBIGUOUS, BLIND, by component of omega
    sight: tuple[int, int, int] = (0, 0, 0)
    sight_reason: str = ""  # why a component is not valid
    bound_sigma: Array | None = None  # rad/s, (3,), posterior Cramer-Rao bound along the estimate
    excluded: int = 0  # bit k: axis k was not used
    calibration: str = ""  # id of the calibration file that the readings were corrected by
    aid: str = ""  # "tachometer" once omega was corrected by it; not to be scored against it


@dataclass(slots=True)
class RateColumns:
    """RateState after each of n samples, field by field; m products are seen by the layout."""

    omega_b: Array  # rad/s, (n, 3), of b against inertial
    P: Array  # (rad/s)^2, (n, 3, 3), covariance of omega_b
    alpha_b: Array  # rad/s^2, (n, 3)
    f_b: Array  # m/s^2, (n, 3), specific force of the centre, bias removed
    q_nb: Array  # (n, 4)
    angle_z: Array  # rad, (n,), integral of omega_z since the start
    innovation: Array  # (n, m); of meaning where nis_dof > 0
    innovation_sigma: Array  # (n, m)
    nis: Array  # (n,), normalised innovation squared; 0 without correction
    nis_dof: NDArray[np.uint8]  # (n,), its degrees of freedom; 0 without correction
    still: NDArray[np.bool_]  # (n,), the zero-velocity detector's word
    p_n: Array  # m, (n, 3), inertial navigation from the end of the first standstill, no aiding
    v_n: Array  # m/s, (n, 3)
    # equivalent biases: omega' rad/s^2 (3), p m/s^2 (3), and products (rad/s)^2 (6) where estimated
    bias: Array  # (n, 12) or (n, 6)
    phase: NDArray[np.uint8]  # (n,), of Phase
    sight: NDArray[np.uint8]  # (n, 3), of sight.VALID, AMBIGUOUS, BLIND, by component of omega
    doubt: NDArray[np.uint8]  # (n,), into sight.DOUBTS: why nothing is valid
    sign_variance: Array  # (rad/s)^2, (n,), of omega along itself for the question of its sign
    bound_sigma: Array  # rad/s, (n, 3), posterior Cramer-Rao bound; 0 where it is not known
    aided: NDArray[np.bool_]  # (n,), omega was corrected by the tachometer, now or before
    innovation_unit: str = ""
    excluded: int = 0  # bit k: axis k was not used
    calibration: str = ""  # id of the calibration file that the readings were corrected by
    began_anew: bool = (
        False  # the filter had lost its covariance, or its rate was beyond all bounds
    )

    def __len__(self) -> int:
        return len(self.nis)

    def part(self, rows: slice) -> "RateColumns":
        """Some of the samples; views, not copies."""
        parts = {
            f.name: value[rows]
            for f in fields(self)
            if isinstance(value := getattr(self, f.name), np.ndarray)
        }
        return replace(self, **parts)

    @property
    def started(self) -> NDArray[np.bool_]:
        """Whether the rate is known at all, (n,)."""
        return self.phase != Phase.WAITING

    @property
    def two_signs(self) -> NDArray[np.bool_]:
        """Whether two signs of omega are followed, (n,)."""
        return self.phase == Phase.TWO_SIGNS

    def phase_text(self, k: int) -> str:
        """What the estimator was doing at sample k, for people."""
        text = Phase(self.phase[k]).text
        return f"{text}, aided by the tachometer" if self.aided[k] else text

    def sight_reason(self, k: int) -> str:
        """Why components of omega were not valid at sample k, for people; empty when all were."""
        phase, doubt = self.phase[k], sight.DOUBTS[self.doubt[k]]
        if doubt:
            return doubt
        if phase == Phase.WAITING:
            return WAITING + (LOST if self.began_anew else "")
        if not self.sight[k].any():
            return ""
        variances = self.P[k].diagonal()
        if phase == Phase.INTEGRATING:
            spread = math.sqrt(variances.max()) * sight.DEG
            return f"integration only, now {spread:.0f} °/s uncertain"
        size = math.hypot(*self.omega_b[k], math.sqrt(variances.sum()))
        sights = tuple(self.sight[k].tolist())
        return sight.reason(
            sights, variances, self.sign_variance[k], phase == Phase.TWO_SIGNS, size
        )

    def state(self, k: int) -> RateState:
        """Sample k."""
        m = int(self.nis_dof[k])
        return RateState(
            omega_b=self.omega_b[k],
            P=self.P[k],
            alpha_b=self.alpha_b[k],
            f_b=self.f_b[k],
            q_nb=self.q_nb[k],
            angle_z=float(self.angle_z[k]),
            innovation=self.innovation[k, :m],
            innovation_sigma=self.innovation_sigma[k, :m],
            nis=float(self.nis[k]) if m else 0.0,
            nis_dof=m,
            still=bool(self.still[k]),
            p_n=self.p_n[k],
            v_n=self.v_n[k],
            bias=self.bias[k],
            phase=self.phase_text(k),
            innovation_unit=self.innovation_unit,
            sight=tuple(self.sight[k].tolist()),
            sight_reason=self.sight_reason(k),
            bound_sigma=self.bound_sigma[k] if self.bound_sigma[k, 0] > 0.0 else None,
            excluded=self.excluded,
            calibration=self.calibration,
            aid=TACHOMETER if self.aided[k] else "",
        )


def columns(
    rows: Rows,
    *,
    products: int,
    biases: int,
    aided: NDArray[np.bool_] | None = None,
    innovation_unit: str = "",
    excluded: int = 0,
    calibration: str = "",
    began_anew: bool = False,
) -> RateColumns:
    """Columns of what the core said row by row; so many products are seen, biases are known."""
    named = {name: rows[name] for name in rows.dtype.names}
    named["innovation"] = named["innovation"][:, :products]
    named["innovation_sigma"] = named["innovation_sigma"][:, :products]
    named["bias"] = named["bias"][:, :biases]
    return RateColumns(
        **named,
        aided=np.zeros(len(rows), np.bool_) if aided is None else aided,
        innovation_unit=innovation_unit,
        excluded=excluded,
        calibration=calibration,
        began_anew=began_anew,
    )
