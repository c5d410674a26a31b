"""The state of a line in one message a second: ledger, clock, journal, latency, and what is wrong
with its remedy.
"""

import time
from collections import deque
from typing import TYPE_CHECKING

from messages.contract import gyrofree_pb2 as pb

if TYPE_CHECKING:
    from gateway.board.device import DeviceLink

UNREADABLE_S = 2.0  # bytes but no frame for so long: not our protocol, or not our speed
UNREADABLE_BYTES = 100
BEHIND_CHUNKS = 2000
CRYSTAL_PPM = 1000.0  # no crystal is this far off


class LinkReport:
    """Counts what the ledger does not, and writes LinkStatus."""

    def __init__(self, link: "DeviceLink") -> None:
        self._link = link
        self.samples = 0
        self.latency_ns: deque[int] = deque(maxlen=4096)
        self._at = time.monotonic()
        self._samples_at = 0
        self._frames_at = 0
        self._bytes_at = 0
        self._frames_seen = 0
        self._unreadable_since: float | None = None

    def message(self) -> pb.LinkStatus:
        """The state now, without its header; rates and latency since the last call."""
        link, ledger = self._link, self._link.ledger
        now = time.monotonic()
        passed = max(now - self._at, 1e-3)
        latency = sorted(self.latency_ns)
        self.latency_ns.clear()
        status = pb.LinkStatus(
            connected=link.readers[0].connected,
            port=link.device.port,
            message="; ".join(self._complaints(now)),
            bytes_in=ledger.bytes_in,
            good_frames=ledger.good_frames,
            good_bytes=ledger.good_bytes,
            bad_chunks=ledger.bad_chunks,
            bad_bytes=ledger.bad_bytes,
            pending_bytes=link.deframer.pending,
            lost_frames=ledger.lost_frames,
            device_dropped=ledger.device_dropped,
            lost_samples=ledger.lost_samples,
            reboots=ledger.reboots,
            unknown_frames=ledger.unknown_frames,
            reconnects=sum(reader.reconnects for reader in link.readers),
            sample_rate_hz=(self.samples - self._samples_at) / passed,
            frame_rate_hz=(ledger.good_frames - self._frames_at) / passed,
            latency_p50_s=_quantile(latency, 0.50) / 1e9,
            latency_p99_s=_quantile(latency, 0.99) / 1e9,
            clock_skew_ppm=link.clock.skew_ppm,
            clock_residual_s=link.clock.residual_s,
            clock_window_s=link.clock.span_s,
            journal_sequence=link.journal.last_seq,
            durable_sequence=link.journal.durable_seq,
            published_sequence=link.spool.journal.last_seq,
            published_durable=link.spool.journal.durable_seq,
            gnss_good=link.gnss.decoder.good,
            gnss_bad=link.gnss.decoder.bad,
            damage=ledger.damage,
        )
        self._at, self._samples_at, self._frames_at = now, self.samples, ledger.good_frames
        return status

    def _complaints(self, now: float) -> list[str]:
        link = self._link
        found = [reader.message for reader in link.readers if reader.message]
        if self._unreadable(now):
            found.append(
                f"{link.device.port}: bytes come but no frame can be read; most likely the speed is"
                f" wrong: set `baud` to the board's (now {link.device.baud})"
            )
        if link.journal.message:
            found.append(link.journal.message)
        elif link.spool.journal.message:
            found.append(link.spool.journal.message)
        if abs(link.clock.skew_ppm) > CRYSTAL_PPM:
            scale = link.device.time_scale * (1.0 + link.clock.skew_ppm * 1e-6)
            found.append(
                f"the board's clock runs {scale:.2f} times as fast as the host's: a log played at"
                f" that speed wants `time_scale = {scale:.2f}`, a real board is faulty"
            )
        if link.queue.qsize() > BEHIND_CHUNKS:
            found.append(
                f"{link.queue.qsize()} reads wait to be decoded: this machine is too slow for the"
                " line"
            )
        return found

    def _unreadable(self, now: float) -> bool:
        """True when bytes have been coming for UNREADABLE_S and none of them made a frame."""
        ledger = self._link.ledger
        if ledger.good_frames != self._frames_seen or not self._link.readers[0].connected:
            self._frames_seen = ledger.good_frames
            self._unreadable_since, self._bytes_at = None, ledger.bytes_in
            return False
        if ledger.bytes_in - self._bytes_at < UNREADABLE_BYTES:
            return False
        if self._unreadable_since is None:
            self._unreadable_since = now
        return now - self._unreadable_since >= UNREADABLE_S


def _quantile(ordered: list[int], q: float) -> float:
    return float(ordered[min(len(ordered) - 1, int(q * len(ordered)))]) if ordered else 0.0
