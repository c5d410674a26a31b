"""What is outside the board: motion that sensors feel, pulses, the receiver's bytes. Times are
seconds since power.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def still(sensor: int, t_s: Array) -> Array:
    """A cube at rest: +-1 g on every sensor's z, nothing else; counts of 3.9 mg."""
    counts = np.zeros((len(t_s), 3))
    counts[:, 2] = 256.4 if sensor < 2 else -256.4
    return counts


@dataclass
class World:
    """Everything the board can sense. All functions must give the same answers in every run."""

    counts: Callable[[int, Array], Array] = (
        still  # sensor, times (n,) s -> (n, 3), not rounded, 3.9 mg each
    )
    pulses: Callable[[], Iterator[tuple[float, int]]] = lambda: iter(
        ()
    )  # (time s, direction +1 or -1; 0: none now)
    pps: Callable[[], Iterator[float]] = lambda: iter(())  # times, s
    gnss: Callable[[], Iterator[tuple[float, bytes]]] = lambda: iter(
        ()
    )  # (time s of the first bit, bytes)
    analog: Callable[[int, float], float] = lambda channel, t_s: 1.65  # volts at the converter
    odr_error: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)  # of the sensors' own sampling clocks
    phase: tuple[float, ...] = (0.1, 0.35, 0.6, 0.85)  # of their first samples, 0 to 1 of a period
    clock_error: float = 0.0  # of the board's crystal: 200e-6 runs 200 ppm fast
    uid: bytes = field(default=b"emulated lpc1768")


@dataclass(frozen=True)
class Fault:
    """Something that goes wrong in the world at a time."""

    name: str
    at_s: float
    sensor: int = 0
    seconds: float = 0.0


class FaultError(ValueError):
    """A fault that cannot be injected."""


SENSOR_FAULTS = {
    "sensor-dead": "dead",
    "sensor-stuck": "stuck",
    "sensor-wrong-id": "wrong-id",
    "sensor-good": "good",
}
FAULTS = {
    **{name: "sensor=1..4" for name in SENSOR_FAULTS},
    "uart-stall": "s=seconds",
    "brown-out": "",
    "watchdog": "",
}


def parse_fault(text: str) -> Fault:
    """'sensor-dead@12:sensor=3', 'uart-stall@20:s=1.5', 'brown-out@30'; raises FaultError.

    Sensors are counted from 1 as the triads are; in the Fault from 0.
    """
    head, _, options = text.partition(":")
    name, _, at = head.partition("@")
    known = ", ".join(
        f"{name}@SECONDS{':' + text if text else ''}" for name, text in FAULTS.items()
    )
    if name not in FAULTS:
        raise FaultError(f"fault {text!r}: no {name!r}; want one of {known}")
    try:
        values = dict(pair.split("=") for pair in options.split(",")) if options else {}
        fault = Fault(
            name, float(at), int(values.pop("sensor", 1)) - 1, float(values.pop("s", 0.0))
        )
    except ValueError:
        raise FaultError(f"fault {text!r}: cannot be read; want one of {known}") from None
    if (
        values
        or not fault.at_s >= 0.0
        or not 0 <= fault.sensor < 4
        or (name == "uart-stall" and not fault.seconds > 0)
    ):
        raise FaultError(f"fault {text!r}: a value is missing or out of range; want one of {known}")
    return fault
