"""Bytes of the board's line become frames, and every one of them is accounted for."""

from collections.abc import Iterator

from firmware_protocol.codec import Deframer, Frame
from firmware_protocol.ledger import Ledger
from gateway.board.frame_door import FrameDoor


class Decoder:
    """One line: deframer, door and ledger."""

    def __init__(self, door: FrameDoor) -> None:
        self._deframer, self._door = Deframer(), door
        self.ledger = Ledger()

    @property
    def pending(self) -> int:
        """Bytes in hand that are no whole frame yet."""
        return self._deframer.pending + self._door.pending

    def feed(self, data: bytes, received_ns: int) -> Iterator[Frame]:
        """The frames that these bytes complete; what is damaged or not believed is counted."""
        self.ledger.received(len(data))
        for event in self._deframer.feed(data):
            if not isinstance(event, Frame):
                self.ledger.count(event)
                continue
            good, refused = self._door.take(event, received_ns)
            for frame in refused:
                self.ledger.pass_over(frame)
            for frame in good:
                self.ledger.count(frame)
                yield frame

    def wait(self, now_ns: int) -> Iterator[Frame]:
        """Frames that need no other one any more, because none has come."""
        for frame in self._door.wait(now_ns):
            self.ledger.count(frame)
            yield frame

    def count_anew(self) -> None:
        """Count from here on, with half a frame in hand; the line itself goes on."""
        before = self.ledger
        self.ledger = Ledger(epoch=before.epoch, seq=before.seq, reboots=before.reboots)
        self.ledger.received(self.pending)
