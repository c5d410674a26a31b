"""Latest values and ring buffers, per device, filled by the feed and read by the views.

Time is `header.utc_ns` in seconds after the first message of the device; whether a value is stale
is judged by when it arrived, because a replay carries the past's time. Every method that reads or
writes takes the store's lock briefly.
"""

import threading
import time
from dataclasses import dataclass, field

import numpy as np
from google.protobuf.message import Message

from dashboard.scene.geometry import Track, ned_from_geodetic, yaw_of
from dashboard.scene.replayed import Replayed
from dashboard.scene.ring import Ring
from dashboard.scene.tilt import tilt_rows
from messages.contract import gyrofree_pb2 as pb
from messages.contract import topics as tp

LEADERS = (
    "products-ekf",
    "products-free",
    "huber-nhc",
    "ekf",
)  # estimators that stand first wherever they run
HISTORY_S = 620.0  # kept in the rings; the longest window a view offers is 600 s
LATE_JOIN_S = 2.0  # repaired stretches nearer than this are one
MARKS = 200  # notes and marks of a device that are drawn
STALE_S = 1.0  # a value older than this is greyed
FIXES_REMEMBERED = 100  # until the filter has said whether it believes them
SLOW_STALE_S = {
    "link": 3.0,
    "status": 3.0,
    "estimator": 3.0,
    "board": 30.0,
    "gnss": 2.5,
    "innovation": 10.0,
}


# Columns of the rings.
RATE_OMEGA, RATE_SIGMA, RATE_F = slice(0, 3), slice(3, 6), slice(6, 9)
RATE_ANGLE, RATE_NIS, RATE_POSITION = 9, 10, slice(11, 14)
RATE_INNOVATION, RATE_INNOVATION_SIGMA, RATE_NIS_DOF = slice(14, 20), slice(20, 26), 26
RATE_SIGHT, RATE_BOUND, RATE_YAW = slice(27, 30), slice(30, 33), 33
TRUTH_OMEGA, TRUTH_F, TRUTH_ANGLE = slice(0, 3), slice(3, 6), 6
NAV_POSITION, NAV_VELOCITY, NAV_SIGMA_POSITION, NAV_YAW = slice(0, 3), slice(3, 6), slice(6, 9), 9
NAV_HORIZON, NAV_CRISP, NAV_INPUTS, NAV_MEMBERSHIP = 10, 11, slice(12, 14), slice(14, 20)
INNOVATION_VALUE, INNOVATION_SIGMA, INNOVATION_NIS, INNOVATION_ERROR = (
    slice(0, 6),
    slice(6, 12),
    12,
    slice(13, 16),
)
INNOVATION_AHEAD, INNOVATION_RESIDUAL = (
    slice(16, 19),
    slice(19, 22),
)  # fix minus prediction, minus solution: NED m
GNSS_POSITION = slice(0, 3)


@dataclass
class Latest:
    """The newest message of one topic (and estimator) and when it came."""

    message: Message
    arrived: float  # time.monotonic(), s
    t: float  # s on the device's axis

    def age(self, now: float | None = None) -> float:
        """Seconds since it arrived."""
        return (time.monotonic() if now is None else now) - self.arrived


@dataclass
class Device:
    """What is known of one device. `latest` is keyed by topic name and estimator ('' where there is
    none).
    """

    name: str
    utc0_ns: int
    latest: dict[tuple[str, str], Latest] = field(default_factory=dict)
    rings: dict[tuple[str, str], Ring] = field(default_factory=dict)
    tracks: dict[str, Track] = field(default_factory=dict)
    fixes: dict[int, tuple[float, ...]] = field(
        default_factory=dict
    )  # p_n of the newest, by sequence
    t_newest: float = 0.0
    t_first: float = 0.0  # below zero when older data were fetched
    late: list[list[float]] = field(
        default_factory=list
    )  # stretches [from, until] that were filled in, s
    marks: list[tuple[float, str]] = field(default_factory=list)  # notes: when, s, and their text
    origin: tuple[float, float, float] | None = (
        None  # latitude deg, longitude deg, height m of n's origin
    )
    run: int = 0
    generation: int = 0  # counts the times everything was forgotten because time jumped back

    @property
    def is_vehicle(self) -> bool:
        """A board with gyroscopes, as against a cube of accelerometers, which may navigate too."""
        if ("imu", "") in self.latest or ("adc", "") in self.latest:
            return True
        return ("accel", "") not in self.latest and self.navigates

    @property
    def body(self) -> str:
        """Topic of the estimates that move its body in the scene: nav of a vehicle, attitude of a
        board, else rate.
        """
        if not self.is_vehicle:
            return "rate"
        return "attitude" if not self.navigates and self.estimators("attitude") else "nav"

    @property
    def navigates(self) -> bool:
        """Some navigation filter runs for it."""
        return any(topic == "nav" for topic, _ in self.latest)

    def estimators(self, topic: str) -> list[str]:
        """Names of the estimators heard on a topic; the leading one first."""
        names = [estimator for name, estimator in self.latest if name == topic]
        return sorted(names, key=lambda name: (name not in LEADERS, name))

    def get(self, topic: str, estimator: str = "") -> Latest | None:
        """Newest message of a topic."""
        return self.latest.get((topic, estimator))

    def stale(self, topic: str, estimator: str = "", now: float | None = None) -> bool:
        """True when there is none or it is older than its topic allows."""
        latest = self.get(topic, estimator)
        return latest is None or latest.age(now) > SLOW_STALE_S.get(topic, STALE_S)

    def window(
        self, topic: str, estimator: str, t0: float, t1: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Ring rows of a topic in a window; empty arrays when there are none. Call under the
        store's lock.
        """
        ring = self.rings.get((topic, estimator))
        return ring.window(t0, t1) if ring else (np.empty(0), np.empty((0, 34)))


class Store:
    """All devices, the recorder, and the last log lines."""

    def __init__(self) -> None:
        self.lock = threading.RLock()
        self.devices: dict[str, Device] = {}
        self.recorder: Latest | None = None
        self.replay = Replayed()
        self.logs: list[tuple[float, str, str]] = []  # arrived, device, text
        self.dropped = 0  # messages the feed could not keep up with

    def names(self) -> list[str]:
        """Devices heard so far, in the order of their names."""
        with self.lock:
            return sorted(self.devices)

    def device(self, name: str) -> Device | None:
        """A device; read it under the lock."""
        with self.lock:
            return self.devices.get(name)

    def put(
        self,
        topic: tp.Topic,
        device: str,
        estimator: str,
        message: Message,
        arrived: float | None = None,
    ) -> None:
        """Take one message in. `arrived` is time.monotonic() of its arrival, s."""
        arrived = time.monotonic() if arrived is None else arrived
        with self.lock:
            if topic is tp.STATUS:
                self.recorder = Latest(message, arrived, 0.0)
            elif topic is tp.REPLAY:
                self.replay.take(message, arrived)
            elif topic is tp.LOG:
                self.logs = [*self.logs[-49:], (arrived, device, message.message)]
            else:
                self._put_device(topic, device, estimator, message, arrived)

    def put_late(
        self, name: str, messages: list[tuple[tp.Topic, str, Message]], repaired: bool
    ) -> None:
        """Take in older messages of a device: what the bus had lost (`repaired`), or what was
        before we listened.
        """
        with self.lock:
            known = self.devices.get(name)
            if known is None:
                return
            shadow = Device(name, known.utc0_ns, latest=known.latest, origin=known.origin)
            for topic, estimator, message in messages:
                if "header" not in message.DESCRIPTOR.fields_by_name:
                    continue
                message.header.late = True
                t = (message.header.utc_ns - known.utc0_ns) * 1e-9
                if abs(t - known.t_newest) > HISTORY_S:
                    continue
                row = _ROWS.get(topic.name)
                if row is not None:
                    row(shadow, topic, estimator, t, message)
                    known.t_first = min(known.t_first, t)
                    if repaired and topic in (tp.ACCEL, tp.IMU):
                        _stretch(known.late, t)
                elif topic is tp.NOTE:
                    _note(known, topic, estimator, t, message)
                known.latest.setdefault((topic.name, estimator), Latest(message, 0.0, t))
            for key, ring in shadow.rings.items():
                if key in known.rings:
                    known.rings[key].merge(ring.rows())
                else:
                    known.rings[key] = ring

    def _put_device(
        self, topic: tp.Topic, name: str, estimator: str, message: Message, arrived: float
    ) -> None:
        utc_ns = message.header.utc_ns
        known = self.devices.get(name)
        if known is None:
            known = self.devices[name] = Device(name, utc_ns)
        t = (utc_ns - known.utc0_ns) * 1e-9
        row, before = _ROWS.get(topic.name), known.get(topic.name, estimator)
        back = before is not None and before.t - t > 1.0
        if row is not None and utc_ns and (back or t - known.t_newest > 3600.0):
            # A replay started over, or the first time stamps were not yet those of a clock: the old
            # axis is of no use.
            known = self.devices[name] = Device(name, utc_ns, generation=known.generation + 1)
            t = 0.0
        known.run = message.header.run or known.run
        known.latest[topic.name, estimator] = Latest(message, arrived, t)
        if topic is tp.NOTE:
            _note(known, topic, estimator, t, message)
        if row is not None:
            row(known, topic, estimator, t, message)
            known.t_newest = max(known.t_newest, t)


def _ring(device: Device, topic: tp.Topic, estimator: str, columns: int, rate: float = 0.0) -> Ring:
    key = topic.name, estimator
    if key not in device.rings:
        device.rings[key] = Ring(columns, int(HISTORY_S * (rate or topic.rate)))
    return device.rings[key]


def _sigmas(covariance: list[float]) -> list[float]:
    """Standard deviations of a row-major 3 x 3 covariance; NaN where there is none."""
    return (
        list(np.sqrt(np.maximum(covariance[0::4], 0.0))) if len(covariance) == 9 else [np.nan] * 3
    )


def _stretch(late: list[list[float]], t: float) -> None:
    """Add a moment to a list of stretches."""
    for stretch in reversed(late[-20:]):
        if stretch[0] - LATE_JOIN_S <= t <= stretch[1] + LATE_JOIN_S:
            stretch[0], stretch[1] = min(stretch[0], t), max(stretch[1], t)
            return
    late.append([t, t])
    del late[:-100]


def _note(device: Device, topic: tp.Topic, estimator: str, t: float, m: pb.Note) -> None:
    at = (m.at_utc_ns - device.utc0_ns) * 1e-9 if m.at_utc_ns else t
    device.marks = [*device.marks, (at, m.text)][-MARKS:]


def _three(values) -> list[float]:
    return list(values) if len(values) == 3 else [np.nan] * 3


def _six(values) -> list[float]:
    return (list(values) + [np.nan] * 6)[:6]


def _accel(device: Device, topic: tp.Topic, estimator: str, t: float, m: pb.AccelBatch) -> None:
    if not m.axes or len(m.f_mps2) % m.axes:
        return
    ring = _ring(device, topic, estimator, m.axes, rate=200.0)
    for i, row in enumerate(np.asarray(m.f_mps2).reshape(-1, m.axes)):
        ring.append(t + i * m.period_s, row)


def _imu(device: Device, topic: tp.Topic, estimator: str, t: float, m: pb.ImuBatch) -> None:
    if len(m.f_b_mps2) != len(m.omega_ib_b_radps) or len(m.f_b_mps2) % 3:
        return
    ring = _ring(device, topic, estimator, 6, rate=200.0)
    rows = np.hstack(
        [np.asarray(m.f_b_mps2).reshape(-1, 3), np.asarray(m.omega_ib_b_radps).reshape(-1, 3)]
    )
    for i, row in enumerate(rows):
        ring.append(t + i * m.period_s, row)


def _tacho(device: Device, topic: tp.Topic, estimator: str, t: float, m: pb.TachoRate) -> None:
    _ring(device, topic, estimator, 2, rate=100.0).append(t, [m.omega_radps, m.sigma_radps])


def _truth(device: Device, topic: tp.Topic, estimator: str, t: float, m: pb.Truth) -> None:
    row = _three(m.omega_ib_b_radps) + _three(m.f_b_mps2) + [m.angle_z_rad]
    _ring(device, topic, estimator, 7).append(t, row)


def _rate(device: Device, topic: tp.Topic, estimator: str, t: float, m: pb.RateEstimate) -> None:
    nis = m.nis if m.nis_dof else np.nan
    row = (
        _three(m.omega_ib_b_radps)
        + _sigmas(m.omega_covariance)
        + _three(m.f_b_mps2)
        + [m.angle_z_rad, nis]
    )
    row += _three(m.p_n_m) + _six(m.innovation) + _six(m.innovation_sigma) + [m.nis_dof]
    row += _three(m.sight) + _three(m.bound_sigma_radps) + [yaw_of(m.q_nb)]
    _ring(device, topic, estimator, 34).append(t, row)


def _nav(device: Device, topic: tp.Topic, estimator: str, t: float, m: pb.NavSolution) -> None:
    if len(m.p_ned_m) != 3 or m.mode < pb.NavSolution.MODE_COURSE:
        return
    device.origin = m.origin_latitude_deg, m.origin_longitude_deg, m.origin_height_m
    row = list(m.p_ned_m) + _three(m.v_n_mps) + _sigmas(m.position_covariance) + [yaw_of(m.q_nb)]
    if m.HasField("horizon"):
        row.append(m.horizon.n)
        if len(m.horizon.inputs) == 2 and len(m.horizon.membership) == 6:  # fuzzy
            row += [m.horizon.crisp, *m.horizon.inputs, *m.horizon.membership]
    _ring(device, topic, estimator, 20, rate=50.0).append(t, row)
    device.tracks.setdefault(f"nav/{estimator}", Track(spacing=0.3)).add(m.p_ned_m)


def _gnss(device: Device, topic: tp.Topic, estimator: str, t: float, m: pb.GnssFix) -> None:
    if m.quality == pb.GnssFix.QUALITY_NONE or (m.latitude_deg == 0.0 and m.longitude_deg == 0.0):
        return
    origin = device.origin or (m.latitude_deg, m.longitude_deg, m.height_m)
    p_n = ned_from_geodetic(m.latitude_deg, m.longitude_deg, m.height_m, origin)
    _ring(device, topic, estimator, 9, rate=10.0).append(t, list(p_n))
    if (
        device.origin is not None
    ):  # without an origin the fix would land in another frame than the trajectory
        device.tracks.setdefault("fixes", Track(spacing=0.5)).add(p_n)
        device.fixes[m.header.sequence] = tuple(p_n)
        if len(device.fixes) > FIXES_REMEMBERED:
            device.fixes.pop(next(iter(device.fixes)))


def _innovation(
    device: Device, topic: tp.Topic, estimator: str, t: float, m: pb.Innovation
) -> None:
    row = _six(m.value) + _six(m.sigma) + [m.nis] + _three(m.error_to_reference)
    row += _six(m.prediction_error)[:3] + _six(m.residual)[:3]
    _ring(device, topic, estimator, 22, rate=10.0).append(t, row)
    # A fix withheld on purpose is not accepted either, but it comes with its error.
    if (
        not m.accepted
        and not m.error_to_reference
        and estimator == device.estimators("innovation")[0]
    ):
        p_n = device.fixes.get(m.for_sequence)
        if p_n is not None:
            device.tracks.setdefault("rejected", Track(spacing=0.5)).add(p_n)


_ROWS = {
    "accel": _accel,
    "imu": _imu,
    "tacho": _tacho,
    "truth": _truth,
    "rate": _rate,
    "nav": _nav,
    "gnss": _gnss,
    "innovation": _innovation,
    **tilt_rows(_ring),
}
