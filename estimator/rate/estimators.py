"""The one door to all gyro-free rate estimators: samples in, RateState out.

ESTIMATORS maps a name to a class that is made of a layout and has `step` and `skip`. Deterministic: the same
samples give the same bits. Frames and units as everywhere: b body, n north-east-down, SI, quaternions w x y z.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from estimator.layouts.layout import Layout
from estimator.rate import least_squares, products_ekf
from estimator.rate import products_model as model
from estimator.rate.field import checked

Array = NDArray[np.float64]

LONGEST_GAP_S = 0.5  # s; after a longer one the rate is unknown and a standstill is needed


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

    def __init__(self, layout: Layout, config: least_squares.Config = least_squares.Config()) -> None:
        """Raises GeometryError when the layout cannot see angular acceleration and specific force."""
        self._core = least_squares.LeastSquares(layout, config)
        self._clock = _Clock()

    def step(self, index: int, t_s: float, f_axis: Array) -> RateState:
        """See RateEstimator.step."""
        core = self._core
        core.step(f_axis, self._clock.advance(t_s))
        y = core.state.y
        return RateState(
            omega_b=y[least_squares.OMEGA].copy(),
            P=core.P.copy(),
            alpha_b=core.alpha_b.copy(),
            f_b=core.f_b.copy(),
            q_nb=y[least_squares.Q_NB].copy(),
            angle_z=float(y[least_squares.ANGLE]),
            innovation=EMPTY,
            innovation_sigma=EMPTY,
            nis=0.0,
            nis_dof=0,
            still=core.still,
            p_n=y[least_squares.P_N].copy(),
            v_n=y[least_squares.V_N].copy(),
            bias=core.state.bias.copy(),
            phase=core.phase,
        )

    def skip(self, n: int) -> None:
        """See RateEstimator.skip; the next step integrates over the gap with omega' linear across it."""
        self._core.gap()


class ProductsRate:
    """Estimator "products-ekf": Kalman filter on the six products (products_ekf.py)."""

    name = "products-ekf"

    def __init__(self, layout: Layout, config: products_ekf.Config = products_ekf.Config()) -> None:
        """Raises GeometryError when the layout does not see the products of the rate."""
        self._core = products_ekf.ProductsEkf(layout, config)
        self._clock = _Clock()
        self._dt = 0.01

    def step(self, index: int, t_s: float, f_axis: Array) -> RateState:
        """See RateEstimator.step."""
        core = self._core
        f_axis = checked(core.layout, f_axis)
        dt = self._clock.advance(t_s)
        if dt is not None and dt > LONGEST_GAP_S:
            core.restart()
        elif dt is not None:
            self._dt = dt
        core.step(f_axis, self._dt)
        return self._waiting(f_axis) if core.state is None else self._running(f_axis)

    def skip(self, n: int) -> None:
        """See RateEstimator.skip; the next step predicts across the gap."""
        self._core.gap()

    @property
    def refused(self) -> dict[str, int]:
        """Corrections not used because their NIS was beyond its gate: by the products, by gravity ("force")."""
        return dict(self._core.refused)

    def _running(self, f_axis: Array) -> RateState:
        core, state, correction = self._core, self._core.state, self._core.correction
        x = state.x
        field = core.sensor.inverse @ f_axis
        unseen = core.config.unseen_rate**2 if core.still else 0.0
        return RateState(
            omega_b=x[model.OMEGA].copy(),
            P=state.P[model.OMEGA, model.OMEGA] + unseen * np.eye(3),
            alpha_b=field[:3] - x[model.B_ALPHA],
            f_b=field[3:6] - x[model.B_F],
            q_nb=state.q_nb.copy(),
            angle_z=float(state.angle_z),
            innovation=EMPTY if correction is None else correction.innovation,
            innovation_sigma=EMPTY if correction is None else correction.sigma,
            nis=0.0 if correction is None else correction.nis,
            nis_dof=0 if correction is None else 6,
            still=core.still,
            p_n=state.p_n.copy(),
            v_n=state.v_n.copy(),
            bias=np.concatenate([x[model.B_ALPHA], x[model.B_F], x[model.B_W]]),
            phase=core.phase,
            innovation_unit="(rad/s)^2",
        )

    def _waiting(self, f_axis: Array) -> RateState:
        field, zero = self._core.sensor.inverse @ f_axis, np.zeros(3)
        return RateState(
            omega_b=zero,
            P=products_ekf.UNKNOWN_RATE**2 * np.eye(3),
            alpha_b=field[:3],
            f_b=field[3:6],
            q_nb=np.array([1.0, 0.0, 0.0, 0.0]),
            angle_z=0.0,
            innovation=EMPTY,
            innovation_sigma=EMPTY,
            nis=0.0,
            nis_dof=0,
            still=self._core.still,
            p_n=zero,
            v_n=zero,
            bias=np.zeros(12),
            phase=self._core.phase,
        )


ESTIMATORS: dict[str, type[LeastSquaresRate] | type[ProductsRate]] = {
    LeastSquaresRate.name: LeastSquaresRate,
    ProductsRate.name: ProductsRate,
}
