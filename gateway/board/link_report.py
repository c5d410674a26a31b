"""The state of a line in one message a second: ledger, clock, journal, latency, and what is wrong
with its remedy.
"""

import time
from collections.abc import Sequence

from gateway.board.decoder import Decoder
from gateway.gnss.flow import GnssFlow
from gateway.ports.reader import Reader
from gateway.samples.flow import SampleFlow
from gateway.settings import DeviceSettings
from gateway.time.clock import DeviceClock
from gateway.time.wall import WallClock
from messages.contract import gyrofree_pb2 as pb
from messages.contract.door import Door
from messages.history.journal import Journal
from messages.history.spool import Spool

UNREADABLE_S = 2.0  # bytes but no frame for so long: not our protocol, or not our speed
UNREADABLE_BYTES = 100
REFUSED_TOLD_S = 60.0  # that something was refused is said for so long
HELD_TOLD_S = 10.0  # that reading had to wait is said for so long
BEHIND_CHUNKS = 2000
CRYSTAL_PPM = 1000.0  # no crystal is this far off
TOLD_S = 60.0  # that this process was stopped is said for so long


class LinkReport:
    """Counts what the ledger does not, and writes LinkStatus."""

    def __init__(
        self,
        device: DeviceSettings,
        decoder: Decoder,
        samples: SampleFlow,
        gnss: GnssFlow,
        clock: DeviceClock,
        journal: Journal,
        spool: Spool,
        door: Door,
        wall: WallClock,
    ) -> None:
        self._door, self._refused, self._refused_at = door, 0, -REFUSED_TOLD_S
        self._device, self._decoder, self._samples, self._gnss = device, decoder, samples, gnss
        self._clock, self._journal, self._published = clock, journal, spool.journal
        self._wall = wall
        self._stops, self._stopped_s = 0, 0.0  # times that this process did not run
        self._stopped_at: float | None = None
        self._last_stop_s = 0.0
        self._at = time.monotonic()
        self._samples_at = 0
        self._frames_at = 0
        self._bytes_at = 0
        self._frames_seen = 0
        self._unreadable_since: float | None = None

    def stopped(self, seconds: float) -> None:
        """This process did not run for so long."""
        self._stops += 1
        self._stopped_s += seconds
        self._stopped_at, self._last_stop_s = time.monotonic(), seconds

    def message(self, readers: Sequence[Reader], behind: int) -> pb.LinkStatus:
        """The state now, without its header; rates and latency since the last call. behind: reads
        that wait to be decoded.
        """
        ledger, clock = self._decoder.ledger, self._clock
        now = time.monotonic()
        passed = max(now - self._at, 1e-3)
        latency = sorted(self._samples.latency_ns)
        self._samples.latency_ns.clear()
        connected = bool(readers) and readers[0].connected
        status = pb.LinkStatus(
            connected=connected,
            port=self._device.port,
            message="; ".join(self._complaints(now, readers, connected, behind)),
            bytes_in=ledger.bytes_in,
            good_frames=ledger.good_frames,
            good_bytes=ledger.good_bytes,
            bad_chunks=ledger.bad_chunks,
            bad_bytes=ledger.bad_bytes,
            pending_bytes=self._decoder.pending,
            lost_frames=ledger.lost_frames,
            device_dropped=ledger.device_dropped,
            lost_samples=ledger.lost_samples,
            reboots=ledger.reboots,
            unknown_frames=ledger.unknown_frames,
            reconnects=sum(reader.reconnects for reader in readers),
            sample_rate_hz=(self._samples.count - self._samples_at) / passed,
            frame_rate_hz=(ledger.good_frames - self._frames_at) / passed,
            latency_p50_s=_quantile(latency, 0.50) / 1e9,
            latency_p99_s=_quantile(latency, 0.99) / 1e9,
            clock_skew_ppm=clock.skew_ppm,
            clock_residual_s=clock.residual_s,
            clock_window_s=clock.span_s,
            journal_sequence=self._journal.last_seq,
            durable_sequence=self._journal.durable_seq,
            published_sequence=self._published.last_seq,
            published_durable=self._published.durable_seq,
            gnss_good=self._gnss.good,
            gnss_bad=self._gnss.bad,
            damage=ledger.damage,
            refused=self._door.counts(),
            stops=self._stops,
            stopped_s=self._stopped_s,
            clock_offset_s=self._wall.difference_s,
        )
        for name, count in self._gnss.refused.items():
            status.refused[f"receiver: {name}"] = count
        if held := sum(reader.held for reader in readers):
            status.refused["reads held back"] = held
        self._at, self._samples_at = now, self._samples.count
        self._frames_at = ledger.good_frames
        return status

    def _complaints(
        self, now: float, readers: Sequence[Reader], connected: bool, behind: int
    ) -> list[str]:
        device, skew_ppm = self._device, self._clock.skew_ppm
        found = [reader.message for reader in readers if reader.message]
        found += [
            f"{reader.url}: more comes than can be taken (reading waited {reader.held} times): no"
            " board is so fast; is it the right address, does its other side send what it should?"
            for reader in readers
            if reader.held_at is not None and now - reader.held_at < HELD_TOLD_S
        ]
        if self._stopped_at is not None and now - self._stopped_at < TOLD_S:
            found.append(
                f"this gateway's process was stopped for {self._last_stop_s:.1f} s,"
                f" {now - self._stopped_at:.0f} s ago (a signal, a debugger, or no processor): what"
                " the port could not hold meanwhile is lost, and the board is not to blame"
            )
        if self._wall.offset_s:
            found.append(
                f"the host's clock was set by {self._wall.offset_s:+,.3f} s since this gateway"
                " began: time stamps go on without that step; start the gateway again when the new"
                " time is the right one"
            )
        if self._unreadable(now, connected):
            found.append(
                f"{device.port}: bytes come but no frame can be read; most likely the speed is"
                f" wrong: set `baud` to the board's (now {device.baud})"
            )
        if receiver := self._gnss.message(now):
            found.append(receiver)
        refused = self._door.counts()
        total = sum(refused.values())
        if total > self._refused:
            self._refused, self._refused_at = total, now
        if now - self._refused_at < REFUSED_TOLD_S:
            kinds = ", ".join(f"{kind} {n}" for kind, n in sorted(refused.items()))
            found.append(
                f"whole frames whose values cannot be are left out ({kinds}): is the firmware of"
                " another version, or does something else write to this line? The log names them"
            )
        if self._journal.message:
            found.append(self._journal.message)
        elif self._published.message:
            found.append(self._published.message)
        if abs(skew_ppm) > CRYSTAL_PPM:
            scale = device.time_scale * (1.0 + skew_ppm * 1e-6)
            found.append(
                f"the board's clock runs {scale:.2f} times as fast as the host's: a log played at"
                f" that speed wants `time_scale = {scale:.2f}`, a real board is faulty"
            )
        if behind > BEHIND_CHUNKS:
            found.append(
                f"{behind} reads wait to be decoded: this machine is too slow for the line"
            )
        return found

    def _unreadable(self, now: float, connected: bool) -> bool:
        """True when bytes have been coming for UNREADABLE_S and none of them made a frame."""
        ledger = self._decoder.ledger
        if ledger.good_frames != self._frames_seen or not connected:
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
