"""Latest values and ring buffers of all devices, filled by the feed and read by the views.

Time is `header.utc_ns` in seconds after the first message of the device; whether a value is stale
is judged by when it arrived, because a replay carries the past's time. Every method that reads or
writes takes the store's lock briefly.
"""

import threading
import time

from google.protobuf.message import Message

from dashboard.data.device import HISTORY_S, Device, Latest
from dashboard.data.intake import INTAKE
from dashboard.data.replayed import Replayed
from messages.contract import gyrofree_pb2 as pb
from messages.contract import topics as tp

LATE_JOIN_S = 2.0  # repaired stretches nearer than this are one
MARKS = 200  # notes and marks of a device that are drawn
DEVICES = 64  # remembered; a foreign publisher cannot fill the memory
TOPICS = 512  # of one device, counted for each estimator
ANEW_S = 3600.0  # a step of the time stamps ahead after which the old axis is of no use


class Store:
    """All devices, the recorder, and the last log lines."""

    def __init__(self) -> None:
        self.lock = threading.RLock()
        self.devices: dict[str, Device] = {}
        self.recorder: Latest | None = None
        self.replay = Replayed()
        self.logs: list[tuple[float, str, str]] = []  # arrived, device, text
        self.dropped = 0  # messages the feed could not keep up with
        self.refused = 0  # messages of devices beyond DEVICES, or whose name is none

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
            if len(self.devices) >= DEVICES or not tp.NAME.fullmatch(name):
                self.refused += 1
                return
            known = self.devices[name] = Device(name, utc_ns)
        t = (utc_ns - known.utc0_ns) * 1e-9
        row, before = INTAKE.get(topic.name), known.get(topic.name, estimator)
        if before is None and len(known.latest) >= TOPICS:
            self.refused += 1
            return
        back = before is not None and before.t - t > 1.0
        if row is not None and utc_ns and (back or t - known.t_newest > ANEW_S):
            # A replay started over, or the first time stamps were not yet those of a clock: the old
            # axis is of no use.
            states = {key: one for key, one in known.latest.items() if key[0] not in INTAKE}
            known = Device(name, utc_ns, latest=states, generation=known.generation + 1)
            self.devices[name] = known
            t = 0.0
        known.run = message.header.run or known.run
        known.latest[topic.name, estimator] = Latest(message, arrived, t)
        if topic is tp.NOTE:
            _note(known, t, message)
        if row is not None:
            row(known, estimator, t, message)
            known.t_newest = max(known.t_newest, t)


def _stretch(late: list[list[float]], t: float) -> None:
    """Add a moment to a list of stretches."""
    for stretch in reversed(late[-20:]):
        if stretch[0] - LATE_JOIN_S <= t <= stretch[1] + LATE_JOIN_S:
            stretch[0], stretch[1] = min(stretch[0], t), max(stretch[1], t)
            return
    late.append([t, t])
    del late[:-100]


def _note(device: Device, t: float, m: pb.Note) -> None:
    at = (m.at_utc_ns - device.utc0_ns) * 1e-9 if m.at_utc_ns else t
    device.marks = [*device.marks, (at, m.text)][-MARKS:]
