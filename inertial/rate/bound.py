"""The posterior Cramer-Rao bound: no filter of this model can know the rate better, whatever it
does.

    J_k+1 = (F_k J_k^-1 F_k^T + Q)^-1 + H^T R^-1 H              along the true motion (Tichavsky
    1998, E-48)

written with the covariance J^-1, because the information of a state that is known exactly is
infinite. Sensors are calibrated here: noise and quantisation only, biases constant. `known_still`
adds the knowledge of when the body stands; `gravity` adds u, the biases of p and the pivot;
`fixed_axis` that omega keeps its direction.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from inertial.core import native
from inertial.layouts.layout import Layout
from inertial.rate import products_model as model
from inertial.rate.observed import Sensor, axis_noise, sensor

Array = NDArray[np.float64]

GRAVITY = 9.80665  # m/s^2, standard


@dataclass(frozen=True)
class Knowledge:
    """What the model of the bound knows beside the axes."""

    known_still: bool = True
    gravity: bool = False
    fixed_axis: bool = False
    sigma_axis: float | None = None  # m/s^2; None: what the layout says
    standstill: int = 450  # samples before the first, which the biases come from
    tilt: float = 0.05  # rad, of the first levelling
    bias: float = 0.4  # m/s^2, of one axis before that
    centre: float = 0.02  # m/s^2, white acceleration of the centre while turning
    pivot: float = 0.2  # m
    axis_wander: float = 4e-4  # rad/s per root second
    axis_from: float = 0.4  # rad/s


SOURCE = Knowledge(known_still=False)  # of the published figures without the knowledge of stillness
SOURCE_STILL = Knowledge()
IN_USE = Knowledge(gravity=True, fixed_axis=True)  # the model of products-ekf


def axis_sigma(layout: Layout, what: Knowledge) -> float:
    """Noise of one axis that the bound goes by, m/s^2."""
    return axis_noise(layout) if what.sigma_axis is None else what.sigma_axis


def known(layout: Layout, what: Knowledge) -> native.RateKnowledge:
    """Knowledge for the core, which takes gravity and a fixed axis for known."""
    out = native.RateKnowledge()
    out.biases = axis_sigma(layout, what) ** 2 / what.standstill
    out.share = 1.0 / what.standstill
    out.tilt, out.bias, out.centre = (what.tilt * GRAVITY) ** 2, what.bias**2, what.centre**2
    out.pivot, out.wander, out.axis_from = what.pivot**2, what.axis_wander**2, what.axis_from**2
    return out


def rate_bound(
    layout: Layout, t_s: Array, q_nb: Array, omega_b: Array, alpha_b: Array, what: Knowledge
) -> Array:
    """Sigma of each component of omega after each sample, (n, 3), rad/s.

    True motion at times t_s (n,): attitude (n, 4), rate (n, 3) rad/s and angular acceleration (n,
    3) rad/s^2. Raises GeometryError for a layout that does not see omega' and p.
    """
    s = sensor(layout, what.sigma_axis)
    P, out = _prior(s, axis_sigma(layout, what), q_nb[0], what), np.empty((len(t_s), 3))
    m, M, SQ = s.m, s.M, np.vstack([s.SQ_alpha, s.SQ_force])
    for k in range(len(t_s)):
        dt = t_s[k] - t_s[k - 1] if k else t_s[1] - t_s[0]
        omega, still = (
            omega_b[k],
            what.known_still and not omega_b[k].any() and not alpha_b[k].any(),
        )
        x = np.zeros(model.STATES)
        x[model.OMEGA], x[model.U] = omega, _up(q_nb[k])
        P = _moved(P, x, alpha_b[k], SQ, s, dt, still, what)
        if m:
            P = _seen(P, model.measured_products_jacobian(x, M)[:m], s.R_c[:m, :m])
        if what.gravity:
            R = s.R_p + (what.centre**2 if not still else 0.0) * np.eye(3)
            P = _seen(P, model.measured_force_jacobian(x, alpha_b[k], SQ), R)
        if still:
            P = _seen(P, np.eye(6, model.STATES), np.diag([1e-10] * 3 + list(np.diag(s.R_alpha))))
        out[k] = np.sqrt(np.diag(P)[:3])
    return out


def _prior(s: Sensor, sigma_axis: float, q_nb: Array, what: Knowledge) -> Array:
    P = np.zeros((model.STATES, model.STATES))
    biases = sigma_axis**2 / what.standstill * s.drift
    P[np.ix_(model.BIASES, model.BIASES)] = biases
    P[0:3, 0:3] = 1e-10 * np.eye(3)
    if what.gravity:
        up = _up(q_nb) / GRAVITY
        across = np.eye(3) - np.outer(up, up)
        # tilt and bias of p are known together, not apart
        P[model.U, model.U] = (what.tilt * GRAVITY) ** 2 * across
        own = what.bias**2 * s.drift[9:, 9:]
        P[model.B_F, model.B_F] = own
        P[model.PIVOT, model.PIVOT] = what.pivot**2 * np.eye(3)
        together = np.hstack([np.eye(3), np.eye(3)])
        both = np.r_[model.U, model.B_F]
        sub = P[np.ix_(both, both)]
        C = together @ sub @ together.T + s.R_p / what.standstill
        P[np.ix_(both, both)] = sub - sub @ together.T @ np.linalg.solve(C, together @ sub)
    return P


def _moved(
    P: Array,
    x: Array,
    alpha: Array,
    SQ: Array,
    s: Sensor,
    dt: float,
    still: bool,
    what: Knowledge,
    n: int = 1,
) -> Array:
    """P after n samples, dt s in all."""
    turning, omega = not still, x[model.OMEGA]
    y = model.transition(x, alpha, SQ, dt, turning)
    F = model.transition_jacobian(x, y, SQ, dt, turning)
    N = np.eye(3)
    square = float(omega @ omega)
    if what.fixed_axis and square > what.axis_from**2:
        N = np.outer(omega, omega) / square
        F[0:3, 0:3] += dt * float(alpha @ omega) / square * (np.eye(3) - N)
        F[0:3, 3:6] = -dt * N
    P = F @ P @ F.T
    if turning:
        P[0:3, 0:3] += dt * dt / n * N @ s.R_alpha @ N.T + what.axis_wander**2 * dt * (
            np.eye(3) - N
        )
    return P


def _seen(P: Array, H: Array, R: Array) -> Array:
    C = H @ P @ H.T + R
    P = P - P @ H.T @ np.linalg.solve(C, H @ P)
    return 0.5 * (P + P.T)


def _up(q_nb: Array) -> Array:
    """-C_bn g_n: what a body at rest feels."""
    w, x, y, z = q_nb
    down = np.array([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)])
    return -GRAVITY * down


class Along:
    """The bound along an estimate instead of the truth, live (inertial/core/rate/bound.cpp)."""

    def __init__(self, layout: Layout, what: Knowledge = IN_USE) -> None:
        """Raises GeometryError for a layout that does not see omega' and p."""
        self._native = native.RateBound(sensor(layout, what.sigma_axis), known(layout, what))

    @property
    def sigma(self) -> Array | None:
        """rad/s, (3,); None before the first standstill."""
        return self._native.sigma if self._native.known else None

    def step(self, omega_b: Array, alpha_b: Array, q_nb: Array, still: bool, dt: float) -> None:
        """One sample of the estimate: rate, angular acceleration, attitude, the zero-velocity
        detector's word.
        """
        self._native.step(omega_b, alpha_b, q_nb, still, dt)


def rms(sigma: Array) -> Array:
    """Root of the mean variance over time, (3,)."""
    return np.sqrt(np.mean(sigma**2, axis=0))


def plot_bound(
    path: Path | str, t_s: Array, bound: Array, error: Array | None = None, title: str = ""
) -> None:
    """Picture of the 3-sigma bound (n, 3), rad/s, over time, and of an error (n, 3) within it;
    format by suffix.
    """
    from matplotlib.figure import Figure  # here: only who draws needs it

    figure = Figure(figsize=(9.0, 6.5), layout="constrained")
    for k, axes in enumerate(figure.subplots(3, 1, sharex=True)):
        axes.fill_between(
            t_s,
            -3 * np.degrees(bound[:, k]),
            3 * np.degrees(bound[:, k]),
            color="#56B4E9",
            alpha=0.35,
            label="3 sigma of the bound",
        )
        if error is not None:
            axes.plot(
                t_s,
                np.degrees(error[:, k]),
                color="#D55E00",
                linewidth=0.7,
                label="error of the estimate",
            )
        axes.set_ylabel(f"omega {'xyz'[k]}, °/s")
        axes.grid(alpha=0.3)
    figure.axes[0].legend(loc="upper left", fontsize=8)
    figure.axes[0].set_title(title or "Posterior Cramer-Rao bound of the rate")
    figure.axes[-1].set_xlabel("time, s")
    figure.savefig(path, dpi=110)
