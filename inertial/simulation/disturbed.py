"""What a laboratory adds to a turning table: vibration, lost samples, drifting biases, rocking.

    vibration   the whole table shakes along one direction within a band: what a motor, a fan, a
                pump or a lorry outside the window does
    rocking     the base tilts to and fro about north by a sine of a second or so: a table on a
                floor that gives, or on board a ship
    drift       every axis' bias walks away evenly, each in its own direction
    loss        samples do not arrive, each by chance

The physics is TableTest's; rocking is differentiated by hand there where it acts. SI.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inertial.constants import MILLI_G
from inertial.simulation.profiles import Profile
from inertial.simulation.table import BLOCK, SensorModel, TableTest

Array = NDArray[np.float64]

DEGREE = np.pi / 180.0  # rad


@dataclass(frozen=True)
class Disturbance:
    """What is added; zero is none of it."""

    vibration: float = 0.0  # m/s^2, RMS along its direction
    band_hz: tuple[float, float] = (30.0, 60.0)
    loss: float = 0.0  # share of the samples that do not arrive
    drift: float = 0.0  # m/s^2 per s, of every axis, with a sign of its own
    rocking: float = 0.0  # rad, amplitude of the base's tilt
    rocking_hz: float = 0.7


@dataclass(frozen=True)
class Record:
    """What arrived of a disturbed table, and the truth beside it; arrays over samples (n)."""

    index: NDArray[np.int64]  # sample numbers of the board; what is missing was lost
    t_s: Array
    readings: Array  # (n, N) m/s^2
    omega_b: Array  # (n, 3) rad/s, true
    still: NDArray[np.bool_]  # the table does not turn (it may rock)


class RockingTable(TableTest):
    """A table whose base tilts about north by `amplitude` sin(2 pi f t)."""

    def __init__(self, *arguments, amplitude: float, frequency_hz: float, **options) -> None:
        super().__init__(*arguments, **options)
        self._amplitude, self._w = amplitude, 2.0 * np.pi * frequency_hz
        self._t = np.zeros(0)

    def block(self, number: int):
        """See TableTest.block; omega_b has the rocking in it, alpha_b has not."""
        self._t = (number * BLOCK + np.arange(BLOCK)) * self.period_s
        made = super().block(number)
        still_nb, _ = super()._attitude(made.angle_z, made.omega_b[:, 2], made.alpha_b[:, 2])
        rate_n = np.zeros((BLOCK, 3))
        rate_n[:, 0] = self._amplitude * self._w * np.cos(self._w * self._t)  # about north
        made.omega_b[:] += np.einsum("tji,tj->ti", still_nb, rate_n)
        return made

    def _attitude(self, angle: Array, rate: Array, acceleration: Array) -> tuple[Array, Array]:
        c0, c2 = super()._attitude(angle, rate, acceleration)
        step = 1e-4  # s; the table's own first derivative, which TableTest does not give
        ahead, _ = super()._attitude(angle + rate * step, rate, acceleration)
        behind, _ = super()._attitude(angle - rate * step, rate, acceleration)
        c1 = (ahead - behind) / (2.0 * step)
        phi = self._amplitude * np.sin(self._w * self._t)
        phi1 = self._amplitude * self._w * np.cos(self._w * self._t)
        phi2 = -(self._w**2) * phi
        R, R1, R2 = _about_north(phi, phi1, phi2)
        return R @ c0, R2 @ c0 + 2.0 * R1 @ c1 + R @ c2


def _about_north(phi: Array, phi1: Array, phi2: Array) -> tuple[Array, Array, Array]:
    """Turn by phi about north and its first two time derivatives, (n, 3, 3)."""
    c, s = np.cos(phi), np.sin(phi)
    out = np.zeros((3, len(phi), 3, 3))
    zero, first, second = out
    zero[:, 0, 0] = 1.0
    zero[:, 1, 1], zero[:, 1, 2], zero[:, 2, 1], zero[:, 2, 2] = c, -s, s, c
    d, e = -s * phi1, c * phi1
    first[:, 1, 1], first[:, 1, 2], first[:, 2, 1], first[:, 2, 2] = d, -e, e, d
    d, e = -s * phi2 - c * phi1**2, c * phi2 - s * phi1**2
    second[:, 1, 1], second[:, 1, 2], second[:, 2, 1], second[:, 2, 2] = d, -e, e, d
    return zero, first, second


def shaking(t_s: Array, rms: float, band_hz: tuple[float, float], draw) -> Array:
    """Acceleration (n,), m/s^2: twenty sines of random phase within the band, of this RMS together.

    Frequencies above half the sample rate come back as lower ones, as they do in a sensor without
    a low-pass.
    """
    frequencies = draw.uniform(*band_hz, 20)
    phases = draw.uniform(0.0, 2.0 * np.pi, 20)
    waves = np.sin(2.0 * np.pi * frequencies * t_s[:, None] + phases)
    return rms * np.sqrt(2.0 / 20.0) * waves.sum(axis=1)


def record(
    seed: int,
    profile: str | Profile = "published",
    blocks: int = 3,
    disturbance: Disturbance = Disturbance(),
    sensor: SensorModel = SensorModel(),
    **options,
) -> Record:
    """A disturbed table of one seed; further options as TableTest takes them."""
    d, made = disturbance, {"profile": profile, "sensor": sensor, **options}
    if d.rocking:
        table = RockingTable(seed, amplitude=d.rocking, frequency_hz=d.rocking_hz, **made)
    else:
        table = TableTest(seed, **made)
    parts = [table.block(k) for k in range(blocks)]
    t_s = np.concatenate([b.t_s for b in parts])
    readings = np.concatenate([b.readings for b in parts])
    draw = np.random.default_rng([seed, 77])
    direction = draw.normal(size=3)
    along = table.layout.theta_b @ (direction / np.linalg.norm(direction))
    extra = shaking(t_s, d.vibration, d.band_hz, draw)[:, None] * along
    extra = extra + d.drift * t_s[:, None] * draw.choice((-1.0, 1.0), table.layout.axes)
    if sensor.count:
        extra = np.rint(extra / sensor.count + draw.uniform(-0.5, 0.5, extra.shape)) * sensor.count
    kept = draw.uniform(size=len(t_s)) >= d.loss
    omega_b = np.concatenate([b.omega_b for b in parts])
    turning = np.concatenate([b.alpha_b[:, 2] != 0.0 for b in parts]) | (
        np.abs(omega_b[:, 2]) > 1e-9
    )
    return Record(
        np.nonzero(kept)[0], t_s[kept], (readings + extra)[kept], omega_b[kept], ~turning[kept]
    )


CONDITIONS: dict[str, dict] = {
    "as published": {},
    "vibration 10 mg": {"disturbance": Disturbance(vibration=10 * MILLI_G)},
    "vibration 50 mg": {"disturbance": Disturbance(vibration=50 * MILLI_G)},
    "noise 6 mg": {"sensor": SensorModel(noise=6 * MILLI_G)},
    "noise 10 mg": {"sensor": SensorModel(noise=10 * MILLI_G)},
    "loss 0.5 %": {"disturbance": Disturbance(loss=0.005)},
    "loss 5 %": {"disturbance": Disturbance(loss=0.05)},
    "bias 40 mg": {"sensor": SensorModel(bias=40 * MILLI_G)},
    "drift 0.2 mg/s": {"disturbance": Disturbance(drift=0.2 * MILLI_G)},
    "tilt 20 deg": {"tilt": 20.0 * DEGREE},
    "rocking 1 deg": {"disturbance": Disturbance(rocking=1.0 * DEGREE)},
}
"""What an estimate has to stay honest under; options of `record`."""
