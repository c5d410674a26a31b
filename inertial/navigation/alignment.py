"""Initial alignment: roll, pitch and gyro bias from standstill, heading from the course once the
vehicle moves.

A vehicle that never stands is aligned under way (alignment_motion.py). Equations E-115 and E-116 of
docs/equations-ins.md (inmotion-alignment, section 10).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from inertial.constants import GRAVITY
from inertial.core import native
from inertial.elementary import atan2, norm, product
from inertial.navigation.alignment_motion import Level, MotionStart, MotionWindow
from inertial.navigation.standstill import AlignmentSettings, Standstill
from inertial.rotation import euler_angles, euler_matrix, roll_pitch

Array = NDArray[np.float64]

UNTESTED = 3.0  # factor on the sigma of a course that nothing felt confirms


@dataclass(frozen=True)
class Start:
    """What alignment found, at the instant of the fix it was asked for."""

    C_nb: Array  # (3, 3)
    bias_gyro: Array  # (3,) rad/s
    bias_accel: Array  # (3,) m/s^2
    P: (
        Array | None
    )  # (9, 9) psi_n, accelerometer bias, gyro bias; None: as configured for a levelled start
    how: str  # for people
    sigma_yaw: float | None = None  # rad, with P None; None: as configured
    # (3,) m/s and its sigma at the fix, where the fix itself has none
    v_n: Array | None = None
    sigma_v: Array | None = None


class Alignment:
    """Takes samples and speeds until C_nb but for its heading, and the gyro bias, are known; then
    keeps them by gyro.

    A later standstill levels again, so that a long wait before the drive costs nothing. A
    standstill during which the board moves is not used: it begins again, and `text` says why.
    """

    def __init__(self, settings: AlignmentSettings) -> None:
        self.settings = settings
        self.levelled = False
        self.C = np.eye(3)  # C_nb with heading counted from an arbitrary start
        self.gyro_bias = np.zeros(3)  # rad/s, contains the Earth's rate, which a MEMS gyro hides
        self.mean_f = np.array([0.0, 0.0, -9.8])
        self._way = "waiting for samples"
        self._window = MotionWindow(settings.motion)  # fixes above course_speed
        self._felt = MotionWindow(replace(settings.motion, sigma_slip=math.inf))  # all of them
        self._C_still = np.eye(3)  # C at the last standstill
        self._f_still = self.mean_f  # m/s^2, what was felt there
        self._moving_since: float | None = None
        self._fast_since: float | None = None  # s, above course_speed
        self._resumed = False  # the heading was known before samples went missing
        self._sigma_v = 0.0  # m/s, level, of the newest velocity
        self._speed = 0.0  # m/s, likewise
        self._now = 0.0  # s, of it
        self._felt_at = -math.inf  # s, when the felt heading was looked for last
        self._felt_yaw = math.pi  # rad, sigma of the heading felt in motion
        self._t: float | None = None
        self._standstill = Standstill(settings)

    def imu(self, t: float, f: Array, w: Array) -> None:
        """One sample: time s, specific force (3,) m/s^2, rate (3,) rad/s."""
        if self._t is not None and t - self._t > self.settings.longest_gap:
            self._interrupt(f"{t - self._t:.1f} s without samples")
            self._forget()
            self._t = None  # how it turned meanwhile nobody saw: one rate must not stand for it
        if self._t is not None and self.levelled:
            self.C = native.rotation.turned(self.C, (w - self.gyro_bias) * (t - self._t))
        self._t = t
        if self.settings.in_motion:
            self._felt.imu(t, f, w)
            if not self.levelled:
                self._window.imu(t, f, w)
        told = self._standstill.imu(t, f, w)
        if told is not None:
            self.mean_f, self.gyro_bias = told
            self.C = euler_matrix(*roll_pitch(self.mean_f), euler_angles(self.C)[2])
            self.levelled, self._resumed = True, False
            self._C_still, self._f_still = self.C, self.mean_f
            self._window.clear()

    @property
    def still_s(self) -> float:
        """s of the standstill that lasts now."""
        return self._standstill.seconds

    def _interrupt(self, why: str) -> None:
        self._standstill.interrupt(why, tell=not self.levelled)

    def resume(self, C_nb: Array, gyro_bias: Array) -> None:
        """Go on from an attitude and a gyro bias that a filter knew before samples went missing.

        The time since then is not this attitude's to turn by.
        """
        self.C, self.gyro_bias, self.levelled = C_nb, gyro_bias, True
        self._C_still, self._f_still = np.eye(3), np.array([0.0, 0.0, -GRAVITY])  # as if level
        self._interrupt("samples were missing")
        self._forget()
        self._resumed = True
        self._t = None

    def speed(self, speed: float) -> None:
        """Speed by GNSS, m/s: a smooth motorway must not pass for a standstill."""
        if speed > self.settings.still_speed:
            self._interrupt(f"moving at {speed:.1f} m/s by GNSS")

    def fix(self, t: float, v_n: Array, sigma_v: Array) -> None:
        """Velocity (3,) m/s of the fix at time t, with its sigma: for standstill, course and the
        start under way.
        """
        speed = float(norm(v_n[:2]))
        self._sigma_v = float(norm(np.asarray(sigma_v)[:2])) / math.sqrt(2.0)
        self.speed(speed - self._sigma_v)
        if speed < self.settings.still_speed + self._sigma_v:
            self._moving_since = None
        elif self._moving_since is None:
            self._moving_since = t
        self._now, self._speed = t, speed
        if speed < self.settings.course_speed:
            self._fast_since = None
        elif self._fast_since is None:
            self._fast_since = t
        if not self.settings.in_motion:
            return
        self._felt.fix(t, v_n, sigma_v)
        if self.levelled:
            return
        if speed < self.settings.course_speed:
            self._window.drop_fixes()
        else:
            self._window.fix(t, v_n, sigma_v)

    def start(
        self, C_then: Array, v_n: Array, turned_back: Callable[[float], Array] | None = None
    ) -> Start | None:
        """The start at the fix given last, C_then being C at its time, turned_back(t) C at t; None
        as long as `text` says.
        """
        if not self.settings.in_motion:
            return self._start_by_course(C_then, v_n, None) if self.levelled else None
        felt = self._feel(turned_back)
        if self.levelled:
            by_course = self._start_by_course(C_then, v_n, felt)
            return by_course if by_course is not None else self._start_by_feeling(felt, v_n)
        return self._start_in_motion(felt) or self._start_by_feeling(felt, v_n)

    def _feel(self, turned_back: Callable[[float], Array] | None) -> MotionStart | None:
        """The heading without the course: what the accelerometers felt against the velocities'
        changes. None where they do not tell.
        """
        if self._moving_since is None or self._felt.first == math.inf:
            return None
        slow = self._speed < self.settings.course_speed
        if slow and self._now < self._felt_at + self.settings.look:
            return None  # a look costs as much as seconds of navigation
        self._felt_at = self._now
        level = None
        if self.levelled:
            if turned_back is None:
                return None
            level = Level(
                turned_back(self._felt.first), self._C_still, self._f_still, self.gyro_bias
            )
        found = self._felt.solve(level)
        return found if found is not None and self._good(found) else None

    def _good(self, found: MotionStart) -> bool:
        m = self.settings.motion
        self._felt_yaw = found.sigma_yaw
        return (
            found.chi2_per_dof <= m.worst_chi2
            and found.strain <= m.worst_bias
            and found.sigma_tilt <= m.good_tilt
            and found.sigma_yaw <= m.good_yaw
        )

    def _start_by_course(self, C_then: Array, v_n: Array, felt: MotionStart | None) -> Start | None:
        s = self.settings
        speed = float(norm(v_n[:2]))
        C_nb = self.heading(C_then, v_n)
        sigma = math.hypot(s.sigma_course, self._sigma_v / max(speed, 1e-3))
        if C_nb is None or sigma > s.motion.good_yaw:
            known = math.degrees(min(self._felt_yaw, math.pi))
            self._way = (
                f"level; moving at {speed:.1f} m/s, heading known to {known:.0f} of"
                f" {math.degrees(s.motion.good_yaw):.0f} deg: drive faster than"
                f" {s.course_speed:g} m/s, or speed up, brake and turn"
                if self._moving_since is not None
                else f"level; drive faster than {s.course_speed:g} m/s to find the heading"
            )
            return None
        if felt is not None:
            turn = product(C_nb, felt.C_nb.T)
            apart = abs(float(atan2(turn[1, 0] - turn[0, 1], turn[0, 0] + turn[1, 1])))
            if apart > s.disagree * math.hypot(felt.sigma_yaw, sigma):
                return self._from_feeling(
                    felt, f"; the course is {math.degrees(apart):.0f} deg off it: no car's"
                )
        how = "levelled at standstill, heading from the course"
        if felt is None and s.in_motion and not self._resumed:
            if self._fast_since is not None and self._now - self._fast_since < s.patience:
                self._way = (
                    "level; the course is to be the heading, and what is felt does not tell yet"
                )
                return None
            wide = UNTESTED * sigma
            how += f", which nothing has tested: believed to {math.degrees(wide):.0f} deg"
            return Start(C_nb, self.gyro_bias, np.zeros(3), None, how, sigma_yaw=wide)
        noisy = self._sigma_v / speed > 0.5 * s.sigma_course
        return Start(
            C_nb, self.gyro_bias, np.zeros(3), None, how, sigma_yaw=sigma if noisy else None
        )

    def _start_by_feeling(self, felt: MotionStart | None, v_n: Array) -> Start | None:
        """For what never comes up to course_speed: a walker, a boat."""
        s = self.settings
        if self._moving_since is None or self._now - self._moving_since < s.patience:
            return None
        if felt is None or norm(v_n[:2]) >= s.course_speed:
            return None
        return self._from_feeling(felt, "")

    def _from_feeling(self, felt: MotionStart, more: str) -> Start:
        tilt, yaw = math.degrees(felt.sigma_tilt), math.degrees(felt.sigma_yaw)
        how = f"heading from what was felt in motion, to {yaw:.1f} deg, tilt to {tilt:.1f} deg"
        return Start(felt.C_nb, felt.bias_gyro, felt.bias_accel, felt.P, how + more)

    def _start_in_motion(self, felt: MotionStart | None) -> Start | None:
        m = self.settings.motion
        found = self._window.solve()
        if found is None:
            known = math.degrees(min(self._felt_yaw, math.pi))
            self._way = (
                f"moving: {self._window.span:.0f} of {m.shortest:g} s above"
                f" {self.settings.course_speed:g} m/s; heading known to {known:.0f} of"
                f" {math.degrees(m.good_yaw):.0f} deg without them"
            )
            return None
        tilt, yaw = math.degrees(found.sigma_tilt), math.degrees(found.sigma_yaw)
        if found.chi2_per_dof > m.worst_chi2:
            self._way = (
                f"moving: samples and fixes disagree (chi2 {found.chi2_per_dof:.1f} per degree of"
                " freedom)"
            )
            return self._no_car(felt)
        if found.strain > m.worst_bias:
            self._way = (
                f"moving: with the course as heading the sensors' biases would be"
                f" {found.strain:.0f} sigmas off: not a car's course?"
            )
            return self._no_car(felt)
        if found.sigma_tilt > m.good_tilt or found.sigma_yaw > m.good_yaw:
            self._way = (
                f"moving: tilt known to {tilt:.1f} deg, heading to {yaw:.1f} deg, not enough yet"
            )
            return None
        how = (
            f"aligned in motion over {self._window.span:.0f} s: tilt to {tilt:.1f} deg, heading to"
            f" {yaw:.1f} deg"
        )
        return Start(found.C_nb, found.bias_gyro, found.bias_accel, found.P, how)

    def _no_car(self, felt: MotionStart | None) -> Start | None:
        """What was felt, where the course as heading contradicts the samples."""
        return None if felt is None else self._from_feeling(felt, "; the course is no car's")

    def _forget(self) -> None:
        self._window.clear()
        self._felt.clear()
        self._moving_since = None
        self._felt_yaw = math.pi

    @property
    def text(self) -> str:
        """For people: what the alignment does or waits for."""
        s = self.settings
        if self.levelled:
            return (
                self._way
                if self._way.startswith("level")
                else "level; waiting for speed to find the heading"
            )
        still = f"levelling: still for {self.still_s:.0f} of {s.standstill:g} s"
        if self.still_s == 0.0:
            still = f"stand still for {s.standstill:g} s"
        if self._standstill.disturbed:
            still += f"; begun again: {self._standstill.disturbed}"
        moving = self._moving_since is not None
        return self._way if self._way.startswith("moving") and moving else still

    def heading(self, C_then: Array, v_n: Array) -> Array | None:
        """C_nb (3, 3) with the heading of the course v_n (3,); C_then is C at that time. None: too
        slow (E-116).
        """
        if not self.levelled or norm(v_n[:2]) < self.settings.course_speed:
            return None
        roll, pitch, _ = euler_angles(C_then)
        return euler_matrix(roll, pitch, atan2(v_n[1], v_n[0]))
