"""What a bystander on the bus hears: the newest word of everybody, and when it came."""

import threading
import time

from faults.account import DEVICE
from messages.bus import orders
from messages.bus.fencing import Fence
from messages.bus.session import BusSettings, open_client, subscribe
from messages.contract import gyrofree_pb2 as pb
from messages.contract import rates
from messages.contract.topics import ACCEL, ALARM, BOARD, ESTIMATOR, LINK, RATE, RECORDER, STATUS

BEHIND = 100  # samples that an estimate may be behind the newest sample of a well bench
ORDER_S = 30.0
ESTIMATORS = ("least-squares", "products-ekf")


class Watch:
    """Listens until it is closed."""

    def __init__(self, bus: BusSettings) -> None:
        self._prefix = bus.prefix
        self.session = open_client(bus)
        self._lock = threading.Lock()
        self._heard: dict[str, tuple[int, object]] = {}  # monotonic ns, message
        self._rates: dict[str, tuple[int, int]] = {}  # boot and index of the newest estimate
        self._recorded = False  # a recording was ordered
        self.durable: dict[str, int] = {}  # by session the messages that were acknowledged
        self.recording: list[str] = []  # sessions, in the order in which they began
        self.alarms: set[str] = set()  # ids that were ever active since `begin`
        self.links: list[pb.LinkStatus] = []  # since `begin`
        self.states: list[pb.RecorderStatus] = []  # likewise
        self.filters: list[pb.EstimatorStatus] = []  # likewise
        fence = Fence(lambda *_: None)  # only who serves is listened to
        self._held = [
            fence.declare(self.session, bus.prefix),
            *(
                subscribe(self.session, topic, bus.prefix, take, DEVICE, fence)
                for topic, take in (
                    (ACCEL, self._on_any("accel")),
                    (BOARD, self._on_any("board")),
                    (RATE, self._on_rate),
                    (LINK, self._on_link),
                    (ESTIMATOR, self._on_filter),
                    (ALARM, self._on_alarms),
                )
            ),
            subscribe(self.session, STATUS, bus.prefix, self._on_status, RECORDER, fence),
        ]

    def begin(self) -> None:
        """Forget what was said so far."""
        with self._lock:
            self.alarms.clear()
            self.links.clear()
            self.states.clear()
            self.filters.clear()
            self.recording.clear()

    def newest(self, name: str) -> object | None:
        """The newest message of a topic."""
        return self._heard[name][1] if name in self._heard else None

    def age_s(self, name: str) -> float:
        """Since then; infinite where there was none."""
        at = self._heard.get(name, (0, None))[0]
        return (time.monotonic_ns() - at) * 1e-9 if at else float("inf")

    def well(self, since_ns: int) -> bool:
        """Are samples estimated, and is what is recorded without a gap, by words after that?"""
        names = ("accel", "link", "status")
        if any(self._heard.get(name, (0, None))[0] <= since_ns for name in names):
            return False
        accel, link, status = (self._heard[name][1] for name in names)
        behind = [
            boot != accel.header.epoch or accel.first_index - index > BEHIND
            for boot, index in self._rates.values()
        ]
        whole = status.recording == self._recorded and not status.repairing
        return link.connected and bool(behind) and not any(behind) and whole

    def record(self, name: str) -> None:
        """Begin a session; raises orders.OrderError."""
        order = pb.RecorderCommand(action=pb.RecorderCommand.ACTION_START, name=name, user="faults")
        orders.give(self.session, self._prefix, orders.RECORDER, order, timeout_s=ORDER_S)
        self._recorded = True

    def stop(self) -> None:
        """End it; raises orders.OrderError."""
        self._recorded = False
        order = pb.RecorderCommand(action=pb.RecorderCommand.ACTION_STOP, user="faults")
        orders.give(self.session, self._prefix, orders.RECORDER, order, timeout_s=ORDER_S)

    def close(self) -> None:
        """Leave."""
        self.session.close()

    def _note(self, name: str, message: object) -> None:
        self._heard[name] = (time.monotonic_ns(), message)

    def _on_any(self, name: str):
        return lambda _, message: self._note(name, message)

    def _on_rate(self, key: str, message: pb.RateBatch) -> None:
        last = message.for_index + rates.count(message) - 1
        if key.rpartition("/")[2] in ESTIMATORS:
            self._rates[key] = (message.header.epoch, last)

    def _on_link(self, _: str, message: pb.LinkStatus) -> None:
        self._note("link", message)
        self.links.append(message)

    def _on_filter(self, _: str, message: pb.EstimatorStatus) -> None:
        self.filters.append(message)

    def _on_status(self, _: str, message: pb.RecorderStatus) -> None:
        self._note("status", message)
        self.states.append(message)
        if message.recording and message.session not in self.recording:
            self.recording.append(message.session)
        known = self.durable.get(message.session, 0)
        self.durable[message.session] = max(known, message.durable_messages)

    def _on_alarms(self, _: str, message: pb.AlarmStatus) -> None:
        self._note("alarm", message)
        with self._lock:
            self.alarms |= {one.id for one in message.alarms if one.active}
            self.active = {one.id for one in message.alarms if one.active}
