"""Bytes of a receiver, in frames or on a port of its own, become fixes as messages."""

import logging
import time

from gateway.board.outgoing import Outgoing
from gateway.gnss.heard import Heard, counts_of
from gateway.gnss.link import GnssLink
from gateway.samples import convert
from gateway.time.wall import WallClock
from messages.contract.topics import GNSS, LOCATION, SKY

log = logging.getLogger(__name__)

_DIGITS = str.maketrans("", "", "0123456789")  # the same words with other numbers are no news
SKY_EVERY_US = 900_000  # of the board's clock: satellites move slowly, and receivers may say 10 Hz
STEP_TOLD_S = 60.0  # a step of the receiver's time is said for so long


class GnssFlow:
    """The receiver of one board."""

    def __init__(self, device: str, latency_s: float, wall: WallClock, out: Outgoing) -> None:
        self._device, self._wall, self._out = device, wall, out
        self._link = GnssLink(latency_s)
        self._heard = Heard()
        self._placed = self._unplaced = 0  # epochs with and without a position
        self._said = ""
        self._steps, self._step_s = 0, 0.0
        self._sky_us: int | None = None  # of the last sky

    @property
    def good(self) -> int:
        """Messages of the receiver that were sound."""
        return self._link.decoder.good

    @property
    def bad(self) -> int:
        """Messages of the receiver that were damaged."""
        return self._link.decoder.bad

    @property
    def refused(self) -> dict[str, int]:
        """Messages with a right checksum and a wrong content, by message and field."""
        return dict(self._link.decoder.refused)

    def message(self, now_s: float) -> str:
        """What a person should know of the receiver at now_s (monotonic), asked once a second."""
        counts = counts_of(self._link.decoder, self._placed, self._unplaced)
        said = self._heard.say(now_s, counts, self._steps_at(now_s))
        kind = said.translate(_DIGITS)
        if kind != self._said and said:
            log.warning("%s: %s", self._device, said)
        self._said = kind
        return said

    def _steps_at(self, now_s: float) -> list[str]:
        clock = self._link.clock
        if clock.steps != self._steps:
            self._steps, self._step_s = clock.steps, now_s
        if not clock.steps or now_s - self._step_s > STEP_TOLD_S:
            return []
        return [f"its time stepped by {clock.last_step_s:+.3f} s: times of fixes are counted anew"]

    def restart(self) -> None:
        """The board has booted; the receiver goes on."""
        self._sky_us = None
        self._link.restart()

    def take(self, data: bytes, device_us: int, monotonic_ns: int | None) -> None:
        """Bytes that came at device_us; monotonic_ns: None inside GPS frames."""
        for arrival in self._link.feed(data, device_us, monotonic_ns, time.time_ns()):
            message = convert.gnss_fix(arrival.fix)
            message.device_time_s = max(0.0, arrival.device_time_s)
            self._placed += bool(message.quality)
            self._unplaced += not message.quality
            at_ns = arrival.monotonic_ns
            utc_ns = None if at_ns is None else self._wall.utc_ns(at_ns)
            self._out.publish(GNSS, message, arrival.device_us, utc_ns)
            if message.quality:
                self._out.send(LOCATION, convert.location_fix(message, self._device))
        self._take_sky(device_us, monotonic_ns)

    def _take_sky(self, device_us: int, monotonic_ns: int | None) -> None:
        sky, self._link.decoder.sky = self._link.decoder.sky, None
        if sky is None or (
            self._sky_us is not None and 0 <= device_us - self._sky_us < SKY_EVERY_US
        ):
            return
        self._sky_us = device_us
        utc_ns = None if monotonic_ns is None else self._wall.utc_ns(monotonic_ns)
        self._out.publish(SKY, convert.sky(sky), device_us, utc_ns)
