"""A room's door: what comes over the bus is looked at here, once, before anybody uses it.

A refusal is counted by its kind, of which there are few, and said in the log: of a device and kind
the 1st, 2nd, 4th, 8th ..., so that a flood stays readable. Nothing that comes in raises here.
"""

import logging
import math
import threading
import time
from collections import Counter
from typing import TypeVar

from google.protobuf.message import DecodeError, Message

from messages.contract import gyrofree_pb2 as pb
from messages.contract.checks import MESSAGE_BYTES, Refusal, check
from messages.contract.header import first_field
from messages.contract.topics import Address, Topic, TopicError, parse
from messages.text import plain

M = TypeVar("M", bound=Message)

REMEMBERED = 4096  # keys taken apart; a foreign publisher may make ever new ones
DEVICES = 256  # counted each for itself; those beyond are counted together
OTHERS = "others"


class Door:
    """The door of one room; may be used by several threads."""

    def __init__(
        self,
        room: str,
        most_devices: int = DEVICES,
        most_streams: int = 4096,
        gone_s: float = math.inf,
    ) -> None:
        """most_devices, most_streams: so many are let in, the first that come; a stream is a
        device's topic with its estimator. gone_s: a device silent for so long makes room.
        """
        self._gone_s = gone_s
        self._gone: list[str] = []
        self.refused: Counter[str] = Counter()  # kind -> messages
        self._log = logging.getLogger(room)
        self._most_devices, self._most_streams = most_devices, most_streams
        self._by_device: dict[str, Counter[str]] = {}
        self._addresses: dict[str, Address | None] = {}
        self._inside: dict[str, float] = {}  # devices, and when they were heard last
        self._streams: set[tuple[str, str, str]] = set()
        self._lock = threading.Lock()

    def refuse(self, key: str, refusal: Refusal, device: str = OTHERS) -> None:
        """Count one message that is not let in, and say so."""
        with self._lock:
            if device not in self._by_device and len(self._by_device) >= DEVICES:
                device = OTHERS
            self.refused[refusal.kind] += 1
            mine = self._by_device.setdefault(device, Counter())
            mine[refusal.kind] += 1
            n = mine[refusal.kind]
        if n & (n - 1) == 0:
            self._log.warning("%s: refused: %s (%d so far)", plain(key, 200), plain(refusal), n)

    def of(self, device: str) -> dict[str, int]:
        """What was refused of one device, by kind."""
        with self._lock:
            return dict(self._by_device.get(device, {}))

    def counts(self) -> dict[str, int]:
        """What was refused of all, by kind."""
        with self._lock:
            return dict(self.refused)

    def by_device(self) -> dict[str, dict[str, int]]:
        """What was refused, by device and kind; OTHERS: of devices that are none."""
        with self._lock:
            return {device: dict(counts) for device, counts in self._by_device.items()}

    def address(self, key: str) -> Address | None:
        """A key taken apart; None, and counted, for one that may not be."""
        if key in self._addresses:
            found = self._addresses[key]
        else:
            try:
                found = parse(key)
            except TopicError:
                found = None
            if len(self._addresses) >= REMEMBERED:
                self._addresses.clear()
            self._addresses[key] = found
        if found is None:
            self.refuse(key, Refusal("key", "key", repr(key[:80]), "one of docs/topics.md"))
        return found

    def admit(self, key: str, address: Address, size: int) -> bool:
        """Whether a message of so many bytes may be looked at: its size, and how many there are."""
        device, stream = address.device, (address.device, address.topic.name, address.estimator)
        if size > MESSAGE_BYTES:
            refusal = _size(size)
        elif stream in self._streams:
            self._inside[device] = time.monotonic()
            return True
        elif device not in self._inside and self._is_full():
            refusal = Refusal("many", "device", "one more", f"at most {self._most_devices}")
            device = OTHERS
        elif len(self._streams) >= self._most_streams:
            refusal = Refusal("many", "stream", "one more", f"at most {self._most_streams}")
            device = OTHERS
        else:
            self._inside[device] = time.monotonic()
            self._streams.add(stream)
            return True
        self.refuse(key, refusal, device)
        return False

    def too_large(self, key: str, size: int, most: int = MESSAGE_BYTES) -> None:
        """A message whose bytes were not even fetched."""
        self.refuse(key, _size(size, most), device_of(key))

    def gone(self) -> list[str]:
        """Devices that made room for others, each told once."""
        found, self._gone = self._gone, []
        return found

    def _is_full(self) -> bool:
        """Whether no device more may come; the one silent for longest goes if it has been so for
        long enough.
        """
        if len(self._inside) < self._most_devices:
            return False
        oldest = min(self._inside, key=lambda name: self._inside[name], default="")
        if oldest and time.monotonic() - self._inside[oldest] > self._gone_s:
            del self._inside[oldest]
            self._streams = {stream for stream in self._streams if stream[0] != oldest}
            self._gone.append(oldest)
            return False
        return True

    def header(self, address: Address, payload: bytes, key: str) -> bool:
        """Whether the header in front of a message may be believed; of the rest nothing is looked
        at. One that cannot be read is passed on: whoever takes the message counts it.
        """
        refusal = wrong_header(address.topic, payload, address.device)
        if refusal is not None:
            self.refuse(key, refusal, address.device)
        return refusal is None

    def message(self, address: Address, payload: bytes, key: str = "") -> Message | None:
        """The message in these bytes; None, and counted, for one that the contract does not allow,
        or that speaks in the name of another device than its key.
        """
        found, refusal = read(address.topic, payload, address.device)
        if refusal is not None:
            self.refuse(key or f"{address.device}/{address.topic.name}", refusal, address.device)
        return found


def device_of(key: str) -> str:
    """The device that a key is about; OTHERS where it names none."""
    try:
        return parse(key).device
    except TopicError:
        return OTHERS


def _size(size: int, most: int = MESSAGE_BYTES) -> Refusal:
    return Refusal("size", "message", f"{size} bytes long", f"at most {most}")


def wrong_header(topic: Topic, payload: bytes, device: str) -> Refusal | None:
    """What is wrong with the header in front of a message; None when nothing is, or nothing can be
    read.
    """
    if "header" not in topic.type.DESCRIPTOR.fields_by_name:
        return None
    try:
        header = pb.Header.FromString(first_field(payload))
    except (DecodeError, ValueError):
        return None
    wrong = check(header)
    if wrong:
        return wrong[0]._replace(field=f"header.{wrong[0].field}")
    if header.device and header.device != device:
        return Refusal("device", "header.device", header.device, device)
    return None


def read(topic: Topic[M], payload: bytes, device: str = "") -> tuple[M | None, Refusal | None]:
    """The message in these bytes, or why it is not taken; `device`: of the key it came on."""
    if len(payload) > MESSAGE_BYTES:
        return None, _size(len(payload))
    message = topic.type()
    try:
        message.ParseFromString(payload)
    except DecodeError:
        found = f"{len(payload)} bytes"
        return None, Refusal("bytes", "message", found, f"a {topic.type.__name__}")
    wrong = check(message)
    if wrong:
        return None, wrong[0]
    if device and "header" in message.DESCRIPTOR.fields_by_name:
        name = message.header.device
        if name and name != device:
            return None, Refusal("device", "header.device", name, device)
    return message, None
