"""Kalman filter on the six products: the rate of a gyro-free IMU without drift while it turns.

Four triads measure w_i w_j without integration (gyro-free-imu, section 6). The filter integrates omega' and corrects
it by the products; the sign comes from the integral. Standstill gives zero rate and biases; gravity's direction, where
the centre does not accelerate, adds omega_x and omega_y. Model and Jacobians: products_model.py (E-30 to E-35).
"""

from dataclasses import dataclass, field, replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

from estimator.attitude.rotation import from_rotation_vector, level, multiply, tilt_correction, to_dcm
from estimator.layouts.layout import Layout
from estimator.rate import products_model as model
from estimator.rate import still as stillness

Array = NDArray[np.float64]

GRAVITY = 9.80665  # m/s^2, standard
UNKNOWN_RATE = 10.0  # rad/s, sigma before any standstill


@dataclass(frozen=True)
class Config:
    """What the filter believes of sensors and motion; sigmas."""

    still: stillness.Config = field(default_factory=stillness.Config)  # its sigma_axis is the filter's noise too
    bias: float = 0.4  # m/s^2, of one axis before the first standstill: 40 mg
    scale: float = 0.007  # scale and cross-axis error left after calibration, of 1
    drift: float = 3e-4  # m/s^2 per root second, bias instability of one axis
    tilt: float = 0.05  # rad, of the first levelling
    gravity: float = 0.01  # m/s^2, of local gravity
    centre: float = 0.02  # m/s^2, white acceleration of the centre while it turns: vibration
    offset: float = 0.001  # m, of the centre from the axis it turns about
    still_rate: float = 0.01  # rad/s, of a standstill over one window
    force_gate: float = 30.0  # NIS, 3 degrees: above it the centre accelerates, gravity is not used
    products_gate: float = 60.0  # NIS, 6 degrees: above it the sample is damaged
    unseen_rate: float = 0.03  # rad/s, of a turn that has begun and is not noticed yet
    unseen_alpha: float = 5.0  # rad/s^2, of a turn during a damaged sample
    replay: int = 60  # samples taken back when a turn is noticed


@dataclass(frozen=True)
class State:
    """Everything that one step hands to the next, but the still detector's window."""

    x: Array  # (18,), products_model
    P: Array  # (18, 18)
    q_nb: Array
    angle_z: float  # rad
    v_n: Array  # m/s
    p_n: Array  # m
    alpha_m: Array  # (3,) measured omega' of the last sample
    force_n: Array  # (3,) C_nb f_b + g_n of the last sample, m/s^2
    spread: Array  # (N,), variance of scale errors already in P, (m/s^2)^2
    reference: Array  # (N,), axis readings of the last standstill, m/s^2


@dataclass(frozen=True)
class Correction:
    """What the products said at one sample."""

    innovation: Array  # (6,), (rad/s)^2
    sigma: Array  # (6,)
    nis: float
    used: bool
    force_nis: float
    force_used: bool


@dataclass(frozen=True)
class Sensor:
    """Constants of a layout with a noise, made once."""

    inverse: Array  # (12, N): [omega'; p; products] of the axes
    R: Array  # (12, 12), covariance of one sample's field
    unit: Array  # (12, N), inverse in the order of biases [alpha, products, p]
    Q: Array  # (N, 6)
    theta_b: Array  # (N, 3)


def sensor(layout: Layout, config: Config) -> Sensor:
    """Raises GeometryError for a layout that does not see all twelve unknowns of the field."""
    inverse = np.ascontiguousarray(layout.field_inverse)
    unit = np.ascontiguousarray(inverse[[0, 1, 2, 6, 7, 8, 9, 10, 11, 3, 4, 5]])
    R = config.still.sigma_axis**2 * inverse @ inverse.T
    return Sensor(inverse, R, unit, np.ascontiguousarray(layout.Q), np.ascontiguousarray(layout.theta_b))


BIASES = np.array([3, 4, 5, 6, 7, 8, 9, 10, 11, 15, 16, 17])  # of x, in the order of Sensor.unit


def start(s: Sensor, config: Config, mean_axis: Array) -> State:
    """First state from the mean axis readings (N,), m/s^2, of a short standstill (E-36)."""
    field_mean = s.inverse @ mean_axis
    f_b = field_mean[3:6]
    up_b = f_b / np.linalg.norm(f_b)
    x, P = np.zeros(model.STATES), np.zeros((model.STATES, model.STATES))
    x[model.U] = GRAVITY * up_b
    along = np.outer(up_b, up_b)
    P[model.OMEGA, model.OMEGA] = config.still_rate**2 * np.eye(3)
    P[model.U, model.U] = config.gravity**2 * along + (config.tilt * GRAVITY) ** 2 * (np.eye(3) - along)
    P[np.ix_(BIASES, BIASES)] = config.bias**2 * s.unit @ s.unit.T
    axes = len(mean_axis)
    zero = np.zeros(3)
    return State(x, P, level(f_b), 0.0, zero, zero, field_mean[:3], zero, np.zeros(axes), s.theta_b @ f_b)


@njit(cache=True)
def _filter(
    x: Array,
    P: Array,
    alpha_m: Array,
    y: Array,
    R: Array,
    Q_bias: Array,
    dt: float,
    turning: bool,
    rates: Array,
) -> tuple[Array, Array, Array, Array, float, float]:
    """Predict, correct by products, gravity and standstill. rates: still_rate^2, force variance, both gates."""
    before, x = x, model.transition(x, alpha_m, dt, turning)
    F = model.transition_jacobian(before, x, dt, turning)
    P = F @ P @ F.T
    P[3:12, 3:12] += Q_bias[0:9, 0:9]
    P[15:18, 15:18] += Q_bias[9:12, 9:12]
    P[3:12, 15:18] += Q_bias[0:9, 9:12]
    P[15:18, 3:12] += Q_bias[9:12, 0:9]
    if turning:
        P[0:3, 0:3] += dt * dt * R[0:3, 0:3]
    mean, covariance = model.products_spread(P[0:3, 0:3])
    innovation = y[6:12] - model.measured_products(x) - mean
    x, P, C, nis = model.correct(x, P, innovation, model.products_jacobian(x), R[6:12, 6:12] + covariance, rates[2])
    R_force = R[3:6, 3:6] + rates[1] * np.eye(3)
    x, P, _, force_nis = model.correct(
        x, P, y[3:6] - model.measured_force(x), model.force_jacobian(), R_force, rates[3]
    )
    if not turning:
        H = np.zeros((6, model.STATES))
        zero = np.empty(6)
        for i in range(3):
            H[i, i] = 1.0
            H[3 + i, 3 + i] = 1.0
            zero[i], zero[3 + i] = -x[i], y[i] - x[3 + i]
        R_still = np.zeros((6, 6))
        R_still[0:3, 0:3] = rates[0] * np.eye(3)
        R_still[3:6, 3:6] = R[0:3, 0:3]
        x, P, _, _ = model.correct(x, P, zero, H, R_still, np.inf)
    return x, P, innovation, C, nis, force_nis


@njit(cache=True)
def _bias_growth(
    omega: Array,
    u: Array,
    Q: Array,
    theta_b: Array,
    unit: Array,
    spread: Array,
    reference: Array,
    scale: float,
    drift: float,
) -> tuple[Array, Array]:
    """Covariance (12, 12) that biases gain in one step, and the scale-error variance (N,) then accounted for (E-37).

    A scale error e of an axis is a bias e (f - f at the last standstill): constant on a plateau, so it grows only
    while the axis reading changes, and not again for every sample.
    """
    z = np.empty(6)
    for k in range(6):
        z[k] = omega[model.FIRST[k]] * omega[model.SECOND[k]]
    target = (scale * (Q @ z + theta_b @ u - reference)) ** 2
    change = np.abs(target - spread)
    variance = np.full(len(spread), drift)
    if change.max() > 0.2 * max(target.max(), spread.max()):
        variance, spread = variance + change, target
    return (unit * variance) @ unit.T, spread


@njit(cache=True)
def _navigate(
    q_nb: Array, v_n: Array, p_n: Array, force_n: Array, omega: Array, u: Array, f_b: Array, dt: float
) -> tuple[Array, Array, Array, Array]:
    """Attitude by the mean rate, tilt by u; then velocity and position from f_b (E-12, E-13)."""
    q_nb = tilt_correction(multiply(q_nb, from_rotation_vector(dt * omega)), u, 1.0)
    new_force = to_dcm(q_nb) @ f_b
    new_force[2] += GRAVITY
    new_v = v_n + 0.5 * dt * (force_n + new_force)
    return q_nb, new_v, p_n + 0.5 * dt * (v_n + new_v), new_force


def step(state: State, s: Sensor, f_axis: Array, dt: float, turning: bool, config: Config) -> tuple[State, Correction]:
    """One sample: axis readings (N,), m/s^2, dt (s) after the last; turning is what the still detector denies."""
    y = s.inverse @ f_axis
    omega, u, c = state.x[model.OMEGA], state.x[model.U], config
    scale = c.scale if turning else 0.0
    growth = _bias_growth(omega, u, s.Q, s.theta_b, s.unit, state.spread, state.reference, scale, c.drift**2 * dt)
    force = c.centre**2 + (c.offset * float(omega @ omega)) ** 2 if turning else 0.0
    rates = np.array([c.still.window * c.still_rate**2, force, c.products_gate, c.force_gate])
    alpha_m = 0.5 * (state.alpha_m + y[:3])
    x, P, innovation, C, nis, force_nis = _filter(state.x, state.P, alpha_m, y, s.R, growth[0], dt, turning, rates)
    used, force_used = nis <= c.products_gate, force_nis <= c.force_gate
    if not used:  # a damaged sample: its omega' must not be integrated either
        y = np.concatenate([state.alpha_m, state.x[model.U] + state.x[model.B_F], y[6:]])
        rates[2:] = -1.0
        x, P, *_ = _filter(state.x, state.P, y[:3].copy(), y, s.R, growth[0], dt, True, rates)
        P[model.OMEGA, model.OMEGA] += (c.unseen_alpha * dt) ** 2 * np.eye(3)
    mean_rate = 0.5 * (omega + x[model.OMEGA])
    q_nb, v_n, p_n, force_n = _navigate(
        state.q_nb, state.v_n, state.p_n, state.force_n, mean_rate, x[model.U], y[3:6] - x[model.B_F], dt
    )
    reference = state.reference if turning else s.theta_b @ x[model.U]
    angle = state.angle_z + dt * float(mean_rate[2])
    new = State(x, P, q_nb, angle, v_n, p_n, y[:3], force_n, growth[1], reference)
    return new, Correction(innovation, np.sqrt(np.diag(C)), nis, used, force_nis, force_used)


class ProductsEkf:
    """Runs the functions above over samples, with the still detector and the taking back of unnoticed turns."""

    def __init__(self, layout: Layout, config: Config = Config()) -> None:
        """Raises GeometryError for a layout that does not see the products."""
        self.layout = layout
        self.config = config
        self.sensor = sensor(layout, config)
        self.state: State | None = None
        self.correction: Correction | None = None
        self.still = False
        self.refused = {"products": 0, "force": 0}  # corrections not used, by kind
        self._detector = stillness.StillDetector(layout.axes, stillness.quiet_map(layout), config.still)
        self._standstill = stillness.Standstill(layout.axes, config.still.window)
        self._held: list[tuple[State, Array, float]] = []  # states before the newest still samples
        self._moved = False

    @property
    def phase(self) -> str:
        """For people: what it is doing."""
        if self.state is None:
            return "finding biases: keep still"
        return "still" if self.still else "turning"

    def gap(self) -> None:
        """Samples are missing: the next step predicts across."""
        self._detector.forget()
        self._held.clear()

    def restart(self) -> None:
        """The rate is unknown: wait for a standstill."""
        self.gap()
        self._standstill.clear()
        self.state = None

    def step(self, f_axis: Array, dt: float) -> None:
        """One sample (N,), m/s^2, checked, dt (s) after the last."""
        if self.state is None:
            self._first(f_axis, dt)
            return
        was_still = self.still
        x, P = self.state.x, self.state.P
        self.still = self._detector.update(f_axis, x[model.OMEGA], P[model.OMEGA, model.OMEGA], dt)
        if self.still:
            self._hold(f_axis, dt)
        elif was_still:
            self._take_back()
        self.state, self.correction = step(self.state, self.sensor, f_axis, dt, not self.still, self.config)
        if self.still and not self._moved:  # position counts from the end of the first standstill
            self.state = replace(self.state, v_n=np.zeros(3), p_n=np.zeros(3), angle_z=0.0)
        self.refused["products"] += not self.correction.used
        self.refused["force"] += not self.correction.force_used

    def _first(self, f_axis: Array, dt: float) -> None:
        unknown = UNKNOWN_RATE**2 * np.eye(3)
        self.correction = None
        self.still = self._detector.update(f_axis, np.zeros(3), unknown, dt)
        if self.still:
            self.state = start(self.sensor, self.config, self._detector.mean())
            self._moved = False

    def _hold(self, f_axis: Array, dt: float) -> None:
        self._standstill.add(f_axis)
        if self._standstill.samples and self._standstill.samples % self.config.still.window == 0:
            self._detector.learn(self._standstill.mean(), self._standstill.samples)
        self._held.append((self.state, f_axis, dt))
        if len(self._held) > self.config.replay:
            self._held.pop(0)

    def _take_back(self) -> None:
        """The turn began before it was noticed: run the newest samples again, as turning."""
        self._moved = True
        if self._held:
            self.state = self._held[0][0]
        for _, f_axis, dt in self._held:
            self.state, _ = step(self.state, self.sensor, f_axis, dt, True, self.config)
        self._held.clear()
        self._standstill.clear()
