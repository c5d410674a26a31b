"""The one door to all gyro-free rate estimators: samples in, RateState out.

ESTIMATORS maps a name to a class that is made of a layout and has `step` and `skip`. Deterministic: the same
samples give the same bits. Frames and units as everywhere: b body, n north-east-down, SI, quaternions w x y z.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from estimator.layouts.layout import Layout
from estimator.rate import bound, least_squares, products_ekf, products_kernel, sight, tachometer
from estimator.rate import products_run as frame
from estimator.rate.direct import Direct
from estimator.rate.field import checked
from estimator.rate.observed import sensor

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class RateState:
    """Rotation and motion by one estimator, at one sample."""

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
    bias: Array  # equivalent biases: omega' rad/s^2 (3), p m/s^2 (3), and products (6) where estimated
    phase: str = ""  # for people: "finding biases: keep still", ...
    innovation_unit: str = ""
    sight: tuple[int, int, int] = (0, 0, 0)  # of sight.VALID, AMBIGUOUS, BLIND, by component of omega
    sight_reason: str = ""  # why a component is not valid
    bound_sigma: Array | None = None  # rad/s, (3,), posterior Cramer-Rao bound along the estimate
    excluded: int = 0  # bit k: axis k was not used
    calibration: str = ""  # id of the calibration card that the readings were corrected by
    aid: str = ""  # "tachometer" once omega was corrected by it; not to be scored against it


class RateEstimator(Protocol):
    """What a rate estimator offers."""

    name: str

    def step(self, index: int, t_s: float, f_axis: Array) -> RateState:
        """Take sample `index`, read at t_s (s, the board's clock): axis readings (N,), m/s^2.

        Raises ValueError for readings of a wrong number or that are not finite.
        """
        ...

    def skip(self, n: int) -> None:
        """n samples are missing before the next one."""
        ...

    def tacho(self, t_s: float, rate: float, sigma: float, signed: bool = True) -> None:
        """A tachometer's rate (rad/s, with its sigma) up to its newest pulse at t_s (s, the clock of the samples).

        Without `signed`, rate is a size. Estimators that take no aid ignore it. Raises ValueError for no number.
        """
        ...

    def exclude(self, mask: int) -> None:
        """Go on without the axes whose bits are set; 0 takes all back. The axes in use are solved anew.

        Raises GeometryError, and changes nothing, when the rest cannot see omega' and p.
        """
        ...


_run = Direct(products_ekf.run)

EMPTY = np.zeros(0)
EMPTY.setflags(write=False)


class _Clock:
    """Time between samples; knows the period to bridge gaps."""

    def __init__(self) -> None:
        self.last_s: float | None = None
        self.skipped = 0

    def advance(self, t_s: float) -> float | None:
        """dt to t_s; None at the first sample. Time that stands or goes back raises ValueError."""
        last, self.last_s = self.last_s, t_s
        if last is None:
            return None
        if not t_s > last:
            self.last_s = last
            raise ValueError(f"sample at {t_s:.6f} s after one at {last:.6f} s: time must grow; start a new estimator")
        return t_s - last


class LeastSquaresRate:
    """Estimator "least-squares": the paper's equations and Runge-Kutta (least_squares.py)."""

    name = "least-squares"

    def __init__(
        self, layout: Layout, config: least_squares.Config = least_squares.Config(), calibration: str = ""
    ) -> None:
        """Raises GeometryError when the layout cannot see angular acceleration and specific force."""
        self.calibration = calibration
        self._core = least_squares.LeastSquares(layout, config)
        self._clock = _Clock()

    def step(self, index: int, t_s: float, f_axis: Array) -> RateState:
        """See RateEstimator.step."""
        core = self._core
        f_axis = checked(core.layout, f_axis)
        self._clock.advance(t_s)
        core.step(t_s, f_axis)
        m = core.memory
        y, x, P = m["y"], m["x"], m["P"].copy()
        waiting, spread = m["marks"][least_squares.SAMPLES] == 0, float(np.sqrt(P.diagonal().max()))
        blind = spread > sight.BLIND_SIGMA and m["clock"][least_squares.MOVING_S] > 0.0
        reason = f"integration only, now {spread * sight.DEG:.0f} deg/s uncertain" if blind else ""
        return RateState(
            omega_b=y[least_squares.OMEGA].copy(),
            P=P,
            alpha_b=x[:3].copy(),
            f_b=x[3:].copy(),
            q_nb=y[least_squares.Q_NB].copy(),
            angle_z=float(y[least_squares.ANGLE]),
            innovation=EMPTY,
            innovation_sigma=EMPTY,
            nis=0.0,
            nis_dof=0,
            still=bool(m["marks"][least_squares.STILL]),
            p_n=y[least_squares.P_N].copy(),
            v_n=y[least_squares.V_N].copy(),
            bias=m["bias"].copy(),
            phase=core.phase,
            sight=(sight.BLIND,) * 3 if blind or waiting else (sight.VALID,) * 3,
            sight_reason="no standstill yet: keep still" if waiting else reason,
            excluded=core.excluded,
            calibration=self.calibration,
        )

    def skip(self, n: int) -> None:
        """See RateEstimator.skip; the next step integrates over the gap with omega' linear across it."""
        self._core.gap()

    def tacho(self, t_s: float, rate: float, sigma: float, signed: bool = True) -> None:
        """See RateEstimator.tacho: no aid."""

    def exclude(self, mask: int) -> None:
        """See RateEstimator.exclude."""
        self._core.exclude(mask)


class ProductsRate:
    """Estimator "products-ekf": Kalman filter on the six products (products_ekf.py)."""

    name = "products-ekf"
    method = "ekf"
    with_bound = True  # follow the Cramer-Rao bound along the estimate, by step()
    default = products_ekf.Config()

    def __init__(self, layout: Layout, config: products_ekf.Config | None = None, calibration: str = "") -> None:
        """Raises GeometryError when the layout does not see angular acceleration and specific force."""
        config = config or self.default
        if sensor(layout, config.still.sigma_axis)["feedback"]:
            # the feedback S Q z acts across the axis: held to an axis, P grows by what is not integrated
            config = replace(config, fixed_axis=False)
        self.core = products_ekf.ProductsFilter(layout, config, self.method)
        self.calibration = calibration
        self._clock = _Clock()
        self._bound = bound.Along(layout) if self.with_bound else None
        self._unseen = config.unseen_rate**2 * np.eye(3)
        self._reports, self._axis_b, self._aid = tachometer.Reports(), np.array([0.0, 0.0, 1.0]), ""

    def step(self, index: int, t_s: float, f_axis: Array) -> RateState:
        """See RateEstimator.step."""
        core = self.core
        f_axis = checked(core.layout, f_axis)
        self._clock.advance(t_s)
        if self._reports:
            self._take_reports()
        core._time[0], core._row[0] = t_s, f_axis
        _run(core.memory, core.watch, core.sensor, core.tuning, core.limits, core._time, core._row, core.now)
        return self._state()

    def skip(self, n: int) -> None:
        """See RateEstimator.skip; the next step predicts across the gap."""
        self.core.gap()

    def exclude(self, mask: int) -> None:
        """See RateEstimator.exclude."""
        self.core.exclude(mask)

    def tacho_axis(self, axis_b: Sequence[float]) -> None:
        """Axis in b that tachometer rates are about, any length. Raises ValueError for no direction."""
        axis = np.array(axis_b, dtype=np.float64)
        if axis.shape != (3,) or not np.linalg.norm(axis) > 0.0:
            raise ValueError(f"axis of the tachometer {axis_b}: want three numbers that are not all zero")
        self._axis_b = axis / np.linalg.norm(axis)

    def tacho(self, t_s: float, rate: float, sigma: float, signed: bool = True) -> None:
        """See RateEstimator.tacho; it is used with the first step after a sample of its time."""
        self._reports.add(t_s, rate, sigma, signed)

    def _take_reports(self) -> None:
        core = self.core
        for report in self._reports.due(float(core.memory["clock"][frame.LAST_S])):
            if tachometer.correct(core.memory, core.watch, core.sensor, self._axis_b, report):
                self._aid = tachometer.NAME

    def run_batch(self, t_s: Array, f_axis: Array) -> products_ekf.Track:
        """All samples at once: times (n,) s, growing, readings (n, N) m/s^2; the same bits as step() gives one by one.

        Raises ValueError for readings that are not finite or times that do not grow.
        """
        return self.core.run(t_s, f_axis)

    @property
    def refused(self) -> dict[str, int]:
        """Corrections not used because their NIS was beyond its gate: by the products, by gravity ("force")."""
        return self.core.refused

    def _state(self) -> RateState:
        core, track = self.core, self.core.now
        x = core.memory["core"]
        started, still = bool(track.started[0]), bool(track.still[0])
        if self._bound is not None and started:
            dt = float(core.memory["clock"][frame.DT])
            self._bound.step(track.omega_b[0], track.alpha_b[0], track.q_nb[0], still, dt)
        m = int(core.sensor["m"])
        P = track.P[0] + self._unseen if still and started else track.P[0].copy()
        sights, reason = (sight.BLIND,) * 3, "no standstill yet: keep still"
        if started:
            two, sign = int(core.memory["marks"][frame.BRANCHES]) == 2, float(x[products_kernel.SIGN])
            dt = float(core.memory["clock"][frame.DT])
            sights, reason = sight.judge(track.omega_b[0], track.P[0], sign, still, two, core.sensor, dt)
        corrected = started and m > 0 and track.nis[0] != 0.0
        return RateState(
            omega_b=track.omega_b[0].copy(),
            P=P,
            alpha_b=track.alpha_b[0].copy(),
            f_b=track.f_b[0].copy(),
            q_nb=track.q_nb[0].copy(),
            angle_z=float(track.angle_z[0]),
            innovation=track.innovation[0, :m].copy() if corrected else EMPTY,
            innovation_sigma=track.innovation_sigma[0, :m].copy() if corrected else EMPTY,
            nis=float(track.nis[0]) if corrected else 0.0,
            nis_dof=m if corrected else 0,
            still=still,
            p_n=x[products_kernel.P_N : products_kernel.P_N + 3].copy(),
            v_n=x[products_kernel.V_N : products_kernel.V_N + 3].copy(),
            bias=np.concatenate([x[3:6], x[15:18], x[6:12]]),
            phase=f"{core.phase}, aided by the tachometer" if self._aid else core.phase,
            innovation_unit="(rad/s)^2",
            sight=sights,
            sight_reason=reason,
            excluded=core.excluded,
            calibration=self.calibration,
            aid=self._aid,
            bound_sigma=None if self._bound is None else self._bound.sigma,
        )


class UnscentedRate(ProductsRate):
    """Estimator "products-ukf": the same model through sigma points (unscented.py)."""

    name = "products-ukf"
    method = "ukf"
    with_bound = False
    default = products_ekf.Config(fixed_axis=False)  # its points do not follow a turning axis


class RecursiveLeastSquaresRate(ProductsRate):
    """Estimator "products-rls": the same linearised regression without a noise model, with exponential forgetting."""

    name = "products-rls"
    method = "forget"
    with_bound = False


class MovingHorizonRate(ProductsRate):
    """Estimator "products-mhe": window of 24 samples, Gauss and Newton over it, its arrival cost from the filter."""

    name = "products-mhe"
    method = "horizon"
    with_bound = False


class FreeBodyRate(ProductsRate):
    """Estimator "products-free": for a body in a vehicle, which turns about any axis and whose centre accelerates."""

    name = "products-free"
    with_bound = False
    default = products_ekf.Config(fixed_axis=False, gravity_aid=False)


ESTIMATORS: dict[str, Any] = {
    estimator.name: estimator
    for estimator in (LeastSquaresRate, ProductsRate, UnscentedRate, RecursiveLeastSquaresRate, MovingHorizonRate)
}
"""For a body on its table; compared with each other everywhere."""

VARIANTS: dict[str, Any] = {**ESTIMATORS, FreeBodyRate.name: FreeBodyRate}
"""Everything that [estimator] rate may name."""
