"""A cube of accelerometers on a tilted turning table, sample by sample, with the truth beside it.

The physics does not use the estimators' equations: every sensor's position in n is written down as
a function of the table's angle, differentiated twice by hand, and gravity is subtracted.

Frames: n is north-east-down and taken as inertial (Earth's rate, 15 deg/h, is far below these
sensors). The table's axis points up, tilted by `tilt` about north; the body's z is that axis, so a
cube at rest reads +1 g on z as in the paper, and q_nb at angle 0 without tilt is the half turn
about north (x_b north, y_b west, z_b up). Angles and rates are positive about z_b; the published
test begins clockwise seen from above, which is negative.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inertial.constants import GRAVITY, MILLI_G
from inertial.layouts.catalogue import CUBE
from inertial.layouts.layout import Layout
from inertial.simulation.profiles import DEGREE, Profile, named

Array = NDArray[np.float64]

COUNT = 3.9 * MILLI_G  # m/s^2 per count, ADXL345 full resolution
COUNTS = (-4096, 4095)  # 13 bit, +-16 g
BLOCK = 1000  # samples generated at once; part of what a seed means


class Truth(NamedTuple):
    """What is really the case at one sample."""

    q_nb: Array  # (4,) w x y z
    omega_ib_b: Array  # (3,) rad/s
    alpha_b: Array  # (3,) rad/s^2
    f_b: Array  # (3,) m/s^2, specific force of the cube's centre
    angle_z: float  # rad, since the start
    profile_time_s: float  # s, since the profile began


class Sample(NamedTuple):
    """One reading of all axes."""

    t_s: float  # s since the start, grows without end
    counts: NDArray[np.int64]  # (12,)
    truth: Truth


class Pulse(NamedTuple):
    """One edge of the tachometer."""

    t_s: float
    direction: int  # +1 positive about z_b, -1 negative


@dataclass(frozen=True)
class SensorModel:
    """ADXL345; sigmas of what is drawn once per seed, and of the noise of each sample. m/s^2 where
    not said.
    """

    noise: float = 4.0 * MILLI_G
    bias: float = 20.0 * MILLI_G
    scale_error: float = 0.005  # of 1
    count: float = COUNT  # per count; 0 reads without quantisation or saturation


IDEAL = SensorModel(noise=0.0, bias=0.0, scale_error=0.0, count=0.0)


@dataclass(frozen=True)
class Block:
    """Consecutive samples; arrays over the first axis. readings in m/s^2 at nominal scale."""

    index: int
    t_s: Array
    counts: NDArray[np.int64]  # (n, N); zeros for a sensor model without counts
    readings: Array  # (n, N) m/s^2
    q_nb: Array
    omega_b: Array
    alpha_b: Array
    f_b: Array
    angle_z: Array
    profile_time_s: Array

    def truth(self, row: int) -> Truth:
        """Truth of one row."""
        return Truth(
            self.q_nb[row],
            self.omega_b[row],
            self.alpha_b[row],
            self.f_b[row],
            float(self.angle_z[row]),
            float(self.profile_time_s[row]),
        )


class TableTest:
    """The published test and its relatives: an endless, repeatable row of samples for one seed."""

    def __init__(
        self,
        seed: int = 1,
        half_side: float = 0.05,
        profile: str | Profile = "published",
        rate_hz: float = 100.0,
        tilt: float = 2.0 * DEGREE,
        sensor: SensorModel = SensorModel(),
        centre_b: tuple[float, float, float] = (0.0, 0.0, 0.0),
        pulses_per_rev: int = 360,
        layout: Layout | None = None,
        run: int = 0,
    ) -> None:
        """half_side in m, tilt in rad, centre_b (m) from the table's axis to the body's centre.
        `run` draws other noise for the same sensors.

        Raises ValueError for a profile that there is not or a rate that is not positive.
        """
        if not rate_hz > 0.0:
            raise ValueError(f"sample rate {rate_hz} Hz, want more than 0")
        self.profile = named(profile) if isinstance(profile, str) else profile
        self.layout = layout if layout is not None else CUBE(half_side)
        self.period_s = 1.0 / rate_hz
        self.pulses_per_rev = pulses_per_rev
        self.sensor = sensor
        self._rate_hz = rate_hz
        self._seed = seed
        self.run = run
        self._run = [run] if run else []
        self._tilt = tilt
        self._arms = self.layout.r_b + np.asarray(centre_b)
        self._centre = self.centre_b = np.asarray(centre_b, dtype=np.float64)  # m, (3,)
        draw = np.random.default_rng([seed, 0])
        self.bias = draw.normal(0.0, 1.0, self.layout.axes) * sensor.bias  # m/s^2, (N,)
        self.scale = 1.0 + draw.normal(0.0, 1.0, self.layout.axes) * sensor.scale_error

    def __iter__(self) -> Iterator[Sample]:
        """Samples 0, 1, 2 ... without end."""
        block = 0
        while True:
            samples = self.block(block)
            for row in range(BLOCK):
                yield Sample(float(samples.t_s[row]), samples.counts[row], samples.truth(row))
            block += 1

    def block(self, number: int) -> Block:
        """Samples number * BLOCK .. (number + 1) * BLOCK - 1."""
        index = number * BLOCK
        t = (index + np.arange(BLOCK)) / self._rate_hz
        angle, rate, acceleration = self.profile.motion(t)
        C_nb, C2_nb = self._attitude(angle, rate, acceleration)
        felt_b = self._felt(C_nb, C2_nb, self._arms)
        counts, readings = self._read(number, np.einsum("tki,ki->tk", felt_b, self.layout.theta_b))
        z = np.zeros(BLOCK)
        return Block(
            index=index,
            t_s=t,
            counts=counts,
            readings=readings,
            q_nb=self._quaternion(angle),
            omega_b=np.column_stack([z, z, rate]),
            alpha_b=np.column_stack([z, z, acceleration]),
            f_b=self._felt(C_nb, C2_nb, self._centre[None, :])[:, 0, :],
            angle_z=angle,
            profile_time_s=np.mod(t, self.profile.seconds),
        )

    def pulses(self, start_s: float, end_s: float) -> list[Pulse]:
        """Tachometer edges with start_s < t <= end_s, in order."""
        pitch = 2.0 * np.pi / self.pulses_per_rev
        step = 0.25 * pitch / max(self.profile.max_rate, 1e-3)
        n = max(2, int(np.ceil((end_s - start_s) / min(step, 0.01))) + 1)
        t = np.linspace(start_s, end_s, n)
        angle = self.profile.motion(t)[0]
        slot = np.floor(
            angle / pitch + 0.5
        )  # edges lie half a pitch off, so that a table at rest sits on none
        at = np.nonzero(np.diff(slot))[0]
        edge = (np.maximum(slot[at], slot[at + 1]) - 0.5) * pitch
        low, high = t[at], t[at + 1]
        rising = angle[at + 1] > angle[at]
        for _ in range(40):  # bisection: safe where the table stops on an edge
            middle = 0.5 * (low + high)
            before = (self.profile.motion(middle)[0] < edge) == rising
            low, high = np.where(before, middle, low), np.where(before, high, middle)
        return [Pulse(float(s), 1 if up else -1) for s, up in zip(high, rising, strict=True)]

    def felt(self, t_s: Array, axes: slice = slice(None)) -> Array:
        """What axes read at any times t_s (n,): (n, axes) m/s^2, bias and scale errors in it, no
        noise, no counts.
        """
        C_nb, C2_nb = self._attitude(*self.profile.motion(t_s))
        felt_b = self._felt(C_nb, C2_nb, self._arms[axes])
        return (
            np.einsum("tki,ki->tk", felt_b, self.layout.theta_b[axes]) * self.scale[axes]
            + self.bias[axes]
        )

    def truths(self, t_s: Array) -> list[Truth]:
        """The truth at any times t_s (n,)."""
        angle, rate, acceleration = self.profile.motion(t_s)
        C_nb, C2_nb = self._attitude(angle, rate, acceleration)
        q_nb, f_b = self._quaternion(angle), self._felt(C_nb, C2_nb, self._centre[None, :])[:, 0, :]
        z, into = np.zeros(len(t_s)), np.mod(t_s, self.profile.seconds)
        omega_b, alpha_b = np.column_stack([z, z, rate]), np.column_stack([z, z, acceleration])
        return [
            Truth(q, w, a, f, float(g), float(p))
            for q, w, a, f, g, p in zip(q_nb, omega_b, alpha_b, f_b, angle, into, strict=True)
        ]

    def _attitude(self, angle: Array, rate: Array, acceleration: Array) -> tuple[Array, Array]:
        """C_nb (n, 3, 3) and its second time derivative, from cos and sin of the angle and their
        derivatives.
        """
        c, s = np.cos(angle), np.sin(angle)
        c2 = -s * acceleration - c * rate**2
        s2 = c * acceleration - s * rate**2
        table = self._table()
        turn = np.zeros((len(angle), 3, 3))
        turn[:, 0, 0], turn[:, 0, 1], turn[:, 1, 0], turn[:, 1, 1], turn[:, 2, 2] = c, -s, s, c, 1.0
        turn2 = np.zeros_like(turn)
        turn2[:, 0, 0], turn2[:, 0, 1], turn2[:, 1, 0], turn2[:, 1, 1] = c2, -s2, s2, c2
        return table @ turn, table @ turn2

    def _table(self) -> Array:
        """C_nt: table frame (z along its axis, up) to n; tilt turns it about north."""
        c, s = np.cos(self._tilt), np.sin(self._tilt)
        return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]]) @ np.diag([1.0, -1.0, -1.0])

    def _quaternion(self, angle: Array) -> Array:
        """q_nb = tilt about x, half turn about x, angle about z; w, x, y, z."""
        half = 0.5 * (self._tilt + np.pi)
        c, s = np.cos(half), np.sin(half)
        cz, sz = np.cos(0.5 * angle), np.sin(0.5 * angle)
        return np.column_stack([c * cz, s * cz, -s * sz, c * sz])

    def _felt(self, C_nb: Array, C2_nb: Array, arms_b: Array) -> Array:
        """Specific force in b, (n, points, 3), of points arms_b (points, 3) from the table's
        axis.
        """
        up = np.array([0.0, 0.0, -GRAVITY])  # -g_n
        felt_n = np.einsum("tij,kj->tki", C2_nb, arms_b) + up
        return np.einsum("tji,tkj->tki", C_nb, felt_n)

    def _read(self, number: int, f_axis: Array) -> tuple[NDArray[np.int64], Array]:
        draw = np.random.default_rng([self._seed, 1, number, *self._run])
        noise = draw.normal(0.0, 1.0, f_axis.shape) * self.sensor.noise
        read = f_axis * self.scale + self.bias + noise
        if self.sensor.count == 0.0:
            return np.zeros(read.shape, dtype=np.int64), read
        counts = np.clip(np.rint(read / self.sensor.count), *COUNTS).astype(np.int64)
        return counts, counts * self.sensor.count
