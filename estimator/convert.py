"""Bus messages to arrays and states to bus messages. With service.py the only file here that knows
messages.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from numpy.typing import NDArray

from estimator.stream import Stream
from inertial.navigation.fix import Fix, typical_sigma
from inertial.navigation.fuzzy import MEMBERSHIPS, memberships
from inertial.navigation.solution import (
    HEADING,
    INNOVATIONS,
    Correction,
    HorizonChoice,
    Mode,
    Solution,
)
from inertial.rate.samples import finite
from messages.contract import gyrofree_pb2 as pb

Array = NDArray[np.float64]

MICRO = 1e-6
STATES = {
    Mode.WAITING: "waiting for samples",
    Mode.LEVELLING: "levelling: stand still for 10 s",
    Mode.COURSE: "finding heading: drive faster than 4 m/s",
    Mode.NAVIGATING: "navigating",
}


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
    elif not 0.0 < period_s < 10.0:
        problem = f"period {period_s} s, want 0 to 10 s"
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
    header = message.header
    arrival = (
        header.device_us * MICRO if header.device_us else header.utc_ns * 1e-9 - clock_offset_s
    )
    position, velocity = typical_sigma(message.quality)
    numbers = (
        message.latitude_deg,
        message.longitude_deg,
        message.height_m,
        arrival,
        message.device_time_s,
    )
    if not all(map(math.isfinite, numbers)) or abs(message.latitude_deg) >= 90.0:
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
        sigma_p=_sigma(message.position_sigma_ned_m, position),
        v_n=v_n,
        sigma_v=sigma_v,
        withheld=header.sequence % every != 0,
        key=header.sequence,
    )


def _sigma(said: Iterable[float], typical: Array) -> Array:
    """The receiver's own sigma where it is one."""
    values = np.array(said, dtype=np.float64)
    return values if values.shape == (3,) and (values > 0.0).all() else typical


def sample_header(first: pb.Header, offset_s: float) -> pb.Header:
    """Header of an estimate for the instant offset_s after the batch's first sample.

    It has no sequence: the publisher counts. Everything else follows from the input alone.
    """
    header = pb.Header()
    header.CopyFrom(first)
    header.sequence, header.late = 0, False
    header.device_us, header.utc_ns = moment(first.device_us, first.utc_ns, offset_s)
    return header


def moment(device_us: int, utc_ns: int, offset_s: float) -> tuple[int, int]:
    """device_us and utc_ns offset_s after those."""
    return max(0, device_us + round(offset_s * 1e6)), utc_ns + round(offset_s * 1e9)


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


def attitude_message(
    header: pb.Header, batch: pb.ImuBatch, index: int, name: str, state: Any
) -> pb.AttitudeEstimate:
    """AttitudeState as published; no filter of that kind knows north."""
    return pb.AttitudeEstimate(
        header=header,
        estimator=name,
        for_sequence=batch.header.sequence,
        for_index=index,
        q_nb=as_list(state.q_nb),
        inclination_sigma_rad=float(state.inclination_sigma),
        bias_omega_b_radps=as_list(state.bias_omega_b),
        resting=bool(state.resting),
        heading_known=False,
    )


def status_message(
    header: pb.Header, stream: Stream, name: str, us: float, version: str
) -> pb.EstimatorStatus:
    """Health of one estimator, without its state; us: measured time per sample."""
    return pb.EstimatorStatus(
        header=header,
        estimator=name,
        samples=stream.samples,
        gaps=stream.gaps,
        missing_samples=stream.missing,
        us_per_sample=us,
        version=version,
    )


def navigator_state(status: pb.EstimatorStatus, navigator: Any) -> pb.EstimatorStatus:
    """The status with what a navigator does and has counted."""
    status.state = STATES[navigator.mode]
    status.message = ", ".join(
        f"fixes {what} {count}" for what, count in navigator.counts.items() if count
    )
    return status


def rate_state(status: pb.EstimatorStatus, state: Any) -> pb.EstimatorStatus:
    """The status with what a rate estimator does; state: its newest RateState."""
    status.state = state.phase or ("standing still" if state.still else "turning")
    bias = as_list(state.bias)
    if len(bias) >= 6:
        status.bias_alpha_radps2[:] = bias[:3]
        status.bias_f_b_mps2[:] = bias[3:6]
    return status


def pose_message(
    header: pb.Header, name: str, p_n_m: Iterable[float], q_nb: Iterable[float]
) -> FrameTransform:
    """Body against n as any viewer draws it: parent <device>/n, child <device>/<estimator>."""
    message = FrameTransform(
        parent_frame_id=f"{header.device}/n", child_frame_id=f"{header.device}/{name}"
    )
    message.timestamp.seconds, message.timestamp.nanos = divmod(header.utc_ns, 10**9)
    t, q = message.translation, message.rotation
    t.x, t.y, t.z = map(float, p_n_m)
    q.w, q.x, q.y, q.z = map(float, q_nb)
    return message


def nav_message(
    header: pb.Header,
    batch: pb.ImuBatch | pb.AccelBatch,
    index: int,
    name: str,
    s: Solution,
    muted: bool = False,
) -> pb.NavSolution:
    """Solution as published."""
    return pb.NavSolution(
        header=header,
        estimator=name,
        for_sequence=batch.header.sequence,
        for_index=index,
        mode=int(s.mode),
        latitude_deg=math.degrees(s.latitude),
        longitude_deg=math.degrees(s.longitude),
        height_m=s.height,
        p_ned_m=as_list(s.p_ned),
        v_n_mps=as_list(s.v_n),
        q_nb=as_list(s.q_nb),
        bias_f_b_mps2=as_list(s.bias_f_b),
        bias_omega_b_radps=as_list(s.bias_omega_b),
        sigma=as_list(s.sigma),
        position_covariance=as_list(s.position_covariance),
        origin_latitude_deg=math.degrees(s.origin[0]),
        origin_longitude_deg=math.degrees(s.origin[1]),
        origin_height_m=s.origin[2],
        fix_age_s=s.fix_age,
        horizon=None if s.horizon is None else horizon_message(s.horizon),
        alignment=s.alignment,
        gnss_muted=muted,
    )


def horizon_message(h: HorizonChoice) -> pb.Horizon:
    """The horizon as published; a fixed one has no memberships."""
    message = pb.Horizon(n=h.n, crisp=h.crisp)
    if h.inputs is not None:
        message.inputs[:] = h.inputs
        message.membership_name[:] = MEMBERSHIPS
        message.membership[:] = memberships(*h.inputs)
    return message


def innovation_message(header: pb.Header, name: str, c: Correction) -> pb.Innovation:
    """Correction as published; a withheld fix is a reference the filter did not see."""
    return pb.Innovation(
        header=header,
        estimator=name,
        for_sequence=c.fix.key,
        name=[*INNOVATIONS[: len(c.values) // 3 * 3], *[HEADING] * (len(c.values) % 3)],
        value=as_list(c.values),
        sigma=as_list(c.sigma),
        nis=c.nis,
        dof=len(c.values),
        accepted=c.accepted,
        error_to_reference=as_list(c.error_ned) if c.fix.withheld else [],
        reason=c.reason,
        weight=c.weight,
        prediction_error=as_list(c.prediction_error),
        residual=as_list(c.residual),
    )


def as_list(values: Any) -> list[float]:
    """Any array, row-major; None is empty."""
    return [] if values is None else np.asarray(values, dtype=np.float64).ravel().tolist()
