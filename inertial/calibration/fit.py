"""One least squares for biases, scales, directions and positions, from poses and table steps
together (E-154, E-155).

Every unknown has a wide prior, so that the problem is always solvable; what the data did not narrow
is reported as not observed and keeps its nominal value. Covariances are those of the least squares,
widened where the residuals are larger than the noise explains.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inertial.calibration import model
from inertial.calibration.model import Parameters, Poses, Steps
from inertial.constants import GRAVITY
from inertial.layouts.layout import Layout

Array = NDArray[np.float64]

SETTLED = 3e-6  # of the prior sigma, a step that no longer matters


class CalibrationError(ValueError):
    """Data from which no calibration can be made; says what is missing."""


@dataclass(frozen=True)
class Prior:
    """Sigmas of what is known before any data, and floors of the noise."""

    bias: float = 2.0  # m/s^2: the worst zero offset of common MEMS parts
    scale: float = 0.15  # of 1, and rad of misalignment
    position: float = 0.002  # m, placement of a sensor
    axis: float = 0.5  # rad, of the table's axis about the measured vertical
    offset: float = 0.3  # m, of the body's centre from the table's axis
    floor: float = (
        0.002  # m/s^2, of a mean: rounding and temperature, whatever the number of samples
    )
    gauge: float = 2e-6  # rad and m, how exactly frame and centre are those of the nominal layout
    observed: float = 0.5  # sigma after over sigma before; above it the data said nothing


@dataclass(frozen=True)
class Fit:
    """What the least squares found."""

    parameters: Parameters
    covariance: Array  # (size, size), order of model.apply
    place: NDArray[np.int64]  # (N,), place of every axis
    noise: Array  # (N,) m/s^2, of one sample
    residual: Array  # (N,) m/s^2, RMS of each axis over all poses and blocks
    chi2: float  # per degree of freedom, before the covariance was widened
    dof: int
    iterations: int
    narrowed: Array  # (4 N + 3 S,), sigma after over sigma before

    @property
    def axes(self) -> int:
        """Number of axes N."""
        return len(self.parameters.b)

    @property
    def bias_sigma(self) -> Array:
        """(N,) m/s^2."""
        return np.sqrt(np.diag(self.covariance)[: self.axes])

    @property
    def scale(self) -> Array:
        """(N,), length of c."""
        return np.linalg.norm(self.parameters.c, axis=1)

    @property
    def direction(self) -> Array:
        """(N, 3), unit vectors."""
        return self.parameters.c / self.scale[:, None]

    def axis_covariance(self, i: int) -> Array:
        """Covariance (7, 7) of b, c and r of axis i."""
        n = self.axes
        first = 4 * n + 3 * int(self.place[i])
        rows = np.r_[i, n + 3 * i : n + 3 * i + 3, first : first + 3]
        return self.covariance[np.ix_(rows, rows)]

    @property
    def scale_sigma(self) -> Array:
        """(N,), of 1."""
        along = self.direction
        return np.array(
            [
                np.sqrt(along[i] @ self.axis_covariance(i)[1:4, 1:4] @ along[i])
                for i in range(self.axes)
            ]
        )

    @property
    def misalignment_sigma(self) -> Array:
        """(N,) rad, the larger of the two across."""
        sigma = []
        for i in range(self.axes):
            across = model.tangent(self.direction[i])
            spread = across.T @ self.axis_covariance(i)[1:4, 1:4] @ across
            sigma.append(np.sqrt(np.linalg.eigvalsh(spread)[-1]) / self.scale[i])
        return np.array(sigma)


def start(layout: Layout, poses: Poses | None, steps: Sequence[Steps]) -> Parameters:
    """Nominal axes; directions of gravity from the readings."""
    inverse = np.linalg.pinv(layout.theta_b)

    def upward(mean: Array) -> Array:
        f = inverse @ mean
        return f / max(np.linalg.norm(f), 1e-9)

    rest = np.array([upward(one.mean[np.argmin(one.rate2)]) for one in steps]).reshape(-1, 3)
    up = np.array([upward(mean) for mean in poses.mean]) if poses is not None else np.zeros((0, 3))
    return Parameters(
        b=np.zeros(layout.axes),
        c=layout.theta_b.copy(),
        r=model.places(layout)[1].copy(),
        u=up.reshape(-1, 3),
        a=rest.copy(),
        up=rest.copy(),
        d=np.zeros((len(rest), 3)),
    )


def fit(
    layout: Layout,
    poses: Poses | None,
    steps: Sequence[Steps] = (),
    noise: Array | float = 0.05,
    prior: Prior = Prior(),
    gravity: float = GRAVITY,
    iterations: int = 12,
) -> Fit:
    """Gauss-Newton over all unknowns; noise (N,) or one number, m/s^2, of one sample.

    Raises CalibrationError without any data or when it does not converge.
    """
    if (poses is None or not len(poses.mean)) and not steps:
        raise CalibrationError("no standstill and no table steps in the data: nothing to fit")
    place, r0 = model.places(layout)
    noise = np.broadcast_to(np.asarray(noise, dtype=np.float64), (layout.axes,)).copy()
    first = p = start(layout, poses, steps)
    before = _prior_sigma(p, prior)
    for count in range(1, iterations + 1):
        H, z, rows = _system(
            p, first, layout.theta_b, r0, place, poses, steps, noise, prior, gravity, before
        )
        scaled = H * before
        x, rounds = before * np.linalg.solve(scaled.T @ scaled, scaled.T @ z), count
        p = model.apply(p, x)
        if np.max(np.abs(x / before)) < SETTLED:
            break
    else:
        raise CalibrationError(
            f"the fit did not settle in {iterations} rounds: are the axes those of layout"
            f" {layout.name}?"
        )
    H, z, rows = _system(
        p, first, layout.theta_b, r0, place, poses, steps, noise, prior, gravity, before
    )
    scaled = H * before
    covariance = np.linalg.inv(scaled.T @ scaled) * np.outer(before, before)
    dof = max(1, rows - p.size)
    chi2 = float(z[:rows] @ z[:rows]) / dof
    known = 4 * layout.axes + 3 * len(r0)
    narrowed = np.sqrt(np.diag(covariance)[:known]) / before[:known]
    return Fit(
        parameters=p,
        covariance=covariance * max(1.0, chi2),
        place=place,
        noise=noise,
        residual=_residual(p, place, poses, steps, gravity),
        chi2=chi2,
        dof=dof,
        iterations=rounds,
        narrowed=narrowed,
    )


def _prior_sigma(p: Parameters, prior: Prior) -> Array:
    n, s = len(p.b), len(p.r)
    mounting = [prior.axis] * 4 + [prior.offset] * 3
    return np.concatenate(
        [
            np.full(n, prior.bias),
            np.full(3 * n, prior.scale),
            np.full(3 * s, prior.position),
            np.full(2 * len(p.u), 3.0),  # rad: nothing is known of a pose
            np.tile(mounting, len(p.a)),
        ]
    )


def _system(
    p: Parameters,
    first: Parameters,
    theta0: Array,
    r0: Array,
    place: Array,
    poses: Poses | None,
    steps: Sequence[Steps],
    noise: Array,
    prior: Prior,
    gravity: float,
    before: Array,
) -> tuple[Array, Array, int]:
    """Weighted Jacobian and residual of measurements, priors and gauge; how many rows are
    measurements (E-154).
    """
    blocks, values = [], []
    if poses is not None and len(poses.mean):
        error = poses.mean - model.read_poses(p, gravity)
        for j in range(len(poses.mean)):
            sigma = np.sqrt(noise**2 / poses.samples[j] + prior.floor**2)
            blocks.append(model.pose_jacobian(p, j, gravity) / sigma[:, None])
            values.append(error[j] / sigma)
    for k, one in enumerate(steps):
        arm = np.linalg.norm(p.r[place] + p.d[k], axis=1)
        variance = (
            noise**2 / one.samples[:, None] + prior.floor**2 + (one.alpha_sigma[:, None] * arm) ** 2
        )
        sigma = np.sqrt(variance)
        blocks.append(
            (model.steps_jacobian(p, k, one, place, gravity) / sigma[:, :, None]).reshape(
                -1, p.size
            )
        )
        values.append(((one.mean - model.read_steps(p, k, one, place, gravity)) / sigma).ravel())
    rows = sum(len(value) for value in values)
    n = len(p.b)
    off = np.concatenate([first.b - p.b, (first.c - p.c).ravel(), (first.r - p.r).ravel()])
    H_prior = np.diag(1.0 / before)
    z_prior = np.concatenate([off, np.zeros(p.size - len(off))]) / before
    z_prior[4 * n + 3 * len(p.r) + 2 * len(p.u) :] += (
        _mounting_prior(p) / before[4 * n + 3 * len(p.r) + 2 * len(p.u) :]
    )
    zero, H_gauge = model.gauge(p, theta0, r0)
    H = np.vstack([*blocks, H_prior, H_gauge / prior.gauge])
    return H, np.concatenate([*values, z_prior, -zero / prior.gauge]), rows


def _mounting_prior(p: Parameters) -> Array:
    """Offsets are expected at zero; axes and verticals where they are (only their steps are held
    short).
    """
    out = np.zeros((len(p.a), model.MOUNTING))
    out[:, 4:] = -p.d
    return out.ravel()


def _residual(
    p: Parameters, place: Array, poses: Poses | None, steps: Sequence[Steps], gravity: float
) -> Array:
    errors = [one.mean - model.read_steps(p, k, one, place, gravity) for k, one in enumerate(steps)]
    if poses is not None and len(poses.mean):
        errors.append(poses.mean - model.read_poses(p, gravity))
    return np.sqrt(np.mean(np.vstack(errors) ** 2, axis=0))
