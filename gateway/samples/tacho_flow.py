"""Pulses of the tachometer become a rate 20 times a second."""

from firmware_protocol.frames import Tacho
from gateway.board.outgoing import Outgoing
from gateway.samples.tacho import Tachometer
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import TACHO

EVERY_US = 50_000  # 20 Hz


class TachoFlow:
    """Pulses of one board since its boot."""

    def __init__(self, pulses_per_rev: int, out: Outgoing) -> None:
        self._tacho, self._out = Tachometer(pulses_per_rev), out
        self._said_us = 0

    def restart(self) -> None:
        """The board has booted."""
        self._tacho.reset()
        self._said_us = 0

    def take(self, frame: Tacho, t_us: int) -> None:
        """Pulses at and after t_us."""
        times = [t_us + offset / 100.0 for offset in frame.offsets_10ns]
        self._tacho.add(times, bool(frame.edge & 2), bool(frame.edge & 4))

    def until(self, now_us: int) -> None:
        """Device time has come to now_us: a rate is due every 50 ms, also one of zero."""
        if now_us - self._said_us < EVERY_US:
            return
        rate = self._tacho.rate(now_us)
        if rate is None:
            return
        self._said_us = now_us
        message = pb.TachoRate(
            omega_radps=rate.omega_radps,
            sigma_radps=rate.sigma_radps,
            pulses=self._tacho.pulses,
            direction_known=rate.direction_known,
        )
        self._out.publish(TACHO, message, round(rate.device_us))
