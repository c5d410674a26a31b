"""Alignment without a standstill: attitude and biases from a few seconds of fixes and samples under
way.

The gyros give the body's attitude relative to the window's first fix; the velocities of the fixes
give what the accelerometers must have felt. Both together, and a course that is roughly the
heading, are a least-squares problem of twelve unknowns, whose information matrix is the honest
uncertainty at the start. Equations E-80 to E-84 of docs/equations-in-motion.md (inmotion-alignment,
section 10.3, with every fix of the window instead of one TRIAD).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inertial.constants import GRAVITY
from inertial.core import native
from inertial.elementary import applied, atan2, dot, norm, product
from inertial.rotation import euler_matrix, rotation_vector, turn_matrix

Array = NDArray[np.float64]

UNKNOWNS = 12  # psi_n at the first fix, v_n at the first fix, accelerometer bias, gyro bias
PSI, V0, BA, BG = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 12)
STEP = np.concatenate([np.full(3, 1e-5), np.full(3, 1e-3), np.full(3, 1e-3), np.full(3, 1e-5)])


@dataclass(frozen=True)
class MotionSettings:
    """What is assumed before the window, and when its answer is good enough."""

    shortest: float = 5.0  # s of fixes
    longest: float = 30.0  # s kept
    fixes: int = 5  # at least
    sigma_accel: float = (
        0.2  # m/s^2, bias of an uncalibrated MEMS accelerometer, its scale error on 1 g included
    )
    sigma_gyro: float = math.radians(1.0)  # rad/s, bias of a gyro that has not been seen at rest
    sigma_slip: float = math.radians(
        6.0
    )  # rad, of the course against x_b in one fix; inf: no such knowledge
    sigma_mount: float = math.radians(
        4.0
    )  # rad, of the same in every fix: how straight the board was put in
    walk: float = 0.1  # m/s/sqrt(s), of the integrated specific force: vibration, scale errors
    floor_v: float = 0.1  # m/s: no fix's velocity is better
    good_tilt: float = math.radians(3.0)  # rad, largest sigma of a start
    good_yaw: float = math.radians(15.0)
    worst_chi2: float = 3.0  # per degree of freedom; more: samples and fixes do not belong together
    worst_bias: float = 4.0  # sigmas of what is known before; more: the answer is a wrong one


@dataclass(frozen=True)
class Level:
    """What a standstill told: the attitude of the window's first fix but for its heading, and the
    biases.
    """

    C_l0: Array  # (3, 3), body at the first fix to level axes l of any heading
    C_ls: Array  # (3, 3), body at the standstill to l
    mean_f: Array  # (3,) m/s^2 at the standstill
    bias_gyro: Array  # (3,) rad/s
    sigma_f: float = 0.1  # m/s^2, of gravity across the vertical: 0.6 deg, what gyros lose in turns
    sigma_gyro: float = math.radians(0.08)  # rad/s


@dataclass(frozen=True)
class MotionFix:
    """Velocity at one instant."""

    t: float  # s
    v_n: Array  # (3,) m/s
    sigma_v: Array  # (3,) m/s


@dataclass(frozen=True)
class MotionStart:
    """Attitude and biases at the window's last fix."""

    C_nb: Array  # (3, 3)
    bias_accel: Array  # (3,) m/s^2
    bias_gyro: Array  # (3,) rad/s
    P: Array  # (9, 9): psi_n, accelerometer bias, gyro bias, in the error state's sense
    chi2_per_dof: float
    strain: float = 0.0  # sigmas, of the worst bias, where no standstill told of it

    @property
    def sigma_tilt(self) -> float:
        """rad, the worse of the two."""
        return math.sqrt(max(self.P[0, 0], self.P[1, 1]))

    @property
    def sigma_yaw(self) -> float:
        """rad."""
        return math.sqrt(self.P[2, 2])


class MotionWindow:
    """Keeps samples and fixes of the last seconds and solves them."""

    def __init__(self, settings: MotionSettings, gravity: float = GRAVITY) -> None:
        """gravity in m/s^2, at the place."""
        self.settings = settings
        self._down = np.array([0.0, 0.0, gravity])
        self._samples: list[tuple[float, Array, Array]] = []
        self._fixes: list[MotionFix] = []

    @property
    def span(self) -> float:
        """s between the oldest and the newest fix kept."""
        return self._fixes[-1].t - self._fixes[0].t if self._fixes else 0.0

    def clear(self) -> None:
        """Forget everything."""
        self._samples, self._fixes = [], []

    def imu(self, t: float, f: Array, w: Array) -> None:
        """Keep a sample: s, (3,) m/s^2, (3,) rad/s."""
        self._samples.append((t, f, w))
        if t - self._samples[0][0] > 2.0 * self.settings.longest + 4.0:
            first = t - self.settings.longest - 4.0
            self._samples = [s for s in self._samples if s[0] >= first]

    def fix(self, t: float, v_n: Array, sigma_v: Array) -> None:
        """Keep a velocity; one that is older than the newest kept is not."""
        if (
            not self._samples
            or t <= self._samples[0][0]
            or (self._fixes and t <= self._fixes[-1].t)
        ):
            return
        self._fixes.append(
            MotionFix(t, np.asarray(v_n), np.maximum(sigma_v, self.settings.floor_v))
        )
        self._fixes = [f for f in self._fixes if t - f.t <= self.settings.longest]

    def drop_fixes(self) -> None:
        """Begin the window of fixes again: the vehicle went too slowly for its course to be its
        heading.
        """
        self._fixes = []

    @property
    def first(self) -> float:
        """s, time of the oldest fix kept; infinite before any."""
        return self._fixes[0].t if self._fixes else math.inf

    def solve(self, level: Level | None = None) -> MotionStart | None:
        """Attitude and biases at the newest fix (E-81 to E-84); None while the window is too
        short. `level` is what a standstill before it told.
        """
        s = self.settings
        if (
            len(self._fixes) < s.fixes
            or self.span < s.shortest
            or self._samples[-1][0] < self._fixes[-1].t
        ):
            return None
        problem = _Problem(s, self._down, self._samples, self._fixes, level)
        C0, theta = problem.first_guess()
        if level is not None or math.isfinite(s.sigma_slip):
            return self._from_guess(problem, C0, theta)
        # nothing says which way the nose points: a wrong quarter has a minimum of its own
        quarters = [product(euler_matrix(0.0, 0.0, k * math.pi / 2), C0) for k in range(4)]
        answers = [self._from_guess(problem, quarter, theta) for quarter in quarters]
        found = [a for a in answers if a is not None]
        return min(found, key=lambda a: a.chi2_per_dof) if found else None

    def _from_guess(self, problem: "_Problem", C0: Array, theta: Array) -> MotionStart | None:
        """Gauss-Newton from a guess; None where it does not come to an end."""
        for _ in range(6):
            r, J = problem.residuals(C0, theta), problem.jacobian(C0, theta)
            step = _normal(J, product(J.T, -r[:, None]))
            if step is None:
                return None
            step = step[:, 0]
            C0 = product(turn_matrix(step[PSI]), C0)
            theta = theta + np.concatenate([np.zeros(3), step[3:]])
            if norm(step[PSI]) < 1e-6:
                break
        r, J = problem.residuals(C0, theta), problem.jacobian(C0, theta)
        P = _normal(J, np.eye(UNKNOWNS))
        if P is None or not np.isfinite(r).all():
            return None
        return self._at_newest(problem, C0, theta, P, float(dot(r, r)) / max(1, len(r) - UNKNOWNS))

    def _at_newest(
        self, problem: "_Problem", C0: Array, theta: Array, P: Array, chi2: float
    ) -> MotionStart:
        """Carry attitude and its covariance to the last fix: psi_n there = psi_n - C_n0 (d phi / d
        bg) bg (E-84).
        """
        C_0k, _ = problem.motion(theta)
        carry = np.zeros((9, UNKNOWNS))
        carry[0:3, PSI] = carry[3:6, BA] = carry[6:9, BG] = np.eye(3)
        for j in range(3):
            d = theta.copy()
            d[9 + j] += STEP[9]
            phi = rotation_vector(product(problem.motion(d)[0][-1], C_0k[-1].T))
            carry[0:3, 9 + j] = applied(C0, phi) / STEP[9]
        P9 = product(product(carry, P), carry.T) * max(1.0, chi2)
        s = self.settings
        P9[2, 2] += s.sigma_mount**2 if math.isfinite(s.sigma_slip) else 0.0
        strain = 0.0
        if problem.level is None:
            strain = float(np.abs(np.concatenate(problem.prior(C0, theta))).max())
        return MotionStart(
            product(C0, C_0k[-1]), theta[BA].copy(), theta[BG].copy(), P9, chi2, strain
        )


def _normal(J: Array, right: Array) -> Array | None:
    """X with J^T J X = right (UNKNOWNS, m); None where J (n, UNKNOWNS) does not tell."""
    try:
        return native.solve_positive(product(J.T, J), np.ascontiguousarray(right))
    except ValueError:
        return None


class _Problem:
    """Whitened residuals of one window; theta (12,) with its attitude part always zero, C0 carries
    it.
    """

    def __init__(
        self,
        s: MotionSettings,
        down: Array,
        samples: list,
        fixes: list[MotionFix],
        level: Level | None,
    ) -> None:
        self._s, self._down, self.level = s, down, level
        keep = [x for x in samples if x[0] > fixes[0].t]
        self._t = np.array([x[0] for x in keep])
        self._f, self._w = np.array([x[1] for x in keep]), np.array([x[2] for x in keep])
        self._times = np.array([fix.t for fix in fixes])
        self._v = np.array([fix.v_n for fix in fixes])
        passed = np.array([fix.t - fixes[0].t for fix in fixes])
        self._passed = passed
        self._sigma_v = np.sqrt(
            np.array([fix.sigma_v for fix in fixes]) ** 2 + (s.walk**2 * passed)[:, None]
        )

    def motion(self, theta: Array) -> tuple[Array, Array]:
        """C_0k (m, 3, 3) and u (m, 3), first row the window's start."""
        C, u = native.alignment.carried(
            self._t, self._f, self._w, self._times, theta[BA], theta[BG]
        )
        return np.concatenate([np.eye(3)[None], C]), np.concatenate([np.zeros((1, 3)), u])

    def first_guess(self) -> tuple[Array, Array]:
        """C_n0 with heading along the mean course and tilt from the mean force; no biases."""
        theta = np.zeros(UNKNOWNS)
        theta[V0] = self._v[0]
        if self.level is not None:
            theta[BG] = self.level.bias_gyro
        C, u = self.motion(theta)
        if self.level is not None:
            return self._turned_to_fit(self.level.C_l0, u), theta
        felt = (self._v[-1] - self._v[0]) - self._down * self._passed[-1]  # what u must be in n
        level = euler_matrix(0.0, 0.0, float(atan2(self._v[0, 1], self._v[0, 0])))
        a, b = _unit(applied(level.T, felt)), _unit(u[-1])
        axis, cosine = np.cross(b, a), dot(a, b)
        if norm(axis) < 1e-9:
            tilt = np.eye(3) if cosine > 0 else np.diag([1.0, -1.0, -1.0])
        else:
            tilt = turn_matrix(_unit(axis) * atan2(norm(axis), cosine))
        return product(level, tilt), theta

    def _turned_to_fit(self, C_l0: Array, u: Array) -> Array:
        """C_n0 of level axes turned so that what was felt, u (m, 3), fits the velocities best."""
        felt = applied(C_l0, u) + self._passed[:, None] * self._down
        a, b = felt - felt.mean(axis=0), self._v - self._v.mean(axis=0)
        sine = float((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum())
        cosine = float((a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1]).sum())
        return product(euler_matrix(0.0, 0.0, float(atan2(sine, cosine))), C_l0)

    def prior(self, C0: Array, theta: Array) -> list[Array]:
        """What is known before the window (E-83): the biases, and gravity across the vertical."""
        s, known = self._s, self.level
        if known is None:
            return [theta[BA] / s.sigma_accel, theta[BG] / s.sigma_gyro]
        f_n = applied(C0, applied(product(known.C_l0.T, known.C_ls), known.mean_f - theta[BA]))
        return [
            theta[BA] / s.sigma_accel,
            (theta[BG] - known.bias_gyro) / known.sigma_gyro,
            f_n[:2] / known.sigma_f,
        ]

    def residuals(self, C0: Array, theta: Array) -> Array:
        """Velocities, courses and what is known of the biases, each over its sigma (E-81 to
        E-83).
        """
        s = self._s
        C, u = self.motion(theta)
        v = theta[V0] + self._passed[:, None] * self._down + applied(C0, u)
        rows = [((v - self._v) / self._sigma_v).ravel(), *self.prior(C0, theta)]
        if math.isfinite(s.sigma_slip):
            speed = norm(self._v[:, :2])
            x_n = applied(C0, C[:, :, 0])
            angle = atan2(x_n[:, 1], x_n[:, 0]) - atan2(self._v[:, 1], self._v[:, 0])
            slip = self._sigma_v[:, 0] / np.maximum(speed, 1e-3)
            sigma = np.sqrt(s.sigma_slip**2 + slip * slip)
            rows.append((np.mod(angle + math.pi, 2.0 * math.pi) - math.pi) / sigma)
        return np.concatenate(rows)

    def jacobian(self, C0: Array, theta: Array) -> Array:
        """By central differences: twelve unknowns; the core integrates the samples."""
        columns = []
        for j in range(UNKNOWNS):
            d = np.zeros(UNKNOWNS)
            d[j] = STEP[j]
            plus, minus = product(turn_matrix([d[PSI], -d[PSI]]), C0)
            d[PSI] = 0.0
            plus, minus = self.residuals(plus, theta + d), self.residuals(minus, theta - d)
            columns.append((plus - minus) / (2.0 * STEP[j]))
        return np.column_stack(columns)


def _unit(v: Array) -> Array:
    return v / norm(v)
