"""Each frame goes to those whom it concerns: samples, tachometer, receiver, clock, orders."""

import logging

from firmware_protocol.codec import Frame
from firmware_protocol.frames import Acc12, Ack, Adc, Gps, Hello, Imu6, Pps, Status, Tacho
from gateway.board.orders import Orders
from gateway.board.state import BoardState
from gateway.board.watch import BoardWatch
from gateway.gnss.flow import GnssFlow
from gateway.samples.flow import SampleFlow
from gateway.samples.tacho_flow import TachoFlow
from gateway.time.clock import Continued, DeviceClock
from gateway.time.pps import PpsClock

log = logging.getLogger(__name__)


class FrameHandler:
    """Frames of one board, in the order of the line."""

    def __init__(
        self,
        device: str,
        state: BoardState,
        clock: DeviceClock,
        pps: PpsClock,
        watch: BoardWatch,
        samples: SampleFlow,
        tacho: TachoFlow,
        gnss: GnssFlow,
        orders: Orders,
    ) -> None:
        self._device, self._state, self._clock, self._pps = device, state, clock, pps
        self._watch, self._samples, self._tacho = watch, samples, tacho
        self._gnss, self._orders = gnss, orders
        self._reboots = self._boots = 0
        self._late = False
        self._time = Continued()

    def take(self, frame: Frame, reboots: int, received_ns: int, late: bool = False) -> None:
        """reboots: as the ledger counts them, for a boot that has the number of the one before;
        late: the frame may have waited for this process (Chunk).
        """
        if frame.epoch != self._state.epoch or reboots != self._reboots:
            self._restart(frame.epoch, received_ns)
            self._reboots = reboots
        t_us = self._time.take(frame.t_us)
        if t_us != frame.t_us:
            frame = frame._replace(t_us=t_us)
        self._late = late
        self._state.flags = frame.flags
        self._watch.heard(received_ns, late)
        if not self._clock.started:  # later only from frames that leave with their last datum
            self._clock.add(frame.t_us, received_ns)
        match frame.payload:
            case Acc12() | Imu6() | Adc() as payload if payload.counts:
                self._take_samples(frame, payload, received_ns)
            case Tacho() as payload:
                self._tacho.take(payload, frame.t_us)
            case Gps() as payload:
                self._gnss.take(payload.data, frame.t_us, None)
            case Pps() as payload:
                self._pps.add(frame.t_us, payload.fraction_ns)
            case Ack() as payload:
                self._orders.take(payload)
            case Hello() | Status() as payload:
                self._clock.add(frame.t_us, received_ns, late)
                self._watch.said(payload, frame.t_us, received_ns)
                self._tacho.until(frame.t_us)
        self._watch.tell_news(frame.t_us, received_ns)

    def _take_samples(self, frame: Frame, payload: Acc12 | Imu6 | Adc, received_ns: int) -> None:
        last_us = frame.t_us + (len(payload.counts) - 1) * payload.period_ns // 1000
        self._clock.add(last_us, received_ns, self._late)
        if isinstance(payload, Acc12):
            self._watch.samples(payload, received_ns)
        self._samples.take(frame, payload, received_ns)
        self._tacho.until(last_us)

    def _restart(self, epoch: int, received_ns: int) -> None:
        """The board has booted: its clock and counters begin again."""
        if self._state.epoch is not None:
            text = f"the board restarted (boot {self._state.epoch} -> {epoch})"
            self._boots += 1
            if (
                self._boots < 8 or self._boots & (self._boots - 1) == 0
            ):  # a line may show nothing else
                log.warning("%s: %s", self._device, text)
            self._watch.rebooted(text, received_ns)
        self._samples.flush()  # still as of the boot before
        self.begin_anew(epoch)

    def begin_anew(self, epoch: int) -> None:
        """Forget what frames have said so far."""
        self._state.restart(epoch)
        self._clock.reset()
        self._time = Continued()
        self._pps.reset()
        self._tacho.restart()
        self._gnss.restart()
        self._samples.restart()
