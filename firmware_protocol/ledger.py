"""What a receiver can prove about a link, counted from the events of one `Deframer`.

    bytes in  = bytes of good frames + bytes of bad chunks + bytes pending
    lost      = sum of the gaps in seq;  bad chunks are not losses
    link loss = lost - dropped by the device itself, from one STATUS to the next
    lost samples = gaps in first_index

Not provable: what was lost before the first frame, before the first frame after a reboot, and
behind the last frame (STATUS bounds that to 1 s); damage before the CRC was made.
"""

import logging
import struct
from collections import Counter
from dataclasses import dataclass, field

from firmware_protocol.codec import Damaged, Event, Frame
from firmware_protocol.frames import Status
from firmware_protocol.spec import SPEC

log = logging.getLogger(__name__)

WRAP = 1 << 32
_FIRST = struct.Struct("<I")
_INDEXED = {
    type_: layout.offsets["n"]
    for type_, layout in SPEC.layouts.items()
    if layout.fields and layout.fields[0].name in ("first_index", "first_pulse")
}
"""Types whose payload starts with an index that counts on, and where their number of samples
stands.
"""
_PULSES = frozenset(t for t in _INDEXED if SPEC.layouts[t].fields[0].name == "first_pulse")


@dataclass
class Ledger:
    """Counters of one link.  `received` for every read, `count` for every event; the rest is read
    only.
    """

    bytes_in: int = 0
    good_frames: int = 0
    good_bytes: int = 0
    bad_chunks: int = 0
    bad_bytes: int = 0
    lost_frames: int = 0
    """Gaps in seq: frames the device built and we did not receive."""
    device_dropped: int = 0
    """Those of them the device says it dropped itself (STATUS)."""
    link_lost: int = 0
    """Those of them lost on the way; exact at each STATUS, from the first one on."""
    lost_samples: int = 0
    lost_pulses: int = 0
    repeated_frames: int = 0
    """Frames with the seq of the frame before them."""
    reboots: int = 0
    unknown_frames: int = 0
    refused_frames: int = 0
    """Whole frames whose values cannot be; nothing but their bytes is counted."""
    frames: Counter[int] = field(default_factory=Counter)
    """Good frames per type."""
    damage: Counter[str] = field(default_factory=Counter)
    """Bad chunks per reason, words of `codec.REASONS`."""

    epoch: int | None = None
    seq: int | None = None
    _next_index: dict[int, int] = field(default_factory=dict, repr=False)
    _at_status: tuple[int, int] | None = field(default=None, repr=False)
    _warned_version: bool = field(default=False, repr=False)

    def received(self, n_bytes: int) -> None:
        """Count a read before it goes into the deframer."""
        self.bytes_in += n_bytes

    def unaccounted(self, pending: int) -> int:
        """Bytes in that are neither in an event nor pending; anything but 0 is a bug of ours."""
        return self.bytes_in - self.good_bytes - self.bad_bytes - pending

    def count(self, event: Event) -> None:
        """Count one event."""
        if isinstance(event, Damaged):
            self._count_damage(event)
        else:
            self._count_frame(event)

    def pass_over(self, frame: Frame) -> None:
        """Count a whole frame that is not believed: it came, and all else it says is left."""
        self.good_frames += 1
        self.good_bytes += frame.wire_size
        self.refused_frames += 1
        if frame.epoch == self.epoch and (frame.seq - self.seq) % WRAP == 1:
            self.seq = frame.seq

    def _count_damage(self, event: Damaged) -> None:
        self.bad_chunks += 1
        self.bad_bytes += len(event.data)
        self.damage[event.reason] += 1
        if event.reason == "version" and not self._warned_version:
            self._warned_version = True
            log.warning(
                "frames of another protocol version (%s) are counted and skipped: install the"
                " gyrofree that matches the board's firmware; said once",
                event.detail,
            )

    def _count_frame(self, frame: Frame) -> None:
        self.good_frames += 1
        self.good_bytes += frame.wire_size
        self.frames[frame.type] += 1
        if frame.type not in SPEC.layouts:
            self.unknown_frames += 1
        self._follow_seq(frame)
        if frame.type in _INDEXED:
            self._follow_index(frame)
        elif frame.type == Status.TYPE:
            self._settle(frame.payload.dropped)

    def _follow_seq(self, frame: Frame) -> None:
        if frame.epoch != self.epoch:
            self._start_epoch(frame, reboot=self.epoch is not None)
        else:
            step = (frame.seq - self.seq) % WRAP
            if step == 0:
                self.repeated_frames += 1
            elif step < WRAP // 2:
                self.lost_frames += step - 1
            else:  # backwards: a device that lost its boot counter, or a file played again
                self._start_epoch(frame, reboot=True)
        self.seq = frame.seq

    def _start_epoch(self, frame: Frame, reboot: bool) -> None:
        self.reboots += reboot
        self.epoch = frame.epoch
        self._next_index.clear()
        # From frame 0 on we have heard everything; else the first STATUS is the base of the
        # device's own count.
        self._at_status = (self.lost_frames, 0) if frame.seq == 0 else None

    def _follow_index(self, frame: Frame) -> None:
        (first,) = _FIRST.unpack_from(frame.raw)
        expected = self._next_index.get(frame.type, first)
        gap = (first - expected) % WRAP
        if gap < WRAP // 2:  # backwards is a stream that started again: nothing is known to be lost
            if frame.type in _PULSES:
                self.lost_pulses += gap
            else:
                self.lost_samples += gap
        self._next_index[frame.type] = (first + frame.raw[_INDEXED[frame.type]]) % WRAP

    def _settle(self, dropped: int) -> None:
        """At a STATUS: split what was lost since the last one into dropped by the device and lost
        on the link.
        """
        if self._at_status is not None:
            lost_before, dropped_before = self._at_status
            newly_dropped = (dropped - dropped_before) % WRAP
            self.device_dropped += newly_dropped
            self.link_lost += self.lost_frames - lost_before - newly_dropped
        self._at_status = (self.lost_frames, dropped)
