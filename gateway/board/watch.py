"""What the board says of itself, and what is wrong with it: BoardInfo, at once when it is news."""

from firmware_protocol.frames import Acc12, Hello, Status
from gateway.board.faults import SKEW_WINDOW_S, FaultWatch
from gateway.board.outgoing import Outgoing
from gateway.board.state import BoardState
from gateway.samples import convert
from gateway.time.clock import DeviceClock
from gateway.time.pps import PpsClock
from gateway.time.wall import WallClock
from messages.contract.topics import BOARD

PPS_ENOUGH_S = 3.0  # of pulses, until they are believed about the clock


class BoardWatch:
    """Faults of one board. Times: monotonic time of receipt, ns."""

    def __init__(
        self,
        state: BoardState,
        clock: DeviceClock,
        pps: PpsClock,
        wall: WallClock,
        out: Outgoing,
    ) -> None:
        self._state, self._clock, self._pps, self._wall, self._out = state, clock, pps, wall, out
        self._faults = FaultWatch()

    def heard(self, received_ns: int, late: bool = False) -> None:
        """A frame has come. late: it may have waited for this process."""
        self._faults.heard(received_ns * 1e-9, self._wall.utc_ns(received_ns), late)

    def stopped(self, seconds: float) -> None:
        """This process was stopped for so long: what was not heard meanwhile is not the board's
        fault.
        """
        self._faults.stopped(seconds)

    def samples(self, frame: Acc12, received_ns: int) -> None:
        """Readings: who is dead, stuck or stale?"""
        self._faults.samples(frame, received_ns * 1e-9, self._wall.utc_ns(received_ns))

    def rebooted(self, text: str, received_ns: int) -> None:
        """Another boot."""
        self._faults.rebooted(received_ns * 1e-9, self._wall.utc_ns(received_ns), text)

    def said(self, payload: Hello | Status, device_us: int, received_ns: int) -> None:
        """A HELLO or STATUS: it is passed on."""
        if isinstance(payload, Hello):
            self._state.hello = payload
            self._faults.hello(payload)
        else:
            self._state.status = payload
            self._faults.status(payload, received_ns * 1e-9, self._wall.utc_ns(received_ns))
        self._publish(received_ns, device_us)

    def look(self, connected: bool, now_ns: int, silent_s: float | None = None) -> None:
        """Once a second: faults that only the line shows, and the news of them. silent_s: the
        reader's, for how long the port was seen to have nothing.
        """
        by_pulses = self._pps.span_s >= PPS_ENOUGH_S
        skew = self._pps.skew_ppm if by_pulses else self._clock.skew_ppm
        window = SKEW_WINDOW_S if by_pulses else self._clock.span_s
        # half the scatter, end to end
        doubt = 0.0 if by_pulses else 0.5e6 * self._clock.residual_s / max(window, 1.0)
        utc_ns = self._wall.utc_ns(now_ns)
        self._faults.line(connected, skew, doubt, window, now_ns * 1e-9, utc_ns, silent_s)
        self.tell_news(self._clock.device_us(now_ns), now_ns)

    def tell_news(self, device_us: int, now_ns: int) -> None:
        """A fault that has just come is published."""
        if self._faults.news():
            self._publish(now_ns, device_us)

    def _publish(self, now_ns: int, device_us: int) -> None:
        info = convert.board_info(self._state.hello, self._state.status)
        info.faults.extend(self._faults.messages(now_ns * 1e-9))
        if self._pps.pulses:
            info.status["pps_taken"] = self._pps.pulses
            info.status["pps_rejected"] = self._pps.rejected
        self._out.publish(BOARD, info, device_us)
