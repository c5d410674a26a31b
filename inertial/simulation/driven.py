"""A simulated table that is driven: it follows a commanded rate with limited acceleration, and its
cube can be turned over onto another face while it stands.

Frames as in table.py; t is the table's frame, which is b as long as nobody turns the cube over.
Within a sample's period the table's acceleration is constant.
"""

import threading

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from inertial.simulation.profiles import DEGREE
from inertial.simulation.table import Block, Pulse, TableTest

Array = NDArray[np.float64]

LIMIT = 720.0 * DEGREE  # rad/s
ACCELERATION = 200.0 * DEGREE  # rad/s^2
OVER_S = 1.5  # s that it takes to turn the cube over
BLOCKS_FROM = 1_000_000  # noise of driven blocks is drawn apart from that of profiles


class DrivenTable(TableTest):
    """TableTest whose motion is what set_rate, stop and turn_over ask for; step() makes samples.
    The orders may come from any thread.
    """

    def __init__(
        self,
        *arguments,
        limit: float = LIMIT,
        acceleration: float = ACCELERATION,
        start: tuple[int, float, float] = (0, 0.0, 0.0),
        **options,
    ) -> None:
        """limit (rad/s), acceleration (rad/s^2): of the drive. start: sample index, angle (rad) and
        rate (rad/s) that the motion goes on from. Else as TableTest.
        """
        super().__init__(*arguments, **options)
        self.limit, self.acceleration = limit, acceleration
        self._index, self._angle, self._rate = start
        self._target, self._ramp = 0.0, acceleration
        self._blocks = BLOCKS_FROM
        self._tb, self._over = Rotation.identity(), np.zeros(3)  # b to t; rotation vector in b
        self._over_at = self._over_length = 0  # samples
        self._lock = threading.Lock()

    # --- orders

    def set_rate(self, omega: float, acceleration: float | None = None) -> None:
        """Turn at omega (rad/s), reached with at most that acceleration (rad/s^2); raises
        ValueError beyond what the drive can.
        """
        if not abs(omega) <= self.limit:
            raise ValueError(f"{omega / DEGREE:g} °/s: at most {self.limit / DEGREE:g}")
        if acceleration is not None and not 0.0 < acceleration <= self.acceleration:
            most = self.acceleration / DEGREE
            raise ValueError(f"{acceleration / DEGREE:g} °/s^2: want 0 to {most:g}")
        with self._lock:
            self._target = omega
            self._ramp = self.acceleration if acceleration is None else acceleration

    def rate(self) -> float:
        """What it turns at, rad/s."""
        return self._rate

    def stop(self) -> None:
        """Stand as soon as the drive can."""
        self.set_rate(0.0)

    @property
    def standing(self) -> bool:
        """It does not turn, nothing is wanted of it and nobody has a hand on the cube."""
        return self._rate == 0.0 and self._target == 0.0 and self._over_at >= self._over_length

    def turn_over(self, up_b: Array) -> bool:
        """Turn the cube so that direction up_b (3,) of it points along the table's axis, by the
        shortest way; False while the table turns or a hand is at it.
        """
        up_b = np.asarray(up_b, dtype=float) / np.linalg.norm(up_b)
        with self._lock:
            now_b = self._tb.inv().apply([0.0, 0.0, 1.0])
            if not self.standing:
                return False
            if float(now_b @ up_b) > 1.0 - 1e-9:
                return True
            # Turning b by R about an axis of b takes what was up, now_b, to R^-1 now_b.
            axis = np.cross(up_b, now_b)
            if np.linalg.norm(axis) < 1e-9:
                axis = np.cross(now_b, np.eye(3)[int(np.argmin(np.abs(now_b)))])
            angle = float(np.arccos(np.clip(now_b @ up_b, -1.0, 1.0)))
            self._over = angle * axis / np.linalg.norm(axis)
            self._over_at, self._over_length = 0, round(OVER_S / self.period_s)
        return True

    # --- motion

    def step(self, n: int) -> tuple[Block, list[Pulse]]:
        """The next n samples, and the edges of the tachometer up to the period after the last."""
        dt = self.period_s
        rows, poses, pulses = np.zeros((n, 3)), np.zeros((n, 3)), []
        for k in range(n):
            with self._lock:
                poses[k] = self._hand()
                a = self._drive()
            rows[k] = self._angle, self._rate, a
            pulses += self._edges((self._index + k) * dt, a)
            self._angle += self._rate * dt + 0.5 * a * dt**2
            self._rate += a * dt
            if abs(self._rate) < 1e-12:
                self._rate = 0.0
        made = self._block(rows, poses)
        if n and self._over_length and self._over_at >= self._over_length:
            self._tb = self._tb * Rotation.from_rotvec(self._over)
            self._over, self._over_at, self._over_length = np.zeros(3), 0, 0
        self._index += n
        return made, pulses

    def _drive(self) -> float:
        """Acceleration of the next period: towards the target, through zero with a stop on it."""
        turning_over = self._over_at < self._over_length
        target = 0.0 if turning_over else self._target
        if self._rate * target < 0.0:
            target = 0.0
        want = (target - self._rate) / self.period_s
        return float(np.clip(want, -self._ramp, self._ramp))

    def _hand(self) -> tuple[float, float, float]:
        """Share of a turning over done, its first and second derivative, at this sample."""
        if not self._over_length:
            return 0.0, 0.0, 0.0
        seconds, x = self._over_length * self.period_s, min(1.0, self._over_at / self._over_length)
        self._over_at += 1
        first = 30.0 * x**2 * (1.0 - x) ** 2 / seconds
        second = 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x) / seconds**2
        return x**3 * (10.0 - 15.0 * x + 6.0 * x**2), first, second

    def _edges(self, t: float, a: float) -> list[Pulse]:
        """Edges within one period, in which the rate does not change its sign."""
        pitch, dt = 2.0 * np.pi / self.pulses_per_rev, self.period_s
        begin, w = self._angle, self._rate
        end = begin + w * dt + 0.5 * a * dt**2
        low, high = np.floor(begin / pitch + 0.5), np.floor(end / pitch + 0.5)
        way = 1 if high > low else -1
        found = []
        for k in range(int(abs(high - low))):
            slot = low + k + 0.5 if way > 0 else low - k - 0.5
            gone = slot * pitch - begin
            root = np.sqrt(max(w**2 + 2.0 * a * gone, 0.0))
            found.append(Pulse(t + float(2.0 * gone / (w + way * root)), way))
        return found

    def _block(self, rows: Array, poses: Array) -> Block:
        angle, rate, acceleration = rows.T
        n = len(rows)
        C_nt, C2_nt = self._attitude(angle, rate, acceleration)
        share, first, second = poses.T
        turn = self._tb * Rotation.from_rotvec(share[:, None] * self._over)
        C_tb = turn.as_matrix()
        x, y, z = self._over
        K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        # The table stands while somebody turns the cube over, so no product of both rates appears.
        C2_tb = C_tb @ (K @ K * (first**2)[:, None, None] + K * second[:, None, None])
        C_nb, C2_nb = C_nt @ C_tb, C2_nt @ C_tb + C_nt @ C2_tb
        felt_b = self._felt(C_nb, C2_nb, self._arms)
        self._blocks += 1
        f_axis = np.einsum("tki,ki->tk", felt_b, self.layout.theta_b)
        counts, readings = self._read(self._blocks, f_axis)
        axis_b = C_tb[:, 2, :]  # the table's axis, resolved in b
        q_nt = Rotation.from_quat(np.roll(self._quaternion(angle), -1, axis=1))
        t = (self._index + np.arange(n)) * self.period_s
        return Block(
            index=self._index,
            t_s=t,
            counts=counts,
            readings=readings,
            q_nb=np.roll((q_nt * turn).as_quat(), 1, axis=1),
            omega_b=axis_b * rate[:, None] + first[:, None] * self._over,
            alpha_b=axis_b * acceleration[:, None] + second[:, None] * self._over,
            f_b=self._felt(C_nb, C2_nb, self._centre[None, :])[:, 0, :],
            angle_z=angle,
            profile_time_s=t,
        )
