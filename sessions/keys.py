"""What is known of one bus key while its messages are recorded: counts, jumps of the sequence, sources."""

from google.protobuf.message import DecodeError

from messages import gyrofree_pb2 as pb
from messages.topics import Address
from sessions.manifest import KeyCount


class KeyState:
    """What is known of one key while it is recorded: its channel, its counts, the last header."""

    __slots__ = (
        "channel", "device", "foreign", "last_run", "last_sequence", "sources",
        "messages", "lost", "restarts", "repeated", "unreadable",
    )  # fmt: skip

    def __init__(self, channel: int, address: Address) -> None:
        self.channel = channel
        self.device = address.device
        type_ = address.topic.type
        self.foreign = None if "header" in type_.DESCRIPTOR.fields_by_name else type_  # foxglove: time, no Header
        self.messages = self.lost = self.restarts = self.repeated = self.unreadable = 0  # plain: once per message
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
        )

    def publish_time(self, payload: bytes) -> int:
        """The payload's own time, ns since 1970, 0 when it says none; counts jumps of the sequence.

        Of our own messages only the header, which stands first, is parsed: the whole would cost more than recording it.
        """
        self.messages += 1
        try:
            if self.foreign is not None:
                return self.foreign.FromString(payload).timestamp.ToNanoseconds()
            header = pb.Header.FromString(_first_field(payload))
        except (DecodeError, ValueError):
            self.unreadable += 1
            return 0
        sequence, run = header.sequence, header.run
        if self.last_run is not None:
            jump = sequence - self.last_sequence
            if run != self.last_run or jump < 0:
                self.restarts += 1
            elif jump == 0:
                self.repeated += 1
            else:
                self.lost += jump - 1
        self.last_run, self.last_sequence = run, sequence
        self.sources.add(header.source)
        return header.utc_ns


def _first_field(payload: bytes) -> bytes:
    """Content of field 1 when it stands first and is length-delimited; raises ValueError otherwise."""
    if len(payload) < 2 or payload[0] != 0x0A:
        raise ValueError("field 1 does not stand first")
    size, at, shift = payload[1] & 0x7F, 2, 7
    while payload[at - 1] & 0x80:
        if at >= len(payload) or at > 4:
            raise ValueError("length of field 1 does not end")
        size |= (payload[at] & 0x7F) << shift
        at, shift = at + 1, shift + 7
    if at + size > len(payload):
        raise ValueError("field 1 is longer than the message")
    return payload[at : at + size]
