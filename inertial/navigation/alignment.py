"""Initial alignment: roll, pitch and gyro bias from standstill, heading from the course once the
vehicle moves.

A vehicle that never stands is aligned under way (alignment_motion.py). Equations E-35 and E-36 of
docs/equations-ins.md (inmotion-alignment, section 10).
"""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from inertial.core import native
from inertial.elementary import atan2, norm
from inertial.navigation.alignment_motion import MotionSettings, MotionWindow
from inertial.rotation import euler_angles, euler_matrix, roll_pitch

Array = NDArray[np.float64]


@dataclass(frozen=True)
class AlignmentSettings:
    """When a vehicle counts as standing, and as moving fast enough for its course to be its
    heading.
    """

    standstill: float = 10.0  # s of it, at least
    block: float = 1.0  # s, judged as a whole
    still_f: float = (
        0.35  # m/s^2, largest standard deviation of an axis in a block: idling engine passes
    )
    still_w: float = math.radians(6.0)  # rad/s, the same for rates
    turn_w: float = math.radians(
        0.5
    )  # rad/s, largest change of a block's mean rate: slow turns are no standstill
    tilt_f: float = 0.15  # m/s^2, largest change of a block's mean force
    bias_w: float = math.radians(
        8.0
    )  # rad/s, largest rate that can be a gyro's bias: more is a steady turn
    # m/s^2, largest difference from 1 g that can be an accelerometer's: more is acceleration
    bias_f: float = 0.6
    still_speed: float = 0.5  # m/s by GNSS, above which nothing is a standstill
    course_speed: float = 4.0  # m/s, the course is the heading above it
    longest_gap: float = 0.3  # s without samples, after which the standstill starts again
    in_motion: bool = True  # a vehicle that never stands is aligned under way
    motion: MotionSettings = field(default_factory=MotionSettings)


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
        self.still_s = 0.0  # s of the standstill that lasts now
        self._disturbed = ""  # what ended the last standstill, for people
        self._way = "waiting for samples"
        self._window = MotionWindow(settings.motion)
        self._t: float | None = None
        self._block: list[tuple[Array, Array]] = []
        self._block_start = 0.0
        self._sum_f = np.zeros(3)
        self._sum_w = np.zeros(3)
        self._count = 0

    def imu(self, t: float, f: Array, w: Array) -> None:
        """One sample: time s, specific force (3,) m/s^2, rate (3,) rad/s."""
        if self._t is not None and t - self._t > self.settings.longest_gap:
            self._interrupt(f"{t - self._t:.1f} s without samples")
            self._window.clear()
            self._t = None  # how it turned meanwhile nobody saw: one rate must not stand for it
        if self._t is not None and self.levelled:
            self.C = native.rotation.turned(self.C, (w - self.gyro_bias) * (t - self._t))
        self._t = t
        if self.settings.in_motion and not self.levelled:
            self._window.imu(t, f, w)
        if not self._block:
            self._block_start = t
        self._block.append((f, w))
        if t - self._block_start >= self.settings.block:
            self._judge(t - self._block_start)

    def resume(self, C_nb: Array, gyro_bias: Array) -> None:
        """Go on from an attitude and a gyro bias that a filter knew before samples went missing.

        The time since then is not this attitude's to turn by.
        """
        self.C, self.gyro_bias, self.levelled = C_nb, gyro_bias, True
        self._interrupt("samples were missing")
        self._window.clear()
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
        self.speed(speed)
        if not self.settings.in_motion or self.levelled:
            return
        if speed < self.settings.course_speed:
            self._window.drop_fixes()
        else:
            self._window.fix(t, v_n, sigma_v)

    def start(self, C_then: Array, v_n: Array) -> Start | None:
        """The start at the fix given last, C_then being C at its time; None as long as `text`
        says.
        """
        if self.levelled:
            C_nb = self.heading(C_then, v_n)
            if C_nb is None:
                self._way = (
                    f"level; drive faster than {self.settings.course_speed:g} m/s to find the"
                    " heading"
                )
                return None
            return Start(
                C_nb,
                self.gyro_bias,
                np.zeros(3),
                None,
                "levelled at standstill, heading from the course",
            )
        return self._start_in_motion() if self.settings.in_motion else None

    def _start_in_motion(self) -> Start | None:
        m = self.settings.motion
        found = self._window.solve()
        if found is None:
            self._way = (
                f"moving: {self._window.span:.0f} of {m.shortest:g} s above"
                f" {self.settings.course_speed:g} m/s"
            )
            return None
        tilt, yaw = math.degrees(found.sigma_tilt), math.degrees(found.sigma_yaw)
        if found.chi2_per_dof > m.worst_chi2:
            self._way = (
                f"moving: samples and fixes disagree (chi2 {found.chi2_per_dof:.1f} per degree of"
                " freedom)"
            )
            return None
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
        if self._disturbed:
            still += f"; begun again: {self._disturbed}"
        return self._way if self._way.startswith("moving") and self._window.span > 0.0 else still

    def heading(self, C_then: Array, v_n: Array) -> Array | None:
        """C_nb (3, 3) with the heading of the course v_n (3,); C_then is C at that time. None: too
        slow (E-36).
        """
        if not self.levelled or norm(v_n[:2]) < self.settings.course_speed:
            return None
        roll, pitch, _ = euler_angles(C_then)
        return euler_matrix(roll, pitch, atan2(v_n[1], v_n[0]))

    def _judge(self, length: float) -> None:
        f = np.array([sample[0] for sample in self._block])
        w = np.array([sample[1] for sample in self._block])
        self._block = []
        s = self.settings
        moved = self._movement(f, w)
        if moved:
            self._interrupt(moved)
            return
        self._sum_f += f.sum(axis=0)
        self._sum_w += w.sum(axis=0)
        self._count += len(f)
        self.still_s += length
        if self.still_s >= s.standstill:
            self.mean_f = self._sum_f / self._count
            self.gyro_bias = self._sum_w / self._count
            self.C = euler_matrix(*roll_pitch(self.mean_f), euler_angles(self.C)[2])
            self.levelled = True
            self._disturbed = ""
            self._window.clear()

    def _movement(self, f: Array, w: Array) -> str:
        """What speaks against a standstill in a block of samples (n, 3), in words; empty when
        nothing does.
        """
        s = self.settings
        if f.std(axis=0).max() >= s.still_f:
            return f"the board shakes by {f.std(axis=0).max():.2f} m/s^2"
        if w.std(axis=0).max() >= s.still_w:
            return f"the board shakes by {math.degrees(w.std(axis=0).max()):.1f} deg/s"
        size = float(norm(f.mean(axis=0)))
        if abs(size - 9.81) > s.bias_f:
            return f"the board feels {size:.2f} m/s^2, which is not 1 g"
        if np.abs(w.mean(axis=0)).max() > s.bias_w:
            return (
                f"the board turns steadily ({math.degrees(np.abs(w.mean(axis=0)).max()):.1f} deg/s)"
            )
        if self._count:
            tilted = np.abs(f.mean(axis=0) - self._sum_f / self._count).max()
            turned = np.abs(w.mean(axis=0) - self._sum_w / self._count).max()
            if tilted >= s.tilt_f:
                return f"the board tilted or was pushed ({tilted:.2f} m/s^2)"
            if turned >= s.turn_w:
                return f"the board turned ({math.degrees(turned):.1f} deg/s)"
        return ""

    def _interrupt(self, why: str) -> None:
        if self.still_s > 0.0 and not self.levelled:
            self._disturbed = f"{why} after {self.still_s:.0f} s"
        self._block = []
        self._sum_f = np.zeros(3)
        self._sum_w = np.zeros(3)
        self._count = 0
        self.still_s = 0.0
