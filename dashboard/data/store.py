"""Latest values and ring buffers of all devices, filled by the feed and read by the views.

Time is `header.utc_ns` in seconds after the first message of the device; whether a value is stale
is judged by when it arrived, because a replay carries the past's time. Every method that reads or
writes takes the store's lock briefly.
"""

import threading
import time
from collections.abc import Callable

from google.protobuf.message import Message

from dashboard.data.device import HISTORY_S, Device, Latest
from dashboard.data.fault import Alarm
from dashboard.data.intake import INTAKE
from dashboard.data.replayed import Replayed
from messages.bus.presence import Presence
from messages.contract import gyrofree_pb2 as pb
from messages.contract import topics as tp
from messages.contract.checks import Refusal
from messages.contract.door import OTHERS, Door

OF_DEVICES = tuple(
    t for t in tp.TOPICS if t not in (tp.STATUS, tp.REPLAY, tp.LOG, tp.HOLDER, tp.ORDER, tp.BEAT)
)
LATE_JOIN_S = 2.0  # repaired stretches nearer than this are one
THIN = 3.0  # periods of a preview between two rows, beyond which it was interrupted
THINNED = 200  # stretches of previews that are remembered
MARKS = 200  # notes and marks of a device that are drawn
DEVICES = 64  # remembered; a foreign publisher cannot fill the memory
GONE_S = 60.0  # a device silent for so long makes room for another
ESTIMATORS = 16  # of one device on one topic
MOST_BYTES = 1 << 30  # of all rings; beyond that they keep less of the past
SHARE = 8  # one part in so many of that is one device's, at most
AHEAD_S = (
    60.0  # a message this far ahead of the others, beyond the time that passed, is doubted ...
)
BACK_S = 1.0  # likewise, one so far behind the last of its kind
AGREES_S = 10.0  # ... until the next one of its kind agrees
ANEW_S = 3600.0  # a step of the time stamps ahead after which the old axis is of no use


class Store:
    """All devices, the recorder, and the last log lines."""

    def __init__(self, devices: int = DEVICES, most_bytes: int = MOST_BYTES) -> None:
        """devices: so many are shown; most_bytes: of memory for their past."""
        self._most_devices, self._most_bytes = devices, most_bytes
        self.door = Door("dashboard", most_devices=1 << 30, most_streams=1 << 30)
        self.lock = threading.RLock()
        self.devices: dict[str, Device] = {}
        self.recorder: Latest | None = None
        self.presence = Presence()
        self.own_faults: list[Alarm] = []  # of this place, where no service of alarms says them
        self.replay = Replayed()
        self.logs: list[tuple[float, str, str]] = []  # arrived, device, text
        self.dropped = 0  # messages the feed could not keep up with
        self.preview_hz = 0  # rows a second of a preview over a slow link; 0: everything comes

    @property
    def refused(self) -> int:
        """Messages that are not shown: too many, or not what the contract says; see `door`."""
        return sum(self.door.counts().values())

    def admit(self, topic: tp.Topic, device: str, estimator: str, arrived: float) -> str | None:
        """Whether there is room for what is said here; the name of a silent device that has to go
        for it, "" for none, None when there is no room. Refused messages are counted.
        """
        with self.lock:
            known = self.devices.get(device)
            gone = ""
            if known is not None:
                if (topic.name, estimator) in known.latest or not topic.per_estimator:
                    return ""
                if len(known.estimators(topic.name)) < ESTIMATORS:
                    return ""
                wanted = f"at most {ESTIMATORS} of a device"
                refusal, whose = Refusal("many", "estimators", "one more", wanted), device
            elif not tp.NAME.fullmatch(device):
                refusal, whose = Refusal("name", "device", repr(device[:80]), "a name"), OTHERS
            elif len(self.devices) < self._most_devices or topic not in OF_DEVICES:
                return ""
            else:
                oldest = min(self.devices.values(), key=lambda one: one.heard)
                if arrived - oldest.heard > GONE_S:
                    gone = oldest.name
                    del self.devices[gone]
                    return gone
                wanted = f"at most {self._most_devices}"
                refusal, whose = Refusal("many", "devices", "one more", wanted), OTHERS
        self.door.refuse(f"{device}/{topic.name}", refusal, whose)
        return None

    def _may_grow(self, device: str) -> Callable[[int], bool]:
        """For the rings of a device: is there memory for more? Asked when they double."""

        def may_grow(more: int) -> bool:
            used = {name: one.nbytes for name, one in self.devices.items()}
            share = self._most_bytes // SHARE
            return (
                used.get(device, 0) + more <= share
                and sum(used.values()) + more <= self._most_bytes
            )

        return may_grow

    def names(self) -> list[str]:
        """Devices heard so far, in the order of their names."""
        with self.lock:
            return sorted(self.devices)

    def device(self, name: str) -> Device | None:
        """A device; read it under the lock."""
        with self.lock:
            return self.devices.get(name)

    def recorded_s(self, device: str, now: float | None = None) -> float | None:
        """How long the recording, or the replay that a device is of, has gone on, s; None when
        there is neither. Call under the lock.
        """
        now = time.monotonic() if now is None else now
        if self.replay.state(device, now):
            return self.replay.status.position_s if self.replay.status else None
        if self.recorder is None or not self.recorder.message.recording:
            return None
        return self.recorder.message.seconds + self.recorder.age(now)

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
        self,
        name: str,
        messages: list[tuple[tp.Topic, str, Message]],
        repaired: bool,
        every_s: float = 0.0,
    ) -> None:
        """Take in older messages of a device: what the bus had lost (`repaired`), or what was
        before we listened; every_s: an overview, of one row in so many seconds.
        """
        with self.lock:
            known = self.devices.get(name)
            if known is None:
                return
            shadow = Device(name, known.utc0_ns, latest=known.latest, origin=known.origin)
            shadow.rings = {key: ring.like() for key, ring in known.rings.items()}
            for topic, estimator, message in messages:
                if "header" not in message.DESCRIPTOR.fields_by_name:
                    continue
                message.header.late = True
                t = (message.header.utc_ns - known.utc0_ns) * 1e-9
                if abs(t - known.t_newest) > HISTORY_S:
                    continue
                row = INTAKE.get(topic.name)
                if row is not None:
                    row(shadow, estimator, t, message)
                    if every_s:
                        _thin(known, t, every_s)
                    known.t_first = min(known.t_first, t)
                    if repaired and topic in (tp.ACCEL, tp.IMU):
                        _stretch(known.late, t)
                elif topic is tp.NOTE:
                    _note(known, t, message)
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
            if self.admit(topic, name, estimator, arrived) is None:
                return
            known = self.devices[name] = Device(name, utc_ns, may_grow=self._may_grow(name))
        t = (utc_ns - known.utc0_ns) * 1e-9
        row, before = INTAKE.get(topic.name), known.get(topic.name, estimator)
        if before is None and self.admit(topic, name, estimator, arrived) is None:
            return
        if row is not None and utc_ns and self._doubted(known, topic, estimator, utc_ns, arrived):
            return
        back = before is not None and before.t - t > BACK_S
        if row is not None and utc_ns and (back or t - known.t_newest > ANEW_S):
            # A replay started over, or the first time stamps were not yet those of a clock: the old
            # axis is of no use.
            states = {key: one for key, one in known.latest.items() if key[0] not in INTAKE}
            known = Device(
                name,
                utc_ns,
                latest=states,
                generation=known.generation + 1,
                may_grow=known.may_grow,
            )
            self.devices[name] = known
            t = 0.0
        known.run = message.header.run or known.run
        known.latest[topic.name, estimator] = Latest(message, arrived, t)
        if topic is tp.NOTE:
            _note(known, t, message)
        if row is not None:
            row(known, estimator, t, message)
            known.t_newest = max(known.t_newest, t)
            if self.preview_hz:
                _thin(known, t, 1.0 / self.preview_hz)

    def _doubted(
        self, known: Device, topic: tp.Topic, estimator: str, utc_ns: int, arrived: float
    ) -> bool:
        """A single message of another time would move the whole picture there: it takes two that
        agree.
        """
        key = (topic.name, estimator)
        ahead_s = (utc_ns - known.utc0_ns) * 1e-9 - known.t_newest
        passed_s = arrived - known.heard if known.latest else 0.0
        before = known.doubted.pop(key, None)
        newest = known.get(*key)
        back_s = 0.0 if newest is None else newest.t - (utc_ns - known.utc0_ns) * 1e-9
        if not known.rings or (back_s <= BACK_S and ahead_s < AHEAD_S + max(passed_s, 0.0)):
            return False
        if before is not None and abs(utc_ns - before) < AGREES_S * 1e9:
            return False
        known.doubted[key] = utc_ns
        found = f"{ahead_s:.0f} s from the newest"
        refusal = Refusal("time", "header.utc_ns", found, "a second message that agrees")
        self.door.refuse(f"{known.name}/{topic.name}", refusal, known.name)
        return True


def _stretch(late: list[list[float]], t: float) -> None:
    """Add a moment to a list of stretches."""
    for stretch in reversed(late[-20:]):
        if stretch[0] - LATE_JOIN_S <= t <= stretch[1] + LATE_JOIN_S:
            stretch[0], stretch[1] = min(stretch[0], t), max(stretch[1], t)
            return
    late.append([t, t])
    del late[:-100]


def _thin(device: Device, t: float, every_s: float) -> None:
    """Around t there is one row in every_s at most, and what lies between is no gap."""
    reach = THIN * every_s
    for one in reversed(device.thin[-20:]):
        if one[2] == every_s and one[0] - reach <= t <= one[1] + reach:
            one[0], one[1] = min(one[0], t), max(one[1], t)
            return
    device.thin = [*device.thin, [t, t, every_s]][-THINNED:]


def _note(device: Device, t: float, m: pb.Note) -> None:
    at = (m.at_utc_ns - device.utc0_ns) * 1e-9 if m.at_utc_ns else t
    device.marks = [*device.marks, (at, m.text)][-MARKS:]
