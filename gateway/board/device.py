"""One board, from its ports to the bus: builds what stands on a byte's way, and the loop that moves
it on.

Everything after the readers happens on one thread, `DeviceLink.run`. Reading and journalling need
no bus. What is decoded before `go_live` only moves the counters, the clock and the state (sample
index, HELLO, tachometer). What is put before there is a bus stands in the spool of published
messages, where consumers can ask for it; it is never sent later as if it were live.
"""

import logging
import queue
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future

from firmware_protocol.codec import Frame
from gateway.board.decoder import Decoder
from gateway.board.frame_door import FrameDoor
from gateway.board.frames import FrameHandler
from gateway.board.link_report import LinkReport
from gateway.board.orders import Orders
from gateway.board.outgoing import Outgoing, Put
from gateway.board.resume import Past, again, unseen
from gateway.board.state import BoardState
from gateway.board.watch import BoardWatch
from gateway.gnss.flow import GnssFlow
from gateway.ports.backlog import Backlog
from gateway.ports.keeper import Keeper
from gateway.ports.reader import Chunk, Reader
from gateway.samples.flow import SampleFlow
from gateway.samples.tacho_flow import TachoFlow
from gateway.settings import DeviceSettings, GatewaySettings
from gateway.time.clock import DeviceClock
from gateway.time.pps import PpsClock
from gateway.time.wall import WallClock
from messages.bus.turning import Loop
from messages.contract import gyrofree_pb2 as pb
from messages.contract.checks import Refusal
from messages.contract.door import Door
from messages.contract.topics import LINK
from messages.history.journal import Journal
from messages.history.journal_file import BOARD, GNSS, Record
from messages.history.spool import Spool

log = logging.getLogger(__name__)

JOIN_WAIT_S = 0.01  # samples held back for joining wait no longer than this for the next frame
FAILURES_SHOWN = 20  # faults of ours that stand in the log with all that is known of them
STATUS_EVERY_S = 1.0
AGAIN_S = 60.0  # that what an earlier life read may take to be decoded again
STOPPED_S = 1.5  # longer than any wait below: this process was stopped, or got no processor


class DeviceLink:
    """A board from its port to the bus.

    `run` returns when `stop` is set, at once after `wake`. Raises JournalBusy when another gateway
    has the journal.
    """

    def __init__(
        self, device: DeviceSettings, settings: GatewaySettings, keeper: Keeper | None = None
    ) -> None:
        name, folder = device.name, settings.journal / device.name
        self.name, self.device, self._keeper = name, device, keeper or Keeper()
        self._next_put: Put | None = None  # None: there is no bus yet
        self._live = False
        self._looked = time.monotonic()
        self.on_stopped: Callable[[], object] = lambda: None  # this process did not run for a while
        self.journal = Journal(
            folder, settings.journal_bytes, settings.segment_bytes, settings.sync_s
        )
        self.spool = Spool(folder / "published", settings.published_bytes, settings.published_age_s)
        self.queue: Backlog[Chunk] = Backlog()
        self.readers: list[Reader] = []
        self.door = Door("gateway")
        self.decoder = Decoder(FrameDoor(self.door, name, device.time_scale))
        self.state = BoardState()
        self.clock = DeviceClock(time_scale=device.time_scale)
        self.pps, self.wall = PpsClock(), WallClock(name)
        self.out = Outgoing(name, self.journal.run, self.state, self.clock, self.wall, self.door)
        self.watch = BoardWatch(self.state, self.clock, self.pps, self.wall, self.out)
        self.samples = SampleFlow(name, device.analogue, self.state, self.out)
        self.gnss = GnssFlow(name, device.gnss_latency_s, self.wall, self.out)
        self.orders = Orders(name, lambda data: self.readers[0].write(data))
        self.frames = FrameHandler(
            name,
            self.state,
            self.clock,
            self.pps,
            self.watch,
            self.samples,
            TachoFlow(device.tacho_pulses_per_rev, self.out),
            self.gnss,
            self.orders,
        )
        self.report = LinkReport(
            device,
            self.decoder,
            self.samples,
            self.gnss,
            self.clock,
            self.journal,
            self.spool,
            self.door,
            self.wall,
        )

    def run(self, stop: threading.Event) -> None:
        """Open the ports, journal, count, and publish once live, until `stop` is set."""
        ports = [(self.device.port, self.device.baud, BOARD)]
        if self.device.gnss_port:
            ports.append((self.device.gnss_port, self.device.gnss_baud, GNSS))
        with Loop(f"link {self.name}") as loop:
            self._run(ports, loop, stop)

    def _run(self, ports: list[tuple[str, int, int]], loop: Loop, stop: threading.Event) -> None:
        past, left = None, []
        if self._next_put is not None and self._keeper.holds(self.device.port):
            past = Past(self.spool, self._next_put)
            # before the readers append to the journal what came since
            with loop.during("reading the journal", AGAIN_S):
                left = unseen(past, self.journal) if past.read_ns else []
        scale = self.device.time_scale
        self.readers = [
            Reader(*port, self.journal, self.queue, self._keeper, scale) for port in ports
        ]
        try:
            if past is not None and past.read_ns:
                with loop.during("decoding the journal", AGAIN_S):
                    self.resume(past, left)
            self._loop(loop, stop)
        finally:
            for reader in self.readers:
                reader.close()
            self.orders.close()
            self.journal.close()
            self.spool.close()

    def resume(self, past: Past, records: list[Record]) -> None:
        """Go to where the raw `records` end, and publish what they hold that has not been."""
        for put, chunk in again(past, records):
            self.out.direct(put, past.has)
            self.take(chunk)
        self.out.direct(None)
        self.decoder.count_anew()
        self.report.message(self.readers, 0)  # rates and latency from here on

    def _loop(self, loop: Loop, stop: threading.Event) -> None:
        due = self._looked = time.monotonic()
        while not stop.is_set():
            loop.turn()
            left = due - self._look()
            if left <= 0:
                self._each_second()
                due = max(due + STATUS_EVERY_S, time.monotonic())
                continue
            self.orders.step(time.monotonic())
            held = self.samples.waiting
            hurry = held or self.orders.waiting
            try:
                chunk = self.queue.get(timeout=min(left, JOIN_WAIT_S) if hurry else left)
                self._look()
            except queue.Empty:
                if held:
                    self.samples.flush()
                continue
            if chunk is not None:
                self.take(chunk)
            elif self._next_put is not None and not self._live:
                self._live = True
                self.out.direct(self._next_put)
                due = time.monotonic()  # the first status at once: it says that samples follow

    def _look(self) -> float:
        """Now, s; notices when this process was stopped meanwhile."""
        now, before = time.monotonic(), self._looked
        self._looked = now
        if now - before > STOPPED_S:
            self.watch.stopped(now - before)
            self.report.stopped(now - before)
            self.on_stopped()
            log.warning("%s: this process was stopped for %.1f s", self.name, now - before)
        return now

    def _each_second(self) -> None:
        try:
            self._tell()
        except Exception as error:
            self._fail(error, "the state of the line")
            self.frames.begin_anew(self.state.epoch or 0)

    def _fail(self, error: Exception, what: str) -> None:
        """A fault of ours: it costs what it was about, and neither this board nor another."""
        failure = Refusal("failure", what, type(error).__name__, "to be understood")
        self.door.refuse(self.name, failure, self.name)
        if self.door.refused["failure"] <= FAILURES_SHOWN:
            log.error("%s: %s", self.name, what, exc_info=error)

    def _tell(self) -> None:
        now_ns = time.monotonic_ns()
        self._take_frames(self.decoder.wait(now_ns), now_ns)
        self.wall.follow()
        board = self.readers[0]
        self.watch.look(board.connected, time.monotonic_ns(), board.silent_s)
        if self.out.live:
            status = self.report.message(self.readers, self.queue.qsize())
            self.out.publish(LINK, status, 0, self.wall.now_ns())

    def go_live(self, put: Put) -> None:
        """Publish from now on what is read from now on: put(topic, device, message), which must not
        block.
        """
        self._next_put = put
        self.queue.put(None)  # behind the chunks that were read without a bus

    def outrun(self, run: int) -> None:
        """What is published from now on has a run above this one."""
        self.journal.outrun(run)
        self.out.run = self.journal.run

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

    def take(self, chunk: Chunk) -> None:
        """One read of one port; an empty one says that it was opened."""
        if not chunk.data:
            if chunk.channel == BOARD:
                self.orders.ask("hello")  # who is there should not take ten seconds to learn
        elif chunk.channel == GNSS:
            try:
                device_us = self.clock.device_us(chunk.monotonic_ns)
                self.gnss.take(chunk.data, device_us, chunk.monotonic_ns)
            except Exception as error:
                self._fail(error, "bytes of the receiver")
                self.gnss.restart()
        else:
            frames = self.decoder.feed(chunk.data, chunk.monotonic_ns)
            self._take_frames(frames, chunk.monotonic_ns, chunk.late)

    def _take_frames(self, frames: Iterator[Frame], at_ns: int, late: bool = False) -> None:
        for frame in frames:
            try:
                self.frames.take(frame, self.decoder.ledger.reboots, at_ns, late)
            except Exception as error:
                self._fail(error, f"frame of type {frame.type}")
                self.frames.begin_anew(frame.epoch)
