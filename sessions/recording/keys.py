"""What is known of one bus key while its messages are recorded: counts, jumps of the sequence,
sources.
"""

from google.protobuf.message import DecodeError

from messages.contract import gyrofree_pb2 as pb
from messages.contract.door import OTHERS
from messages.contract.header import first_field
from messages.contract.topics import ACCEL, ADC, IMU, Address
from messages.history.mending_state import FARTHEST
from sessions.recording.manifest import KeyCount
from sessions.recording.sample_count import SampleCount

SAMPLED = (ACCEL, IMU, ADC)


class KeyState:
    """What is known of one key while it is recorded: its channel, its counts, the last header."""

    __slots__ = (
        "channel",
        "device",
        "foreign",
        "last_run",
        "last_sequence",
        "sources",
        "messages",
        "lost",
        "restarts",
        "repeated",
        "unreadable",
        "repaired",
        "samples",
        "dark_us",
        "_last_us",
        "_step_us",
        "_last_epoch",
    )

    def __init__(self, channel: int, address: Address) -> None:
        self.channel = channel
        self.device = address.device
        type_ = address.topic.type
        self.foreign = (
            None if "header" in type_.DESCRIPTOR.fields_by_name else type_
        )  # foxglove: time, no Header
        self.messages = self.lost = self.restarts = self.repeated = self.unreadable = (
            0  # plain: once per message
        )
        self.repaired = self.dark_us = self._last_us = self._step_us = 0
        self._last_epoch: int | None = None
        self.samples = SampleCount(address.topic) if address.topic in SAMPLED else None
        self.last_run: int | None = None
        self.last_sequence = 0
        self.sources: set[int] = set()

    @property
    def count(self) -> KeyCount:
        """The counts as session.json has them."""
        return KeyCount(
            messages=self.messages,
            lost=self.lost,
            restarts=self.restarts,
            repeated=self.repeated,
            unreadable=self.unreadable,
            repaired=self.repaired,
            missing_samples=0 if self.samples is None else self.samples.missing,
            dark_s=self.dark_us * 1e-6,
            last_run=self.last_run or 0,
            last_sequence=self.last_sequence,
        )

    def publish_time(self, payload: bytes, late: bool = False) -> int:
        """The payload's own time, ns since 1970, 0 when it says none; counts jumps of the sequence.

        Of our own messages only the header, which stands first, is parsed: the whole would cost
        more than recording it.
        """
        self.messages += 1
        self.repaired += late
        try:
            if self.foreign is not None:
                at = self.foreign.FromString(payload).timestamp
                return at.seconds * 1_000_000_000 + at.nanos  # what is no time, the store sees
            front = first_field(payload)
            header = pb.Header.FromString(front)
        except (DecodeError, ValueError):
            self.unreadable += 1
            return 0
        sequence, run = header.sequence, header.run
        if self.last_run is not None:
            jump = sequence - self.last_sequence
            if run != self.last_run or not 0 <= jump <= FARTHEST:
                self.restarts += 1
                # The same boot: the board's own clock says how long nobody spoke. One that took the
                # port over as it was goes on at the usual step.
                gap = header.device_us - self._last_us
                if header.epoch == self._last_epoch and gap > 2 * self._step_us:
                    self.dark_us += gap - self._step_us
            elif jump == 0:
                self.repeated += 1
            else:
                self.lost += jump - 1
        self.last_run, self.last_sequence = run, sequence
        self._step_us = max(0, header.device_us - self._last_us)
        self._last_epoch, self._last_us = header.epoch, header.device_us
        self.sources.add(header.source)
        if self.samples is not None:
            head = len(front) + (2 if len(front) < 0x80 else 3)  # tag and length stand before it
            self.samples.take(payload, header, head)
        return header.utc_ns


def largest(counts: dict[str, int], most: int = 200) -> dict[str, int]:
    """The largest counts above 0, and what all others come to: a status has to stay short."""
    found = sorted(((n, key) for key, n in counts.items() if n), reverse=True)
    rest = sum(n for n, _ in found[most:])
    return {key: n for n, key in found[:most]} | ({OTHERS: rest} if rest else {})
