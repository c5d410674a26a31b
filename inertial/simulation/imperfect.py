"""A cube that is not what it should be, tumbled by hand and turned on a table: data for proofs of
the calibration.

The true axes have biases, scale errors, misalignments and positions of their own; readings come
from TableTest's physics, which knows nothing of the calibration's model.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from inertial.constants import GRAVITY
from inertial.layouts.layout import Layout
from inertial.simulation.profiles import Profile, Ramp, named
from inertial.simulation.table import BLOCK, SensorModel, TableTest

Array = NDArray[np.float64]

DEGREE = np.pi / 180.0  # rad
MOUNTINGS = np.array(  # C_tb: body axes in the table's frame; z, x, y up, and a corner
    [
        np.eye(3),
        [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]],
        [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
    ]
)

STEPS = Profile(
    "steps",
    [
        Ramp(2, 0, 0),
        Ramp(0.6, 0, 360 * DEGREE),
        Ramp(2, 360 * DEGREE, 360 * DEGREE),
        Ramp(0.6, 360 * DEGREE, 0),
        Ramp(1, 0, 0),
        Ramp(0.6, 0, -360 * DEGREE),
        Ramp(2, -360 * DEGREE, -360 * DEGREE),
        Ramp(1.2, -360 * DEGREE, 600 * DEGREE),
        Ramp(2, 600 * DEGREE, 600 * DEGREE),
        Ramp(1, 600 * DEGREE, 0),
        Ramp(1, 0, 0),
    ],
)


@dataclass(frozen=True)
class Imperfections:
    """Sigmas of what a device is off by."""

    bias: float = 0.2  # m/s^2, 20 mg
    scale: float = 0.02  # of 1
    misalignment: float = 0.01  # rad
    position: float = 5e-4  # m
    noise: float = 4e-3 * GRAVITY  # m/s^2 of one sample
    count: float = 3.9e-3 * GRAVITY  # m/s^2


@dataclass(frozen=True, eq=False)
class Device:
    """One imperfect device: what it really is."""

    nominal: Layout
    true: Layout
    bias: Array  # (N,) m/s^2
    scale: Array  # (N,)
    off: Imperfections
    seed: int

    @property
    def c(self) -> Array:
        """Scale times direction, (N, 3)."""
        return self.scale[:, None] * self.true.theta_b

    def read(self, f_axis: Array, draw: np.random.Generator) -> Array:
        """Readings (n, N) of the true specific force along each true axis, m/s^2."""
        raw = f_axis * self.scale + self.bias + draw.normal(0.0, self.off.noise, f_axis.shape)
        return np.rint(raw / self.off.count) * self.off.count if self.off.count else raw


def device(nominal: Layout, seed: int, off: Imperfections = Imperfections()) -> Device:
    """Draw a device. Its frame and centre are those of the nominal layout, so that its parameters
    are comparable.
    """
    from inertial.calibration.model import places

    draw = np.random.default_rng([seed, 41])
    n = nominal.axes
    scale = 1.0 + off.scale * draw.normal(size=n)
    c = nominal.theta_b + off.misalignment * draw.normal(size=(n, 3))
    c *= (scale / np.linalg.norm(c, axis=1))[:, None]
    for _ in range(20):  # turn the whole until sum theta0 x c = 0
        turn = np.cross(nominal.theta_b, c).sum(axis=0) / (2.0 * n / 3.0)
        c = c - np.cross(turn, c)
        c *= (scale / np.linalg.norm(c, axis=1))[:, None]
    place, r0 = places(nominal)
    shift = off.position * draw.normal(size=r0.shape)
    r = r0 + shift - shift.mean(axis=0)
    true = replace(nominal, r_b=r[place], theta_b=c / scale[:, None])
    return Device(nominal, true, off.bias * draw.normal(size=n), scale, off, seed)


def tumble(
    one: Device, up_b: Array, rest_s: float = 4.0, move_s: float = 1.5, rate_hz: float = 100.0
) -> Array:
    """Readings (n, N) of a tumble through poses up_b (M, 3), turned by hand in between, m/s^2."""
    draw = np.random.default_rng([one.seed, 42])
    parts = []
    before = up_b[0]
    for up in up_b:
        wanted = up + 0.05 * draw.normal(size=3)  # nobody sets it down exactly
        wanted /= np.linalg.norm(wanted)
        x = np.linspace(0.0, 1.0, round(move_s * rate_hz))[:, None]
        path = (1.0 - x) * before + x * wanted + 0.3 * np.sin(np.pi * x) * draw.normal(size=3)
        path /= np.maximum(np.linalg.norm(path, axis=1), 1e-3)[:, None]
        shaken = GRAVITY * path + 1.5 * np.sin(np.pi * x) * draw.normal(size=path.shape)
        parts += [shaken, np.tile(GRAVITY * wanted, (round(rest_s * rate_hz), 1))]
        before = wanted
    return one.read(np.vstack(parts) @ one.true.theta_b.T, draw)


@dataclass(frozen=True)
class TableRun:
    """A device on the table; arrays over samples (n)."""

    t_s: Array
    readings: Array  # (n, N) m/s^2
    tacho: Array  # (n,) rad/s, as a tachometer of 360 pulses reads
    omega_b: Array  # (n, 3) rad/s, true
    q_nb: Array  # (n, 4), true, of the table's frame for the first mounting


def table_run(
    one: Device,
    mounting: Array = MOUNTINGS[0],
    profile: Profile | str = STEPS,
    seed: int = 0,
    tilt: float = 2.0 * DEGREE,
    centre_b: tuple[float, float, float] = (0.004, -0.003, 0.002),
    seconds: float | None = None,
) -> TableRun:
    """Run a profile, mounted as C_tb (3, 3) says; centre_b (m, in b): from the table's axis to the
    device's centre.
    """
    profile = named(profile) if isinstance(profile, str) else profile
    turned = replace(one.true, r_b=one.true.r_b @ mounting.T, theta_b=one.true.theta_b @ mounting.T)
    ideal = SensorModel(noise=0.0, bias=0.0, scale_error=0.0, count=0.0)
    centre = tuple(float(v) for v in mounting @ np.asarray(centre_b))
    test = TableTest(
        seed=seed, profile=profile, sensor=ideal, layout=turned, tilt=tilt, centre_b=centre
    )
    n = round((seconds or profile.seconds) / test.period_s)
    cut = [test.block(k) for k in range(-(-n // BLOCK))]
    draw = np.random.default_rng([one.seed, 43, seed])
    f_axis = np.vstack([block.readings for block in cut])[:n]
    omega_t = np.vstack([block.omega_b for block in cut])[:n]
    rate = omega_t[:, 2]
    tacho = rate + draw.normal(0.0, 0.002, n) * (np.abs(rate) > 0.02)
    q_nb = np.vstack([block.q_nb for block in cut])[:n]
    t = np.concatenate([block.t_s for block in cut])[:n]
    return TableRun(t, one.read(f_axis, draw), tacho, omega_t @ mounting, q_nb)
