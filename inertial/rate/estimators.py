"""The one door to all gyro-free rate estimators: samples in, RateState out.

ESTIMATORS maps a name to a class that is made of a layout and has `feed`, `step` and `skip`.
Deterministic: the same samples give the same bits. Frames and units as everywhere: b body, n
north-east-down, SI, quaternions w x y z.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from inertial.layouts.layout import Layout
from inertial.rate import bound, least_squares, products_ekf, sight, tachometer
from inertial.rate import products_run as frame
from inertial.rate import products_track as track
from inertial.rate.observed import sensor
from inertial.rate.samples import Samples
from inertial.rate.track_state import KEEP_STILL, TOLD, WAITING, TrackState

Array = NDArray[np.float64]


@dataclass(slots=True)  # not frozen: that would cost as much as the filter
class RateState:
    """Rotation and motion by one estimator, at one sample. Arrays are parts of one row: read them,
    do not write.

    TrackState offers the same and stands for it wherever a RateState is wanted.
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
    still: bool  # the still detector's word
    p_n: Array  # m, (3,), inertial navigation from the end of the first standstill, no aiding
    v_n: Array  # m/s, (3,)
    # equivalent biases: omega' rad/s^2 (3), p m/s^2 (3), and products (6) where estimated
    bias: Array
    phase: str = ""  # for people: "finding biases: keep still", ...
    innovation_unit: str = ""
    sight: tuple[int, int, int] = (
        0,
        0,
        0,
    )  # of sight.VALID, AMBIGUOUS, BLIND, by component of omega
    sight_reason: str = ""  # why a component is not valid
    bound_sigma: Array | None = None  # rad/s, (3,), posterior Cramer-Rao bound along the estimate
    excluded: int = 0  # bit k: axis k was not used
    calibration: str = ""  # id of the calibration card that the readings were corrected by
    aid: str = ""  # "tachometer" once omega was corrected by it; not to be scored against it


class RateEstimator(Protocol):
    """What a rate estimator offers."""

    name: str

    def feed(self, t_s: Array, f_axis: Array, wanted: Sequence[int]) -> list[RateState]:
        """Take samples read at t_s (n,), s, of the board's clock: readings (n, N), m/s^2; states
        after `wanted` rows.

        The same bits as step() one by one. Raises ValueError as step() does, and then takes none of
        them.
        """
        ...

    def step(self, index: int, t_s: float, f_axis: Array) -> RateState:
        """Take sample `index`, read at t_s (s, the board's clock): axis readings (N,), m/s^2.

        Raises ValueError for readings of a wrong number or that are not finite.
        """
        ...

    def skip(self, n: int) -> None:
        """n samples are missing before the next one."""
        ...

    def tacho(self, t_s: float, rate: float, sigma: float, signed: bool = True) -> None:
        """A tachometer's rate (rad/s, with its sigma) up to its newest pulse at t_s (s, the clock
        of the samples).

        Without `signed`, rate is a size. Estimators that take no aid ignore it. Raises ValueError
        for no number.
        """
        ...

    def exclude(self, mask: int) -> None:
        """Go on without the axes whose bits are set; 0 takes all back. The axes in use are solved
        anew.

        Raises GeometryError, and changes nothing, when the rest cannot see omega' and p.
        """
        ...


EMPTY = np.zeros(0)
EMPTY.setflags(write=False)
LOST = "; the filter lost its covariance and began anew: this motion or layout is not for it"


class _Stepping:
    """One sample as a batch of one: the same compiled loop, so the same bits."""

    def feed(self, t_s: Array, f_axis: Array, wanted: Sequence[int]) -> list[RateState]:
        """See RateEstimator.feed."""
        raise NotImplementedError

    def step(self, index: int, t_s: float, f_axis: Array) -> RateState:
        """See RateEstimator.step."""
        return self.feed(np.array([t_s]), np.asarray(f_axis)[None], (0,))[0]


class LeastSquaresRate(_Stepping):
    """Estimator "least-squares": the paper's equations and Runge-Kutta (least_squares.py)."""

    name = "least-squares"

    def __init__(
        self,
        layout: Layout,
        config: least_squares.Config = least_squares.Config(),
        calibration: str = "",
    ) -> None:
        """Raises GeometryError when the layout cannot see angular acceleration and specific
        force.
        """
        self.calibration = calibration
        self._core = least_squares.LeastSquares(layout, config)
        self._taken = Samples()

    def feed(self, t_s: Array, f_axis: Array, wanted: Sequence[int]) -> list[RateState]:
        """See RateEstimator.feed."""
        rows = self._core.rows(*self._taken.take(self._core.layout, t_s, f_axis))
        return [self._state(rows[k]) for k in wanted]

    def _state(self, row: Array) -> RateState:
        samples, still, moving_s = row[least_squares.ROW_SAMPLES :].tolist()
        y, x = row[: least_squares.ROW_P], row[least_squares.ROW_X : least_squares.ROW_BIAS]
        P, waiting = row[least_squares.ROW_P : least_squares.ROW_X].reshape(3, 3), samples == 0.0
        spread = math.sqrt(max(row[least_squares.ROW_P : least_squares.ROW_X : 4].tolist()))
        blind = moving_s > 0.0 and spread > sight.BLIND_SIGMA
        reason = f"integration only, now {spread * sight.DEG:.0f} deg/s uncertain" if blind else ""
        return RateState(
            omega_b=y[least_squares.OMEGA],
            P=P,
            alpha_b=x[:3],
            f_b=x[3:],
            q_nb=y[least_squares.Q_NB],
            angle_z=float(y[least_squares.ANGLE]),
            innovation=EMPTY,
            innovation_sigma=EMPTY,
            nis=0.0,
            nis_dof=0,
            still=still > 0.0,
            p_n=y[least_squares.P_N],
            v_n=y[least_squares.V_N],
            bias=row[least_squares.ROW_BIAS : least_squares.ROW_SAMPLES],
            phase=KEEP_STILL
            if waiting
            else "still at the start"
            if moving_s == 0.0
            else "integrating",
            sight=sight.ALL_BLIND if blind or waiting else sight.ALL_VALID,
            sight_reason=WAITING if waiting else reason,
            excluded=self._core.excluded,
            calibration=self.calibration,
        )

    def skip(self, n: int) -> None:
        """See RateEstimator.skip; the next step integrates over the gap with omega' linear across
        it.
        """
        self._core.gap()

    def tacho(self, t_s: float, rate: float, sigma: float, signed: bool = True) -> None:
        """See RateEstimator.tacho: no aid."""

    def exclude(self, mask: int) -> None:
        """See RateEstimator.exclude."""
        self._core.exclude(mask)


class ProductsRate(_Stepping):
    """Estimator "products-ekf": Kalman filter on the six products (products_ekf.py)."""

    name = "products-ekf"
    method = "ekf"
    with_bound = True  # follow the Cramer-Rao bound along the estimate, live
    default = products_ekf.Config()

    def __init__(
        self, layout: Layout, config: products_ekf.Config | None = None, calibration: str = ""
    ) -> None:
        """Raises GeometryError when the layout does not see angular acceleration and specific
        force.
        """
        config = config or self.default
        if sensor(layout, config.still.sigma_axis)["feedback"]:
            # the feedback S Q z acts across the axis: held to an axis, P grows by what is not
            # integrated
            config = replace(config, fixed_axis=False)
        self.core = products_ekf.ProductsFilter(layout, config, self.method)
        self.calibration = calibration
        self._taken = Samples()
        self._bound = bound.Along(layout) if self.with_bound else None
        self._unseen = (
            config.unseen_rate**2 * np.eye(3)
        ).ravel()  # of a standing body, which may have begun to turn
        self._m = int(self.core.sensor["m"])
        self._reports, self._axis_b, self._aid = tachometer.Reports(), np.array([0.0, 0.0, 1.0]), ""

    def feed(self, t_s: Array, f_axis: Array, wanted: Sequence[int]) -> list[TrackState]:
        """See RateEstimator.feed."""
        t_s, f_axis = self._taken.take(self.core.layout, t_s, f_axis)
        parts, aids, row = [], [], 0
        while row < len(t_s):
            if self._reports:
                self._take_reports()
            end = (
                row + 1 if self._reports else len(t_s)
            )  # while a report waits, its time may come with any sample
            parts.append(self.core.rows(t_s[row:end], f_axis[row:end], self._bound))
            aids += [self._aid] * (end - row)
            row = end
        return self._states(parts[0] if len(parts) == 1 else np.concatenate(parts), aids, wanted)

    def _states(self, rows: Array, aids: list[str], wanted: Sequence[int]) -> list[TrackState]:
        said, mask = rows.take(TOLD, axis=1).tolist(), self.core.excluded
        for k, (_, still, started, *_) in enumerate(said):
            if still and started:
                rows[k, track.P : track.P + 9] += self._unseen
        states = [
            TrackState(rows, k, said[k], self._m, aids[k], mask, self.calibration) for k in wanted
        ]
        for state in states if self.core.lost else ():
            if not state.started:
                state.sight_reason += LOST
        return states

    def skip(self, n: int) -> None:
        """See RateEstimator.skip; the next step predicts across the gap."""
        self.core.gap()

    def exclude(self, mask: int) -> None:
        """See RateEstimator.exclude."""
        self.core.exclude(mask)
        self._m = int(self.core.sensor["m"])

    def tacho_axis(self, axis_b: Sequence[float]) -> None:
        """Axis in b that tachometer rates are about, any length. Raises ValueError for no
        direction.
        """
        axis = np.array(axis_b, dtype=np.float64)
        if axis.shape != (3,) or not np.linalg.norm(axis) > 0.0:
            raise ValueError(
                f"axis of the tachometer {axis_b}: want three numbers that are not all zero"
            )
        self._axis_b = axis / np.linalg.norm(axis)

    def tacho(self, t_s: float, rate: float, sigma: float, signed: bool = True) -> None:
        """See RateEstimator.tacho; it is used before the first sample after one of its time."""
        self._reports.add(t_s, rate, sigma, signed)

    def _take_reports(self) -> None:
        core = self.core
        for report in self._reports.due(float(core.memory["clock"][frame.LAST_S])):
            if tachometer.correct(core.memory, core.watch, core.sensor, self._axis_b, report):
                self._aid = tachometer.NAME

    def run_batch(self, t_s: Array, f_axis: Array) -> track.Track:
        """All samples at once: times (n,) s, growing, readings (n, N) m/s^2; the same bits as
        step() gives one by one.

        Raises ValueError for readings that are not finite or times that do not grow.
        """
        return self.core.run(t_s, f_axis)

    @property
    def refused(self) -> dict[str, int]:
        """Corrections not used because their NIS was beyond its gate: by the products, by gravity
        ("force").
        """
        return self.core.refused


class UnscentedRate(ProductsRate):
    """Estimator "products-ukf": the same model through sigma points (unscented.py)."""

    name = "products-ukf"
    method = "ukf"
    with_bound = False
    default = products_ekf.Config(fixed_axis=False)  # its points do not follow a turning axis


class RecursiveLeastSquaresRate(ProductsRate):
    """Estimator "products-rls": the same linearised regression without a noise model, with
    exponential forgetting.
    """

    name = "products-rls"
    method = "forget"
    with_bound = False


class MovingHorizonRate(ProductsRate):
    """Estimator "products-mhe": window of 24 samples, Gauss and Newton over it, its arrival cost
    from the filter.
    """

    name = "products-mhe"
    method = "horizon"
    with_bound = False


class FreeBodyRate(ProductsRate):
    """Estimator "products-free": for a body in a vehicle, which turns about any axis and whose
    centre accelerates.
    """

    name = "products-free"
    with_bound = False
    default = products_ekf.Config(fixed_axis=False, gravity_aid=False)


ESTIMATORS: dict[str, Any] = {
    estimator.name: estimator
    for estimator in (
        LeastSquaresRate,
        ProductsRate,
        UnscentedRate,
        RecursiveLeastSquaresRate,
        MovingHorizonRate,
    )
}
"""For a body on its table; compared with each other everywhere."""

VARIANTS: dict[str, Any] = {**ESTIMATORS, FreeBodyRate.name: FreeBodyRate}
"""Everything that [estimator] rate may name."""
