"""The gateway's door to a line: is a whole frame one to believe?

A good CRC says that the bytes are those which were sent, and nothing of what they mean. Two
questions are asked of each frame, before anything is counted or moved by it.

Does it go on from the frame before? Same boot, a sequence and a clock that have not moved further
than time has passed. One that does not (a reboot, a hole in a log that is played, or nonsense) is
held until another goes on from it: then the line has really begun anew and both are passed on, else
it is refused as a stray.

Can its values be? Periods, scales, masks, the order of pulses, and the sample index against the
time that has passed.
"""

from collections.abc import Callable
from typing import Any

from firmware_protocol.codec import Frame
from firmware_protocol.frames import Acc12, Adc, Hello, Imu6, Tacho
from messages.contract.checks import Refusal
from messages.contract.door import Door

WRAP = 1 << 32
QUIET_NS = 300_000_000
LATEST_US = 1 << 50  # 35 years of a board's clock
BACK_US = 10_000_000  # frames of several kinds need not stand in the order of their times
AHEAD_US = 60_000_000  # a clock may be ahead of ours by so much from one frame to the next
FRAMES = 1000  # lost from one frame to the next at once ...
FRAMES_PER_S = 20_000.0  # ... and in each second: no line carries more
SAMPLES = 1000  # lost from one frame to the next beyond those that the time allows
LEAST_PERIOD_NS = 10_000  # 100 kHz
MOST_SCALE_NG = 300_000_000  # per count: 16 bits of it are 10,000 g
MOST_SCALE_UG = 3_000_000  # um/s^2 per count, likewise
MOST_SCALE_NRAD = 300_000_000  # nrad/s per count: 16 bits of it are 10,000 rad/s
VREF_MV = (100, 20_000)
PULSES_10NS = 1_000_000_000  # a frame has the pulses of so long a time


class FrameDoor:
    """The door of one line."""

    def __init__(self, door: Door, device: str, time_scale: float = 1.0) -> None:
        """door: counts and says what is refused; time_scale: device seconds per host second."""
        self._door, self._device, self._scale = door, device, time_scale
        self._last: Frame | None = None
        self._last_ns = 0
        self._held: Frame | None = None
        self._held_ns = 0
        self._next: dict[int, tuple[int, int]] = {}  # type: next index, time of the frame before
        self._doubted: dict[int, int] = {}  # type: index that would go on from a refused one

    @property
    def pending(self) -> int:
        """Bytes of the frame that is held."""
        return 0 if self._held is None else self._held.wire_size

    def take(self, frame: Frame, at_ns: int) -> tuple[list[Frame], list[Frame]]:
        """One frame of the line, received at a monotonic time: (those to be used, those refused),
        in the order of the line.
        """
        last, held = self._last, self._held
        if last is None or self._goes_on(last, self._last_ns, frame, at_ns):
            refused = [] if held is None else [held]
            self._held = None
            return self._judge([frame], refused, at_ns)
        if held is not None and self._goes_on(held, self._held_ns, frame, at_ns):
            return self._begin([held, frame], [], at_ns)
        self._held, self._held_ns = frame, at_ns
        return self._judge([], [] if held is None else [held], at_ns)

    def wait(self, now_ns: int) -> list[Frame]:
        """Nothing has come for a while: a frame that is held and looks like the first of a boot is
        passed on without another.
        """
        held = self._held
        if held is None or now_ns - self._held_ns < QUIET_NS:
            return []
        if held.seq >= FRAMES or held.t_us >= AHEAD_US:
            return []
        return self._begin([held], [], now_ns)[0]

    def _begin(
        self, frames: list[Frame], strays: list[Frame], at_ns: int
    ) -> tuple[list[Frame], list[Frame]]:
        self._held = None
        self._next.clear()
        self._doubted.clear()
        return self._judge(frames, strays, at_ns)

    def _goes_on(self, a: Frame, a_ns: int, b: Frame, b_ns: int) -> bool:
        step = (b.seq - a.seq) % WRAP
        if a.epoch != b.epoch or step >= WRAP // 2 or b.t_us > LATEST_US:
            return False
        passed_us = b.t_us - a.t_us
        if passed_us < -BACK_US:
            passed_us += WRAP  # a clock of 32 bits has wrapped
        host_us = (b_ns - a_ns) * 1e-3 * self._scale
        if not -BACK_US <= passed_us <= AHEAD_US + 2.0 * max(host_us, 0.0):
            return False
        return step <= FRAMES + FRAMES_PER_S * max(passed_us, host_us, 0.0) * 1e-6

    def _judge(
        self, frames: list[Frame], strays: list[Frame], at_ns: int
    ) -> tuple[list[Frame], list[Frame]]:
        good, refused = [], list(strays)
        for stray in strays:
            found = f"boot {stray.epoch}, frame {stray.seq}, {stray.t_us} us"
            self._refuse(Refusal("stray", "header", found, "one that another frame goes on from"))
        for frame in frames:
            self._last, self._last_ns = frame, at_ns
            why = self._wrong(frame)
            if why is None:
                good.append(frame)
            else:
                refused.append(frame)
                self._refuse(why)
        return good, refused

    def _refuse(self, why: Refusal) -> None:
        self._door.refuse(self._device, why, self._device)

    def _wrong(self, frame: Frame) -> Refusal | None:
        if frame.t_us > LATEST_US:
            return Refusal("time", "t_us", str(frame.t_us), f"at most {LATEST_US}")
        payload = frame.payload
        rule = RULES.get(type(payload))
        why = None if rule is None else rule(payload)
        if why is None and isinstance(payload, Acc12 | Imu6 | Adc) and payload.counts:
            why = self._wrong_index(frame, payload)
        return why

    def _wrong_index(self, frame: Frame, payload: Acc12 | Imu6 | Adc) -> Refusal | None:
        """An index that has moved further than time has; a second frame that agrees is believed."""
        first, n = payload.first_index, len(payload.counts)
        following = (first + n) % WRAP
        expected, before_us = self._next.get(frame.type, (first, frame.t_us))
        gap = (first - expected + WRAP // 2) % WRAP - WRAP // 2
        allowed = SAMPLES + 2 * max(0, frame.t_us - before_us) * 1000 // payload.period_ns
        if not -n <= gap <= allowed and self._doubted.get(frame.type) != first:
            self._doubted[frame.type] = following
            return Refusal("index", "first_index", str(first), f"about {expected}")
        self._doubted.pop(frame.type, None)
        self._next[frame.type] = following, frame.t_us
        return None


def _between(name: str, value: int, low: int, high: int, kind: str) -> Refusal | None:
    if low <= value <= high:
        return None
    return Refusal(kind, name, str(value), f"{low} to {high}")


def _period(payload: Acc12 | Imu6 | Adc) -> Refusal | None:
    if not payload.counts:
        return None
    return _between("period_ns", payload.period_ns, LEAST_PERIOD_NS, WRAP, "period")


def _imu(payload: Imu6) -> Refusal | None:
    return (
        _period(payload)
        or _between("accel_scale_ug", payload.accel_scale_ug, 1, MOST_SCALE_UG, "scale")
        or _between("gyro_scale_nrad", payload.gyro_scale_nrad, 0, MOST_SCALE_NRAD, "scale")
    )


def _adc(payload: Adc) -> Refusal | None:
    if payload.counts and not payload.channel_mask:
        return Refusal("inputs", "channel_mask", "0", "one input or more")
    return _period(payload) or _between("vref_mv", payload.vref_mv, *VREF_MV, "scale")


def _hello(payload: Hello) -> Refusal | None:
    for sensor in payload.sensors:
        why = _between("sensors.scale_ng", sensor.scale_ng, 0, MOST_SCALE_NG, "scale")
        if why is not None:
            return why
    period_ns = payload.sample_period_ns or LEAST_PERIOD_NS  # 0: it takes no samples
    return _between("sample_period_ns", period_ns, LEAST_PERIOD_NS, WRAP, "period")


def _tacho(payload: Tacho) -> Refusal | None:
    before = 0
    for offset in payload.offsets_10ns:
        if not before <= offset <= PULSES_10NS:
            return Refusal("pulses", "offsets_10ns", str(offset), f"{before} to {PULSES_10NS}")
        before = offset
    return None


RULES: dict[type, Callable[[Any], Refusal | None]] = {
    Acc12: _period,
    Imu6: _imu,
    Adc: _adc,
    Hello: _hello,
    Tacho: _tacho,
}
