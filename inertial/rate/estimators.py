"""The one door to all gyro-free rate estimators: samples in, columns of rates out.

ESTIMATORS maps a name to a class that is made of a layout and has `feed`, `step` and `skip`.
Deterministic: the same samples give the same bits. Frames and units as everywhere: b body, n
north-east-down, SI, quaternions w x y z.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from inertial.layouts.layout import GeometryError, Layout
from inertial.rate import bound, least_squares, products_ekf, tachometer
from inertial.rate.batch import RateColumns, RateState, columns
from inertial.rate.observed import sensor
from inertial.rate.rows import Rows
from inertial.rate.samples import BRIDGED, Samples

Array = NDArray[np.float64]


class RateEstimator(Protocol):
    """What a rate estimator offers. It is made of a layout, its settings (`default` or a variant of
    it; only where there is one) and the calibration's id, in this order.
    """

    name: str
    # settings that calibration and [estimator] change parts of; None: it takes none
    default: products_ekf.Config | None

    def feed(self, t_s: Array, f_axis: Array) -> RateColumns:
        """Take samples read at t_s (n,), s, of the board's clock: readings (n, N), m/s^2.

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

    def withhold(self, on: bool) -> None:
        """Take the samples from here on for none, as when their axes are stale: unknown is said."""
        ...

    def doubt(self, on: bool) -> None:
        """Take the samples from here on, but nothing is valid: their axes do not fit one motion."""
        ...

    def tacho(self, t_s: float, rate: float, sigma: float, signed: bool = True) -> None:
        """A tachometer's rate (rad/s, with its sigma) up to its newest pulse at t_s (s, the clock
        of the samples).

        Without `signed`, rate is a size. Estimators that take no aid ignore it. Raises ValueError
        for no number.
        """
        ...

    def tacho_axis(self, axis_b: Sequence[float]) -> None:
        """Axis in b that tachometer rates are about, any length. Raises ValueError for no
        direction. Estimators that take no aid ignore it.
        """
        ...

    def exclude(self, mask: int) -> None:
        """Go on without the axes whose bits are set; 0 takes all back. The axes in use are solved
        anew.

        Raises GeometryError, and changes nothing, when the rest cannot see omega' and p.
        """
        ...


class _Stepping:
    """One sample as a batch of one: the same compiled loop, so the same bits."""

    def feed(self, t_s: Array, f_axis: Array) -> RateColumns:
        """See RateEstimator.feed."""
        raise NotImplementedError

    def step(self, index: int, t_s: float, f_axis: Array) -> RateState:
        """See RateEstimator.step."""
        return self.feed(np.array([t_s]), np.asarray(f_axis)[None]).state(0)


class LeastSquaresRate(_Stepping):
    """Estimator "least-squares": the paper's equations and Runge-Kutta (least_squares.py)."""

    name = "least-squares"
    default = None

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

    def feed(self, t_s: Array, f_axis: Array) -> RateColumns:
        """See RateEstimator.feed."""
        rows = self._core.rows(*self._taken.take(self._core.layout, t_s, f_axis))
        return columns(
            rows, products=0, biases=6, excluded=self._core.excluded, calibration=self.calibration
        )

    def skip(self, n: int) -> None:
        """See RateEstimator.skip; the next step integrates over the gap with omega' linear across
        it.
        """
        if n > BRIDGED:
            self._core.gap()

    def withhold(self, on: bool) -> None:
        """See RateEstimator.withhold."""
        self._core.native.withhold(on)

    def doubt(self, on: bool) -> None:
        """See RateEstimator.doubt."""
        self._core.native.doubt(on)

    def tacho(self, t_s: float, rate: float, sigma: float, signed: bool = True) -> None:
        """See RateEstimator.tacho: no aid."""

    def tacho_axis(self, axis_b: Sequence[float]) -> None:
        """See RateEstimator.tacho_axis: no aid."""

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
        if sensor(layout, config.still.sigma_axis).feedback:
            # the feedback S Q z acts across the axis: held to an axis, P grows by what is not
            # integrated
            config = replace(config, fixed_axis=False)
        follows = bound.IN_USE if self.with_bound else None
        self.core = products_ekf.ProductsFilter(layout, config, self.method, follows)
        self.calibration = calibration
        self._taken, self._reports = Samples(), tachometer.Reports()
        self._axis_b, self._aided = np.array([0.0, 0.0, 1.0]), False

    def feed(self, t_s: Array, f_axis: Array) -> RateColumns:
        """See RateEstimator.feed."""
        t_s, f_axis = self._taken.take(self.core.layout, t_s, f_axis)
        parts, aided, row = [], np.zeros(len(t_s), np.bool_), 0
        while row < len(t_s):
            if self._reports:
                self._take_reports()
            # while a report waits, its time may come with any sample
            end = row + 1 if self._reports else len(t_s)
            parts.append(self.core.rows(t_s[row:end], f_axis[row:end]))
            aided[row:end] = self._aided
            row = end
        rows = parts[0] if len(parts) == 1 else np.concatenate(parts)
        return self._columns(rows, aided)

    def _columns(self, rows: Rows, aided: NDArray[np.bool_] | None = None) -> RateColumns:
        return columns(
            rows,
            products=self.core.sensor.m,
            biases=12,
            aided=aided,
            innovation_unit="(rad/s)^2",
            excluded=self.core.excluded,
            calibration=self.calibration,
            began_anew=self.core.lost > 0,
        )

    def skip(self, n: int) -> None:
        """See RateEstimator.skip; the next step predicts across the gap."""
        if n > BRIDGED:
            self.core.gap()

    def withhold(self, on: bool) -> None:
        """See RateEstimator.withhold."""
        self.core.native.withhold(on)

    def doubt(self, on: bool) -> None:
        """See RateEstimator.doubt."""
        self.core.native.doubt(on)

    def exclude(self, mask: int) -> None:
        """See RateEstimator.exclude."""
        self.core.exclude(mask)

    def tacho_axis(self, axis_b: Sequence[float]) -> None:
        """Axis in b that tachometer rates are about, any length. Raises ValueError for no
        direction.
        """
        axis = np.array(axis_b, dtype=np.float64)
        size = math.sqrt(sum(v * v for v in axis.tolist())) if axis.shape == (3,) else 0.0
        if not size > 0.0:
            raise ValueError(
                f"axis of the tachometer {axis_b}: want three numbers that are not all zero"
            )
        self._axis_b = axis / size

    def tacho(self, t_s: float, rate: float, sigma: float, signed: bool = True) -> None:
        """See RateEstimator.tacho; it is used before the first sample after one of its time."""
        self._reports.add(t_s, rate, sigma, signed)

    def _take_reports(self) -> None:
        core = self.core.native
        for report in self._reports.due(core.last_s):
            if core.correct(*report, self._axis_b):
                self._aided = True

    def run_batch(self, t_s: Array, f_axis: Array) -> RateColumns:
        """All samples at once: times (n,) s, growing, readings (n, N) m/s^2; the same bits as
        step() gives one by one.

        Raises ValueError for readings that are not finite or times that do not grow.
        """
        return self._columns(self.core.run(t_s, f_axis))

    @property
    def refused(self) -> dict[str, int]:
        """Corrections not used because their NIS was beyond its gate: by the products, by gravity
        ("force").
        """
        return self.core.refused


class UnscentedRate(ProductsRate):
    """Estimator "products-ukf": the same model through sigma points (E-44)."""

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


def leave_out(estimator: RateEstimator, mask: int) -> GeometryError | None:
    """Go on without the axes of the mask's bits; where the rest cannot see omega' and p, samples
    are taken for none until another mask comes, and the error says why.
    """
    try:
        estimator.exclude(mask)
    except GeometryError as error:
        estimator.withhold(True)
        return error
    estimator.withhold(False)
    return None


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
