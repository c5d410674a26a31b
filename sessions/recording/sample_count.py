"""Samples that are missing between the messages of a device, by their index and by its own clock.

A gateway counts what its line lost, but an imported log has no gateway, and a board that stops
sampling for a second and goes on counting has lost nothing by its index. So each batch is held
against the one before: the index must go on where that ended, and the device's clock by as many
periods as the index. What the stamps of a log mean, with their jitter and bursts, has been decided
before, by inertial/timing.py: it gives the samples their index.
"""

import struct

from google.protobuf.message import DecodeError

from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import Topic
from sessions.recording.samples import samples_in

INDEX, PERIOD = 0x10, 0x19  # tags of first_index and period_s, which follow the header
DOUBLE = struct.Struct("<d")
HOLE_S, HOLE_PERIODS = 0.05, 2.5  # the device's clock ahead of the index by more: a hole
MOST = 1 << 40  # samples; a jump beyond is another count and no hole


class SampleCount:
    """Of one key with batches of samples."""

    __slots__ = ("missing", "_topic", "_payload", "_place", "_usual", "_epoch")

    def __init__(self, topic: Topic) -> None:
        self.missing = 0
        self._topic = topic
        self._payload = b""  # of the batch before
        self._place: tuple[int, int] | None = None  # its first index and device time, us
        self._usual = 0  # samples from batch to batch, while all is well
        self._epoch = 0

    def take(self, payload: bytes, header: pb.Header, begin: int) -> None:
        """One batch; its header is read already and ends at byte `begin`."""
        index, period_s = _first_and_period(payload, begin)
        before, self._place = self._place, (index, header.device_us)
        last, self._payload = self._payload, payload
        if before is None or header.epoch != self._epoch:
            self._epoch = header.epoch
            return
        step = index - before[0]
        if not 0 < step < MOST:
            return  # counted anew
        if step != self._usual:
            n = self._samples(last)
            self.missing += max(0, step - n) if n else 0
            self._usual = n
        ahead_s = (header.device_us - before[1]) * 1e-6 - step * period_s
        if period_s > 0.0 and ahead_s > max(HOLE_S, HOLE_PERIODS * period_s):
            self.missing += min(round(ahead_s / period_s), MOST)

    def _samples(self, payload: bytes) -> int:
        try:
            return samples_in(self._topic, self._topic.type.FromString(payload))
        except DecodeError:
            return 0


def _first_and_period(payload: bytes, at: int) -> tuple[int, float]:
    """first_index and period_s, without parsing the rest; zero where they are not said."""
    index, shift = 0, 0
    if payload[at : at + 1] == bytes((INDEX,)):
        at += 1
        while at < len(payload) and shift < 64:
            byte = payload[at]
            index |= (byte & 0x7F) << shift
            at, shift = at + 1, shift + 7
            if byte < 0x80:
                break
    if payload[at : at + 1] == bytes((PERIOD,)) and at + 9 <= len(payload):
        return index, DOUBLE.unpack_from(payload, at + 1)[0]
    return index, 0.0
