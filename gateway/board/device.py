"""One board: chunks in, bus messages out. Everything after the reader happens on one thread,
`DeviceLink.run`.

Reading and journalling need no bus. What is decoded before `go_live` only moves the counters, the
clock and the state (sample index, HELLO, tachometer). What is put before there is a bus stands in
the spool of published messages, where consumers can ask for it; it is never sent later as if it
were live.
"""

import logging
import queue
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future

from google.protobuf.message import Message

from firmware_protocol.codec import Deframer, Frame
from firmware_protocol.frames import Acc12, Ack, Adc, Gps, Hello, Imu6, Pps, Status, Tacho
from firmware_protocol.ledger import Ledger
from gateway.board.faults import SKEW_WINDOW_S, FaultWatch
from gateway.board.link_report import LinkReport
from gateway.board.orders import Orders
from gateway.board.resume import Past, resume, unseen
from gateway.gnss.link import GnssLink
from gateway.ports.keeper import Keeper
from gateway.ports.reader import Chunk, Reader
from gateway.samples import convert, samples
from gateway.samples.batch import Batch, Index, Joiner
from gateway.samples.tacho import Tachometer
from gateway.settings import DeviceSettings, GatewaySettings
from gateway.time.clock import DeviceClock
from gateway.time.pps import PpsClock
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import BOARD as BOARD_TOPIC
from messages.contract.topics import GNSS as GNSS_TOPIC
from messages.contract.topics import LINK, LOCATION, TACHO, Topic
from messages.history.journal import Journal
from messages.history.journal_file import BOARD, GNSS
from messages.history.spool import Spool

log = logging.getLogger(__name__)

TACHO_EVERY_US = 50_000  # 20 Hz
JOIN_WAIT_S = 0.01  # samples held back for joining wait no longer than this for the next frame
STATUS_EVERY_S = 1.0
PPS_ENOUGH_S = 3.0  # of pulses, until they are believed about the clock

Put = Callable[[Topic, str, Message], None]


class DeviceLink:
    """A board from its port to the bus.

    `run` returns when `stop` is set, at once after `wake`. Raises JournalBusy when another gateway
    has the journal.
    """

    def __init__(
        self, device: DeviceSettings, settings: GatewaySettings, keeper: Keeper | None = None
    ) -> None:
        self.device = device
        self.keeper = keeper or Keeper()
        self.past: Past | None = (
            None  # what an earlier life has published, while its last bytes are decoded again
        )
        self.name = device.name
        self._put: Put | None = None  # None: there is no bus yet
        self._next_put: Put | None = None
        self.journal = Journal(
            settings.journal / device.name,
            settings.journal_bytes,
            settings.segment_bytes,
            settings.sync_s,
        )
        self.spool = Spool(
            settings.journal / device.name / "published",
            settings.published_bytes,
            settings.published_age_s,
        )
        self.deframer = Deframer()
        self.ledger = Ledger()
        self.clock = DeviceClock(time_scale=device.time_scale)
        self.tacho = Tachometer(device.tacho_pulses_per_rev)
        self.gnss = GnssLink(device.gnss_latency_s)
        self.pps = PpsClock()
        self.faults = FaultWatch()
        self.orders = Orders(device.name, lambda data: self.readers[0].write(data))
        self.report = LinkReport(self)
        self.hello: Hello | None = None
        self.status: Status | None = None
        self.wall_offset_ns = time.time_ns() - time.monotonic_ns()
        self.queue: queue.SimpleQueue[Chunk | None] = queue.SimpleQueue()
        self.readers: list[Reader] = []
        self._epoch: int | None = None
        self._reboots = 0
        self._flags = 0
        self._tacho_said_us = 0
        self._index: dict[type, Index] = {}
        self._repeated = 0  # wire's stale mask of the newest frame
        self._fresh = False  # a value has come from a sensor since boot
        self._force = samples.Force()
        self._adc = samples.Analogue(device.name, device.analogue)
        self._joiner: dict[type, Joiner] = {kind: Joiner() for kind in samples.KINDS}

    def run(self, stop: threading.Event) -> None:
        """Open the ports, journal, count, and publish once live, until `stop` is set."""
        ports = [(self.device.port, self.device.baud, BOARD)]
        if self.device.gnss_port:
            ports.append((self.device.gnss_port, self.device.gnss_baud, GNSS))
        left = None
        if self._next_put is not None and self.keeper.holds(self.device.port):
            past = Past(self.spool, self._next_put)
            left = unseen(past, self.journal) if past.read_ns else None
        self.readers = [Reader(*port, self.journal, self.queue, self.keeper) for port in ports]
        try:
            if left is not None:
                resume(self, past, left)
            self._loop(stop)
        finally:
            for reader in self.readers:
                reader.close()
            self.orders.close()
            self.journal.close()
            self.spool.close()

    def _loop(self, stop: threading.Event) -> None:
        due = time.monotonic()
        while not stop.is_set():
            left = due - time.monotonic()
            if left <= 0:
                self._follow_wall_clock()
                self.look(self.readers[0].connected, time.monotonic_ns())
                if self._put is not None:
                    self._publish(LINK, self.report.message(), int(time.time_ns()))
                due = max(due + STATUS_EVERY_S, time.monotonic())
                continue
            self.orders.step(time.monotonic())
            held = any(joiner.waiting for joiner in self._joiner.values())
            hurry = held or self.orders.waiting
            try:
                chunk = self.queue.get(timeout=min(left, JOIN_WAIT_S) if hurry else left)
            except queue.Empty:
                if held:
                    self._send_held()
                continue
            if chunk is not None:
                self.take(chunk)
            elif self._put is not self._next_put:
                self._put = self._next_put
                due = time.monotonic()  # the first status at once: it says that samples follow

    def go_live(self, put: Put) -> None:
        """Publish from now on what is read from now on: put(topic, device, message), which must not
        block.
        """
        self._next_put = put
        self.queue.put(None)  # behind the chunks that were read without a bus

    def publish_with(self, put: Put | None, past: Past | None = None) -> None:
        """On the decoding thread: what is decoded from here on goes there, or nowhere, but samples
        that `past` has.
        """
        self._put, self.past = put, past

    def wake(self) -> None:
        """Let `run` look at its stop event now."""
        self.queue.put(None)

    def order(self, command: pb.BoardCommand) -> "Future[pb.Reply]":
        """Send a command to the board; the answer comes after its ACK. Any thread may call this."""
        log.info(
            "%s: %s orders %s %d",
            self.name,
            command.user or "somebody",
            command.name,
            command.value,
        )
        answer = self.orders.ask(command.name, None if command.ask else command.value)
        self.wake()
        return answer

    def look(self, connected: bool, now_ns: int) -> None:
        """Once a second: faults that only the line shows, and the news of them."""
        by_pulses = self.pps.span_s >= PPS_ENOUGH_S
        skew = self.pps.skew_ppm if by_pulses else self.clock.skew_ppm
        window = SKEW_WINDOW_S if by_pulses else self.clock.span_s
        doubt = (
            0.0 if by_pulses else 0.5e6 * self.clock.residual_s / max(window, 1.0)
        )  # half the scatter, end to end
        self.faults.line(
            connected, skew, doubt, window, now_ns * 1e-9, now_ns + self.wall_offset_ns
        )
        if self.faults.news():
            self._publish_board(now_ns, self.clock.device_us(now_ns))

    def take(self, chunk: Chunk) -> None:
        """One read of one port; an empty one says that it was opened."""
        if not chunk.data:
            if chunk.channel == BOARD:
                self.orders.ask("hello")  # who is there should not take ten seconds to learn
            return
        if chunk.channel == GNSS:
            self._take_gnss(
                chunk.data, self.clock.device_us(chunk.monotonic_ns), chunk.monotonic_ns
            )
            return
        self.ledger.received(len(chunk.data))
        for event in self.deframer.feed(chunk.data):
            self.ledger.count(event)
            if isinstance(event, Frame):
                self._take_frame(event, chunk.monotonic_ns)

    def _take_frame(self, frame: Frame, received_ns: int) -> None:
        if frame.epoch != self._epoch or self.ledger.reboots != self._reboots:
            self._restart(frame.epoch, received_ns)
        self._flags = frame.flags
        self.faults.heard(received_ns * 1e-9, received_ns + self.wall_offset_ns)
        if not self.clock.started:  # later only from frames that leave with their last datum
            self.clock.add(frame.t_us, received_ns)
        match frame.payload:
            case Acc12() | Imu6() | Adc() as payload if payload.counts:
                last_us = frame.t_us + (len(payload.counts) - 1) * payload.period_ns // 1000
                self.clock.add(last_us, received_ns)
                if isinstance(payload, Acc12):
                    self.faults.samples(
                        payload, received_ns * 1e-9, received_ns + self.wall_offset_ns
                    )
                self._take_samples(frame, payload, received_ns)
                self._take_tacho_time(last_us)
            case Tacho() as payload:
                times = [frame.t_us + offset / 100.0 for offset in payload.offsets_10ns]
                self.tacho.add(times, bool(payload.edge & 2), bool(payload.edge & 4))
            case Gps() as payload:
                self._take_gnss(payload.data, frame.t_us, None)
            case Pps() as payload:
                self.pps.add(frame.t_us, payload.fraction_ns)
            case Ack() as payload:
                self.orders.take(payload)
            case Hello() | Status() as payload:
                self.clock.add(frame.t_us, received_ns)
                if isinstance(payload, Hello):
                    self.hello = payload
                    self.faults.hello(payload)
                else:
                    self.status = payload
                    self.faults.status(
                        payload, received_ns * 1e-9, received_ns + self.wall_offset_ns
                    )
                self._publish_board(received_ns, frame.t_us)
                self._take_tacho_time(frame.t_us)
        if self.faults.news():
            self._publish_board(received_ns, frame.t_us)

    def _publish_board(self, now_ns: int, device_us: int) -> None:
        """What the board says of itself, and what is wrong with it."""
        info = convert.board_info(self.hello, self.status)
        info.faults.extend(self.faults.messages(now_ns * 1e-9))
        if self.pps.pulses:
            info.status["pps_taken"], info.status["pps_rejected"] = (
                self.pps.pulses,
                self.pps.rejected,
            )
        self._publish(BOARD_TOPIC, info, None, device_us)

    def _restart(self, epoch: int, received_ns: int) -> None:
        """The board has booted: its clock and counters begin again."""
        if self._epoch is not None:
            text = f"the board restarted (boot {self._epoch} -> {epoch})"
            log.warning("%s: %s", self.name, text)
            self.faults.rebooted(received_ns * 1e-9, received_ns + self.wall_offset_ns, text)
        self._send_held()
        self.hello = self.status = (
            None  # until the next HELLO only the frames' own flags say what they come from
        )
        self._epoch, self._reboots = epoch, self.ledger.reboots
        self.clock.reset()
        self.pps.reset()
        self.tacho.reset()
        self.gnss.restart()
        self._index, self._force = {kind: Index() for kind in samples.KINDS}, samples.Force()
        self._tacho_said_us, self._repeated, self._fresh = 0, 0, False

    def _take_samples(self, frame: Frame, payload: samples.Samples, received_ns: int) -> None:
        n = len(payload.counts)
        self.report.samples += n
        first, lost = self._index[type(payload)].take(payload.first_index, n)
        if self._put is None:
            return  # nor held back for joining with live ones
        if isinstance(payload, Acc12) and not self._fresh:
            self._fresh = bool(payload.sensor_mask & ~payload.stale_mask)
            if not self._fresh:
                return  # instants before the sensors' first value: zeros, not samples
        batch = Batch(
            first, frame.t_us, payload.period_ns, n, lost, frame.seq, received_ns, frame.flags
        )
        if isinstance(payload, Acc12):
            # One repeated value is the beat of two clocks of one nominal rate; two frames of them
            # are a slow sensor.
            batch.stale_mask = convert.stale_axes(
                payload.stale_mask & self._repeated, payload.sensor_mask
            )
            self._repeated = payload.stale_mask
            batch.columns = self._force.columns(payload, self.hello, lost)
        elif isinstance(payload, Imu6):
            batch.columns = convert.imu_si(payload)
        else:
            batch.kind = samples.adc_kind(payload, self.device.analogue)
            batch.columns = self._adc.columns(payload)
        if self.past is None or not self.past.has(type(payload), frame.epoch, batch):
            self._send(type(payload), self._joiner[type(payload)].add(batch))

    def _send(self, kind: type, batches: list[Batch]) -> None:
        for batch in batches:
            for topic, message in samples.messages_of(kind, batch, self.hello):
                self._publish(topic, message, None, batch.device_us)
            self.report.latency_ns.append(time.monotonic_ns() - batch.received_ns)

    def _send_held(self) -> None:
        for kind, joiner in self._joiner.items():
            self._send(kind, joiner.flush())

    def _take_tacho_time(self, now_us: int) -> None:
        """Device time has come to now_us: a rate is due every 50 ms, also one of zero."""
        if now_us - self._tacho_said_us < TACHO_EVERY_US:
            return
        rate = self.tacho.rate(now_us)
        if rate is None:
            return
        self._tacho_said_us = now_us
        message = pb.TachoRate(
            omega_radps=rate.omega_radps,
            sigma_radps=rate.sigma_radps,
            pulses=self.tacho.pulses,
            direction_known=rate.direction_known,
        )
        self._publish(TACHO, message, None, round(rate.device_us))

    def _take_gnss(self, data: bytes, device_us: int, monotonic_ns: int | None) -> None:
        for arrival in self.gnss.feed(data, device_us, monotonic_ns, time.time_ns()):
            message = convert.gnss_fix(arrival.fix)
            message.device_time_s = arrival.device_time_s
            utc_ns = (
                None if arrival.monotonic_ns is None else arrival.monotonic_ns + self.wall_offset_ns
            )
            self._publish(GNSS_TOPIC, message, utc_ns, arrival.device_us)
            if message.quality:
                self._send_out(LOCATION, convert.location_fix(message, self.name))

    def _publish(
        self, topic: Topic, message: Message, utc_ns: int | None, device_us: int = 0
    ) -> None:
        """Fill the header and put; utc_ns None: from device time."""
        header = message.header
        header.device = self.name
        header.epoch = self._epoch or 0
        header.device_us = device_us
        header.utc_ns = (
            self.clock.host_ns(device_us) + self.wall_offset_ns if utc_ns is None else utc_ns
        )
        header.utc_sigma_s = self.clock.sigma_s
        header.source = convert.source(self.hello, self._flags)
        header.run = self.journal.run
        self._send_out(topic, message)

    def _send_out(self, topic: Topic, message: Message) -> None:
        if self._put is not None:
            self._put(topic, self.name, message)

    def _follow_wall_clock(self) -> None:
        """The host's UTC clock may be slewed or stepped under us; monotonic time is not."""
        offset = time.time_ns() - time.monotonic_ns()
        if abs(offset - self.wall_offset_ns) > 500_000_000:
            log.warning(
                "%s: the host's clock was stepped by %.3f s; UTC times follow it",
                self.name,
                (offset - self.wall_offset_ns) / 1e9,
            )
        self.wall_offset_ns = offset
