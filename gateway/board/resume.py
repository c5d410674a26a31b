"""A killed gateway goes on where it was: in the middle of a frame, with the next sample that nobody
has seen.

Its raw journal has every byte that was read. The bytes of the last seconds are decoded again: that
brings back the half frame at their end, the board's HELLO, its clock, the sample index and the
tachometer, and gives what had been read but not published yet. What had been published stands in
the journal of published messages, and is passed over.

Only for a port that stayed open (keeper.py); over one that was opened anew, bytes are missing in
between.
"""

import struct
import time
from collections.abc import Iterator

from google.protobuf.message import DecodeError, Message

from firmware_protocol.frames import Acc12, Adc, Imu6
from gateway.board.outgoing import Put
from gateway.ports.reader import Chunk
from gateway.samples.batch import Batch
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import ACCEL, ADC, BY_NAME, GNSS, IMU, LOCATION, Topic
from messages.history.journal import Journal
from messages.history.journal_file import Record
from messages.history.spool import Spool
from messages.history.spool_file import entry_of

REACH_S = 12.0  # a board says HELLO every ten seconds
REACH_BYTES = 1 << 20
PUBLISHED_BYTES = 1 << 18
MARGIN_S = 1.5  # read so long before the last published samples: surely published as well
SAME_US = 5_000  # two reports of one instant, by clocks learnt from different points
TOPIC_OF = {Acc12: ACCEL, Imu6: IMU, Adc: ADC}


class Past:
    """What an earlier life has published of each topic, to publish on behind it."""

    def __init__(self, spool: Spool, put: Put) -> None:
        self._put = put
        self._last: dict[
            str, tuple[int, int]
        ] = {}  # topic -> boot, and next sample index or newest device time, us
        self._reached: set[str] = set()  # topics whose last boot the bytes have come to
        self._gnss_is_new = False
        self.read_ns = (
            0  # monotonic time of the read whose samples were published last; 0: none were
        )
        for record in spool.journal.tail(PUBLISHED_BYTES):
            try:
                entry = entry_of(record)
                topic = BY_NAME.get(entry.topic)
                if topic is not None and topic is not LOCATION:
                    message = topic.type.FromString(entry.payload)
                    self._last[topic.name] = _place(message)
                    self.read_ns = max(
                        self.read_ns, message.received_ns if topic in TOPIC_OF.values() else 0
                    )
            except (DecodeError, struct.error, UnicodeDecodeError):
                continue  # what cannot be read cannot be passed over either

    def has(self, kind: type, epoch: int, batch: Batch) -> bool:
        """True for a frame's samples that have been published."""
        return self._is_old(TOPIC_OF[kind], epoch, batch.first_index + batch.n - 1)

    def put(self, topic: Topic, device: str, message: Message) -> None:
        """Publish what is new."""
        if topic is LOCATION:  # has no header, and goes with the fix before it
            new = self._gnss_is_new
        elif topic in TOPIC_OF.values():
            new = True  # `has` was asked before
        else:
            new = not self._is_old(topic, message.header.epoch, message.header.device_us - SAME_US)
        if topic is GNSS:
            self._gnss_is_new = new
        if new:
            self._put(topic, device, message)

    def _is_old(self, topic: Topic, epoch: int, place: int) -> bool:
        known = self._last.get(topic.name)
        if known is None:
            return False
        if epoch != known[0]:
            return topic.name not in self._reached  # a boot before that one, or after it
        self._reached.add(topic.name)
        return place < known[1]


def _place(message: Message) -> tuple[int, int]:
    """Boot, and where its topic goes on behind this message: next sample index, else device time,
    us.
    """
    if isinstance(message, pb.AccelBatch):
        return message.header.epoch, message.first_index + len(message.counts) // max(
            1, message.axes
        )
    if isinstance(message, pb.ImuBatch):
        return message.header.epoch, message.first_index + len(message.f_b_mps2) // 3
    if isinstance(message, pb.AdcBatch):
        return message.header.epoch, message.first_index + len(message.counts) // max(
            1, message.channels
        )
    return message.header.epoch, message.header.device_us + 1


def unseen(past: Past, journal: Journal) -> list[Record]:
    """Raw reads from REACH_S before the last published one on, however far decoding was behind;
    oldest first.
    """
    since = min(past.read_ns, time.monotonic_ns()) - REACH_S * 1e9
    found = journal.tail(REACH_BYTES)
    if found and found[0].monotonic_ns > since:
        found = journal.tail(16 * REACH_BYTES)
    return [record for record in found if record.monotonic_ns >= since]


def again(past: Past, records: list[Record]) -> Iterator[tuple[Put | None, Chunk]]:
    """The raw `records` as reads, each with where its messages go: nowhere as long as they were
    published for sure, then to `past`, which passes over what it knows.
    """
    for record in records:
        sure = record.monotonic_ns < past.read_ns - MARGIN_S * 1e9
        chunk = Chunk(record.channel, record.data, record.monotonic_ns)
        yield None if sure else past.put, chunk
