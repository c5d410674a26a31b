"""Sample frames become batches in SI units with their place since boot, and batches messages."""

import time
from collections import deque

from firmware_protocol.codec import Frame
from firmware_protocol.frames import Acc12, Imu6
from gateway.board.outgoing import Outgoing
from gateway.board.state import BoardState
from gateway.samples import convert, samples
from gateway.samples.analogue import AnalogueSettings
from gateway.samples.batch import Batch, Index, Joiner


class SampleFlow:
    """Samples of one board since its boot."""

    def __init__(
        self, device: str, analogue: AnalogueSettings, state: BoardState, out: Outgoing
    ) -> None:
        self.count = 0  # samples taken since the gateway's start
        self.latency_ns: deque[int] = deque(maxlen=4096)  # from receipt to publishing
        self._state, self._out, self._analogue = state, out, analogue
        self._adc = samples.Analogue(device, analogue)
        self._joiner: dict[type, Joiner] = {kind: Joiner() for kind in samples.KINDS}
        self.restart()

    def restart(self) -> None:
        """The board has booted."""
        self._index: dict[type, Index] = {kind: Index() for kind in samples.KINDS}
        self._force = samples.Force()
        self._repeated = 0  # wire's stale mask of the newest frame
        self._fresh = False  # a value has come from a sensor since boot

    @property
    def waiting(self) -> bool:
        """True while samples are held back for joining."""
        return any(joiner.waiting for joiner in self._joiner.values())

    def take(self, frame: Frame, payload: samples.Samples, received_ns: int) -> None:
        """One data frame. While nobody takes messages it only moves the counters on."""
        n, kind = len(payload.counts), type(payload)
        self.count += n
        first, lost = self._index[kind].take(payload.first_index, n)
        if not self._out.live:
            return  # nor held back for joining with live ones
        if isinstance(payload, Acc12) and not self._fresh:
            self._fresh = bool(payload.sensor_mask & ~payload.stale_mask)
            if not self._fresh:
                return  # instants before the sensors' first value: zeros, not samples
        batch = Batch(
            first, frame.t_us, payload.period_ns, n, lost, frame.seq, received_ns, frame.flags
        )
        self._fill(batch, payload)
        if not self._out.known(kind, batch):
            self._send(kind, self._joiner[kind].add(batch))

    def flush(self) -> None:
        """Send what is held back."""
        for kind, joiner in self._joiner.items():
            self._send(kind, joiner.flush())

    def _fill(self, batch: Batch, payload: samples.Samples) -> None:
        """The readings, in SI units."""
        if isinstance(payload, Acc12):
            # One repeated value is the beat of two clocks of one nominal rate; two frames of them
            # are a slow sensor.
            batch.stale_mask = convert.stale_axes(
                payload.stale_mask & self._repeated, payload.sensor_mask
            )
            self._repeated = payload.stale_mask
            batch.columns = self._force.columns(payload, self._state.hello, batch.lost)
        elif isinstance(payload, Imu6):
            batch.columns = convert.imu_si(payload)
        else:
            batch.kind = samples.adc_kind(payload, self._analogue)
            batch.columns = self._adc.columns(payload)

    def _send(self, kind: type, batches: list[Batch]) -> None:
        for batch in batches:
            for topic, message in samples.messages_of(kind, batch, self._state.hello):
                self._out.publish(topic, message, batch.device_us)
            self.latency_ns.append(time.monotonic_ns() - batch.received_ns)
