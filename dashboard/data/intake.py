"""Messages become rows: for each topic with a table, which field of a message is which column.

Every function takes one message and appends all the rows it carries at once. A message whose
lengths do not fit is left out, a field whose length does not fit is NaN.
"""

import math
from collections.abc import Callable, Sequence

import numpy as np

from dashboard.data.device import Device
from dashboard.data.pose import ned_from_geodetic, roll_pitch, yaw_of, yaws_of
from dashboard.data.tables import ADC_CHANNELS
from dashboard.data.track import Track
from messages.contract import gyrofree_pb2 as pb
from messages.contract import rates

FIXES_REMEMBERED = 100  # until the filter has said whether it believes them
NAV_SPACING_M, FIX_SPACING_M = 0.3, 0.5  # between the points of a track


def fields(values: Sequence[float], width: int, count: int = 1) -> np.ndarray:
    """A repeated field that holds `count` rows one after the other, as (count, width)."""
    if len(values) != count * width:
        return np.full((count, width), np.nan)
    return np.asarray(values, dtype=float).reshape(count, width)


def fitted(values: np.ndarray | Sequence[float], width: int) -> np.ndarray:
    """Rows (n, k) or one row (k,) as (n, width): cut, or filled up with NaN."""
    found = np.atleast_2d(np.asarray(values, dtype=float))[:, :width]
    out = np.full((len(found), width), np.nan)
    out[:, : found.shape[1]] = found
    return out


def known(rows: np.ndarray) -> np.ndarray:
    """Rows that are all zero say nothing: NaN."""
    return np.where(np.any(rows != 0.0, axis=1, keepdims=True), rows, np.nan)


def sigmas(covariance: np.ndarray) -> np.ndarray:
    """Standard deviations (n, 3) of row-major 3 x 3 covariances (n, 9)."""
    return np.sqrt(np.maximum(covariance[:, ::4], 0.0))


def _accel(device: Device, estimator: str, t: float, m: pb.AccelBatch) -> None:
    if not m.axes or len(m.f_mps2) % m.axes:
        return
    f = np.asarray(m.f_mps2).reshape(-1, m.axes)
    ring = device.ring("accel", estimator, f=m.axes)
    ring.append(t + m.period_s * np.arange(len(f)), f=fitted(f, *ring.dtype["f"].shape))


def _imu(device: Device, estimator: str, t: float, m: pb.ImuBatch) -> None:
    n, rest = divmod(len(m.f_b_mps2), 3)
    if rest or len(m.omega_ib_b_radps) != len(m.f_b_mps2):
        return
    device.ring("imu", estimator).append(
        t + m.period_s * np.arange(n),
        f_b=fields(m.f_b_mps2, 3, n),
        omega_ib_b=fields(m.omega_ib_b_radps, 3, n),
    )


def _adc(device: Device, estimator: str, t: float, m: pb.AdcBatch) -> None:
    if not 0 < m.channels <= ADC_CHANNELS or len(m.counts) % m.channels:
        return
    counts = np.asarray(m.counts, dtype=float).reshape(-1, m.channels)
    device.ring("adc", estimator).append(
        t + m.period_s * np.arange(len(counts)), counts=fitted(counts, ADC_CHANNELS)
    )


def _tacho(device: Device, estimator: str, t: float, m: pb.TachoRate) -> None:
    device.ring("tacho", estimator).append(t, omega=m.omega_radps, sigma=m.sigma_radps)


def _truth(device: Device, estimator: str, t: float, m: pb.Truth) -> None:
    device.ring("truth", estimator).append(
        t,
        omega_ib_b=fields(m.omega_ib_b_radps, 3),
        f_b=fields(m.f_b_mps2, 3),
        angle_z=m.angle_z_rad,
    )


def _rate(device: Device, estimator: str, t: float, m: pb.RateBatch) -> None:
    n = rates.count(m)
    dof = fields(m.nis_dof, 1, n)
    corrected = dof > 0.0
    m_innovation = len(m.innovation) // n
    device.ring("rate", estimator).append(
        t + m.period_s * np.arange(n),
        omega_ib_b=fields(m.omega_ib_b_radps, 3, n),
        sigma=sigmas(fields(m.omega_covariance, 9, n)),
        bound=known(fields(m.bound_sigma_radps, 3, n)),
        sight=fields(m.sight, 3, n),
        f_b=fields(m.f_b_mps2, 3, n),
        angle_z=fields(m.angle_z_rad, 1, n)[:, 0],
        yaw=yaws_of(fields(m.q_nb, 4, n)),
        p_n=fields(m.p_n_m, 3, n),
        innovation=np.where(corrected, fitted(fields(m.innovation, m_innovation, n), 6), np.nan),
        innovation_sigma=np.where(
            corrected, fitted(fields(m.innovation_sigma, m_innovation, n), 6), np.nan
        ),
        nis=np.where(corrected, fields(m.nis, 1, n), np.nan)[:, 0],
        nis_dof=dof[:, 0],
    )


def _attitude(device: Device, estimator: str, t: float, m: pb.AttitudeEstimate) -> None:
    if len(m.q_nb) != 4:
        return
    roll, pitch = roll_pitch(m.q_nb)
    device.ring("attitude", estimator).append(
        t, roll=roll, pitch=pitch, bias=fields(m.bias_omega_b_radps, 3)
    )


def _nav(device: Device, estimator: str, t: float, m: pb.NavSolution) -> None:
    if len(m.p_ned_m) != 3 or m.mode < pb.NavSolution.MODE_COURSE:
        return
    device.origin = _origin(m.origin_latitude_deg, m.origin_longitude_deg, m.origin_height_m)
    h = m.horizon
    fuzzy = len(h.inputs) == 2 and len(h.membership) == 6
    device.ring("nav", estimator).append(
        t,
        p_n=fields(m.p_ned_m, 3),
        v_n=fields(m.v_n_mps, 3),
        sigma_p_n=sigmas(fields(m.position_covariance, 9)),
        yaw=yaw_of(m.q_nb),
        horizon=h.n if m.HasField("horizon") else np.nan,
        crisp=h.crisp if fuzzy else np.nan,
        inputs=fields(h.inputs, 2) if fuzzy else np.nan,
        membership=fields(h.membership, 6) if fuzzy else np.nan,
    )
    device.tracks.setdefault(f"nav/{estimator}", Track(spacing=NAV_SPACING_M)).add(m.p_ned_m)


def _origin(
    latitude_deg: float, longitude_deg: float, height_m: float
) -> tuple[float, float, float]:
    """Where to count from, at height 0 as long as nobody knows one."""
    return latitude_deg, longitude_deg, height_m if math.isfinite(height_m) else 0.0


def _gnss(device: Device, estimator: str, t: float, m: pb.GnssFix) -> None:
    if m.quality == pb.GnssFix.QUALITY_NONE or (m.latitude_deg == 0.0 and m.longitude_deg == 0.0):
        return
    origin = device.origin or _origin(m.latitude_deg, m.longitude_deg, m.height_m)
    p_n = ned_from_geodetic(m.latitude_deg, m.longitude_deg, m.height_m, origin)
    device.ring("gnss", estimator).append(
        t,
        p_n=p_n,
        latitude=m.latitude_deg,
        longitude=m.longitude_deg,
        sigma_p_n=fields(m.position_sigma_ned_m, 3),
        quality=m.quality,
    )
    if device.origin is None:
        return  # the fix would land in another frame than the trajectory
    device.tracks.setdefault("fixes", Track(spacing=FIX_SPACING_M)).add(p_n)
    device.fixes[m.header.sequence] = tuple(p_n)
    if len(device.fixes) > FIXES_REMEMBERED:
        device.fixes.pop(next(iter(device.fixes)))


def _innovation(device: Device, estimator: str, t: float, m: pb.Innovation) -> None:
    device.ring("innovation", estimator).append(
        t,
        value=fitted(m.value, 6),
        sigma=fitted(m.sigma, 6),
        nis=m.nis,
        error=fields(m.error_to_reference, 3),
        ahead=fitted(m.prediction_error, 3),
        residual=fitted(m.residual, 3),
    )
    # A fix withheld on purpose is not accepted either, but it comes with its error.
    withheld = bool(m.error_to_reference)
    if not m.accepted and not withheld and device.leads("innovation", estimator):
        p_n = device.fixes.get(m.for_sequence)
        if p_n is not None:
            device.tracks.setdefault("rejected", Track(spacing=FIX_SPACING_M)).add(p_n)


Intake = Callable[[Device, str, float, object], None]  # device, estimator, t of the message, s

INTAKE: dict[str, Intake] = {  # by the name of the topic
    "accel": _accel,
    "imu": _imu,
    "adc": _adc,
    "tacho": _tacho,
    "truth": _truth,
    "rate": _rate,
    "attitude": _attitude,
    "nav": _nav,
    "gnss": _gnss,
    "innovation": _innovation,
}
