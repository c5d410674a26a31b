"""Bytes of the board's line become frames, and every one of them is accounted for."""

from collections.abc import Iterator

from firmware_protocol.codec import Deframer, Frame
from firmware_protocol.ledger import Ledger


class Decoder:
    """One line: deframer and ledger."""

    def __init__(self) -> None:
        self._deframer = Deframer()
        self.ledger = Ledger()

    @property
    def pending(self) -> int:
        """Bytes in hand that are no whole frame yet."""
        return self._deframer.pending

    def feed(self, data: bytes) -> Iterator[Frame]:
        """The frames that these bytes complete; what is damaged is counted."""
        self.ledger.received(len(data))
        for event in self._deframer.feed(data):
            self.ledger.count(event)
            if isinstance(event, Frame):
                yield event

    def count_anew(self) -> None:
        """Count from here on, with half a frame in hand; the line itself goes on."""
        before = self.ledger
        self.ledger = Ledger(epoch=before.epoch, seq=before.seq, reboots=before.reboots)
        self.ledger.received(self.pending)
