"""The products filters: settings, one sample or a whole log at a time, exclusion of axes.

Four triads measure w_i w_j without integration (gyro-free-imu, section 6). The filter integrates
omega' and corrects it by the products; the sign comes from the integral. Standstill gives zero rate
and biases; gravity's direction adds omega_x and omega_y. Layouts that see fewer combinations of the
products use those; the rest is integration.
Model: products_model.py (E-30 to E-39). What is done at each sample: inertial/core/rate/frame.hpp.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inertial.core import native
from inertial.layouts.layout import Layout
from inertial.rate import still as stillness
from inertial.rate.bound import Knowledge, known
from inertial.rate.observed import carry_biases, sensor
from inertial.rate.rows import Rows, after

Array = NDArray[np.float64]

METHODS = {"ekf": 0, "ukf": 1, "forget": 2, "horizon": 3}  # of Method in the core
GRAVITY = 9.80665  # m/s^2, standard
EARTH_RATE = 7.292115e-5  # rad/s, WGS-84


@dataclass(frozen=True)
class Config:
    """What the filter believes of sensors and motion; sigmas."""

    still: stillness.Config = field(
        default_factory=stillness.Config
    )  # its sigma_axis is the filter's noise too
    # m/s^2, of one axis before the first standstill; None: 40 mg, or what the layout says if more
    bias: float | None = None
    # scale and cross-axis error of 1; None: 0.007, or what the layout says if more
    scale: float | None = None
    drift: float = 3e-4  # m/s^2 per root second, bias instability of one axis
    tilt: float = 0.05  # rad, of the first levelling
    gravity: float = 0.01  # m/s^2, of local gravity
    centre: float = 0.02  # m/s^2, white acceleration of the centre while it turns: vibration
    pivot: float = 0.2  # m, of the centre from the point it turns about
    pivot_drift: float = 1e-4  # m per root second
    still_rate: float = 0.01  # rad/s, of a standstill over one window
    force_gate: float = 30.0  # NIS, 3 degrees: above it the centre accelerates, gravity is not used
    products_gate: float = 60.0  # NIS, 6 degrees: above it the sample is damaged
    unseen_rate: float = 0.03  # rad/s, of a turn that has begun and is not noticed yet
    unseen_alpha: float = 5.0  # rad/s^2, of a turn during a damaged sample
    forget_s: float = 4.0  # s, memory of the filter with forgetting
    start_turning: float = 2.0  # sigmas of bias that a product must exceed to start while turning
    latitude: float | None = None  # rad; given, a standing body turns with the Earth
    fixed_axis: bool = (
        True  # omega keeps its direction in the body, as on a table, until omega' says otherwise
    )
    axis_wander: float = 4e-4  # rad/s per root second, of omega across a fixed axis
    axis_from: float = 0.4  # rad/s; below it no axis is known
    axis_limit: float = (
        22.0  # chi-square, 2 degrees, of omega' across the axis over 16 and 64 samples
    )
    axis_lost: float = (
        0.05  # rad/s, what omega across the axis may have become when that is noticed
    )
    gravity_aid: bool = True  # tilt from gravity where the centre's motion allows


BIAS = 0.4  # m/s^2: 40 mg
SCALE = 0.007  # of 1


def axis_bias(layout: Layout, config: Config) -> float:
    """Sigma of an axis' bias before the first standstill, m/s^2, RMS over the axes."""
    if config.bias is not None:
        return config.bias
    return max(BIAS, float(np.sqrt(np.mean([sensor.bias**2 for sensor in layout.sensors]))))


def axis_scale(layout: Layout, config: Config) -> float:
    """Sigma of an axis' scale error, of 1, RMS over the axes."""
    if config.scale is not None:
        return config.scale
    return max(SCALE, float(np.sqrt(np.mean([one.scale_error**2 for one in layout.sensors]))))


def tuning(layout: Layout, config: Config, method: str = "ekf") -> native.RateTuning:
    """Config for the core."""
    c, g, out = config, GRAVITY, native.RateTuning()
    north = 0.0 if c.latitude is None else EARTH_RATE * native.cos(c.latitude)
    down = 0.0 if c.latitude is None else -EARTH_RATE * native.sin(c.latitude)
    values = {
        "method": METHODS[method],
        "scale": axis_scale(layout, c) ** 2,
        "drift": c.drift**2,
        "centre": c.centre**2,
        "pivot_drift": c.pivot_drift**2,
        "still_rate": c.still.window * c.still_rate**2,
        "first_still_rate": c.still_rate**2,
        "products_gate": c.products_gate,
        "force_gate": c.force_gate,
        "unseen_alpha": c.unseen_alpha**2,
        "unseen_rate": c.unseen_rate**2,
        "forget": 1.0 / c.forget_s,
        "bias": axis_bias(layout, c) ** 2,
        "tilt": (c.tilt * g) ** 2,
        "gravity": c.gravity**2,
        "pivot": c.pivot**2,
        "gravity_aid": c.gravity_aid,
        "start_turning": c.start_turning**2,
        "axis": c.axis_wander**2 if c.fixed_axis else 0.0,
        "axis_from": c.axis_from**2,
        "axis_limit": c.axis_limit,
        "axis_lost": c.axis_lost**2,
        "earth_north": north,
        "earth_down": down,
    }
    for name, value in values.items():
        setattr(out, name, value)
    return out


class ProductsFilter:
    """Memory and constants of one filter of one layout."""

    def __init__(
        self,
        layout: Layout,
        config: Config = Config(),
        method: str = "ekf",
        bound: Knowledge | None = None,
        excluded: int = 0,
    ) -> None:
        """bound: what the Cramer-Rao bound along the estimate knows; None: it is not followed.

        Raises GeometryError for a layout that does not see angular acceleration and specific force.
        """
        self.layout, self.config, self.method = layout, config, method
        self.bound, self.excluded = bound, excluded
        self.sensor = sensor(layout, config.still.sigma_axis, excluded)
        limits = stillness.limits(config.still)
        self.native = native.RateProductsFilter(self.sensor, tuning(layout, config, method), limits)
        if bound is not None:
            self.native.follow(sensor(layout, bound.sigma_axis), known(layout, bound))

    def __getstate__(self) -> tuple[Any, ...]:
        made_of = self.layout, self.config, self.method, self.bound, self.excluded
        return *made_of, self.native.snapshot()

    def __setstate__(self, state: tuple[Any, ...]) -> None:
        *made_of, image = state
        ProductsFilter.__init__(self, *made_of)
        self.native.restore(image)

    @property
    def refused(self) -> dict[str, int]:
        """Corrections not used because their NIS was beyond its gate: by the products, by gravity
        ("force").
        """
        return {"products": self.native.refused_products, "force": self.native.refused_force}

    @property
    def lost(self) -> int:
        """How often the filter had to start anew: a rate beyond all bounds, or a covariance that is
        none.
        """
        return self.native.lost

    def rows(self, t_s: Array, f_axis: Array) -> Rows:
        """Samples (n, N), m/s^2, at t_s (n,), s, both checked: a row after each."""
        return after(self.native, t_s, f_axis)

    def gap(self) -> None:
        """Samples are missing: the next step predicts across."""
        self.native.gap()

    def run(self, t_s: Array, f_axis: Array) -> Rows:
        """All samples (n, N) at once; the same bits as in parts. Raises ValueError for unusable
        input.
        """
        t_s = np.ascontiguousarray(t_s, dtype=np.float64)
        f_axis = np.ascontiguousarray(f_axis, dtype=np.float64)
        if f_axis.shape != (len(t_s), self.layout.axes):
            raise ValueError(
                f"readings {f_axis.shape}, want ({len(t_s)}, {self.layout.axes}) of"
                f" {self.layout.name}"
            )
        if not (np.isfinite(f_axis).all() and (np.diff(t_s) > 0.0).all()):
            raise ValueError(
                "readings that are not finite, or times that do not grow: clean the log first"
            )
        return self.rows(t_s, f_axis)

    def exclude(self, mask: int) -> None:
        """Go on without the axes of the mask's bits; what the biases were is carried over (E-42).

        Raises GeometryError, and changes nothing, when the rest does not see omega' and p.
        """
        if mask == self.excluded:
            return
        old, new = self.sensor, sensor(self.layout, self.config.still.sigma_axis, mask)
        self.native.exclude(new, *carry_biases(old, new, axis_bias(self.layout, self.config)))
        self.sensor, self.excluded = new, mask
