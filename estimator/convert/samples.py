"""Messages in: batches to arrays, fixes and tachometer reports to numbers; or they are refused."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inertial.constants import GEOID_SIGMA
from inertial.navigation.fix import Fix, typical_sigma
from inertial.rate.samples import finite
from messages.contract import gyrofree_pb2 as pb
from messages.contract.fixes import complete

Array = NDArray[np.float64]

MICRO = 1e-6
LEAST_PERIOD_S = 1e-5


class BadMessage(ValueError):
    """A message whose lengths or numbers cannot be samples."""


@dataclass(frozen=True)
class Samples:
    """A batch as arrays."""

    t_s: Array  # (n,) s of the board's clock
    values: Array  # (n, columns)


def _rows(
    what: str, header: pb.Header, values: Iterable[float], columns: int, period_s: float
) -> Samples:
    flat = np.array(values, dtype=np.float64)
    problem = ""
    if columns < 1 or flat.size == 0 or flat.size % columns:
        problem = f"{flat.size} values do not fill rows of {columns}"
    elif not finite(flat):
        problem = "not all values are finite"
    elif not LEAST_PERIOD_S <= period_s < 10.0:
        problem = f"period {period_s} s, want {LEAST_PERIOD_S:g} to 10 s"
    if problem:
        raise BadMessage(f"{what} {header.sequence} of {header.device}: {problem}")
    n, start = flat.size // columns, header.device_us * MICRO
    return Samples(np.array([start + period_s * k for k in range(n)]), flat.reshape(n, columns))


def accel_samples(batch: pb.AccelBatch) -> Samples:
    """Axis readings (n, axes), m/s^2; raises BadMessage."""
    return _rows("accel", batch.header, batch.f_mps2, batch.axes, batch.period_s)


def imu_samples(batch: pb.ImuBatch) -> tuple[Samples, Array]:
    """Specific force and rate, both (n, 3), in m/s^2 and rad/s; raises BadMessage."""
    force = _rows("imu force", batch.header, batch.f_b_mps2, 3, batch.period_s)
    rate = _rows("imu rate", batch.header, batch.omega_ib_b_radps, 3, batch.period_s)
    if len(force.values) != len(rate.values):
        raise BadMessage(
            f"imu {batch.header.sequence} of {batch.header.device}: {len(force.values)} rows of"
            f" specific force, {len(rate.values)} of rate"
        )
    return force, rate.values


def adc_samples(batch: pb.AdcBatch) -> Samples:
    """Voltages (n, channels) of a converter's inputs; raises BadMessage."""
    counts = _rows("adc", batch.header, batch.counts, batch.channels, batch.period_s)
    return Samples(counts.t_s, counts.values * batch.volt_per_count)


def fix_of(message: pb.GnssFix, every: int, clock_offset_s: float) -> Fix:
    """A fix on the board's clock; all but each every-th, by header.sequence, are withheld. Raises
    BadMessage.

    Its time is device_time_s where the board measured it, else its arrival. A receiver on a port of
    its own has no device time at all: then UTC minus clock_offset_s (UTC - board's clock, s) stands
    for it.
    """
    message = complete(message)
    header = message.header
    arrival = (
        header.device_us * MICRO if header.device_us else header.utc_ns * 1e-9 - clock_offset_s
    )
    position, velocity = typical_sigma(message.quality)
    numbers = (message.latitude_deg, message.longitude_deg, arrival, message.device_time_s)
    placed = all(map(math.isfinite, numbers)) and abs(message.latitude_deg) < 90.0
    if message.quality != pb.GnssFix.QUALITY_NONE and not placed:
        raise BadMessage(f"gnss {header.sequence} of {header.device}: not a position: {numbers}")
    v_n = np.array(message.v_n_mps) if len(message.v_n_mps) == 3 else None
    sigma_v = None if v_n is None else _sigma(message.velocity_sigma_ned_mps, velocity)
    return Fix(
        t=message.device_time_s or arrival,
        arrival=arrival,
        latitude=math.radians(message.latitude_deg),
        longitude=math.radians(message.longitude_deg),
        height=message.height_m,
        quality=message.quality,
        sigma_p=_sigma_p(message, position),
        datum=GEOID_SIGMA if _from_sea(message) else 0.0,
        v_n=v_n,
        sigma_v=sigma_v,
        withheld=header.sequence % every != 0,
        key=header.sequence,
    )


def _from_sea(message: pb.GnssFix) -> bool:
    return bool(message.height_reference == pb.HEIGHT_REFERENCE_SEA_LEVEL)


def _sigma_p(message: pb.GnssFix, typical: Array) -> Array:
    """(3,) m; of a height above sea level without the geoid's part, which all fixes have alike."""
    sigma = _sigma(message.position_sigma_ned_m, typical)
    if _from_sea(message):
        own = math.sqrt(max(sigma[2] ** 2 - GEOID_SIGMA**2, 0.0))
        sigma = np.array([sigma[0], sigma[1], own or min(typical[2], sigma[2])])
    return sigma


def _sigma(said: Iterable[float], typical: Array) -> Array:
    """The receiver's own sigma where it is one; what is typical also for down alone."""
    values = np.array(said, dtype=np.float64)
    if values.shape != (3,) or not (values[:2] > 0.0).all():
        return typical
    return values if values[2] > 0.0 else np.array([values[0], values[1], typical[2]])


def tacho_report(message: pb.TachoRate) -> tuple[float, float, float, bool]:
    """Time (s, board's clock), rate, sigma (rad/s), and whether the sign is known; raises
    BadMessage.
    """
    t_s, rate, sigma = message.header.device_us * 1e-6, message.omega_radps, message.sigma_radps
    if not (math.isfinite(rate) and math.isfinite(sigma) and sigma > 0.0):
        raise BadMessage(
            f"tacho of {message.header.device}: {rate} rad/s with sigma {sigma} rad/s: want numbers"
        )
    return t_s, rate, sigma, message.direction_known
