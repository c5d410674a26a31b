"""What the watch is told, in the board's own time: samples, pulses, estimates, the axes' health.

Times are s of the board's clock since its boot `epoch`; SI, body frame b.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from messages.contract import gyrofree_pb2 as pb
from messages.contract import rates

Array = NDArray[np.float64]
UNFIT = {  # states of an axis that no test is made with; SUSPECT is not known yet
    pb.AxisHealth.STATE_STUCK: "is stuck",
    pb.AxisHealth.STATE_SATURATED: "is at the end of its range",
    pb.AxisHealth.STATE_SWAPPED: "is swapped with another",
    pb.AxisHealth.STATE_FLIPPED: "has the wrong sign",
    pb.AxisHealth.STATE_SPIKING: "has spikes",
    pb.AxisHealth.STATE_BIASED: "has a jumped bias",
    pb.AxisHealth.STATE_STALE: "is not fresh",
}


@dataclass(frozen=True)
class Samples:
    """A batch of accelerometer samples; they move the watch's clock on."""

    epoch: int
    t: Array  # (n,) s
    f_axis: Array  # (n, k) m/s^2
    utc_ns: int  # of the first sample, by the data's clock
    own_axes: bool = True  # False: x, y, z of b


@dataclass(frozen=True)
class Pulse:
    """The table's rate when a pulse came."""

    epoch: int
    t: float
    omega: float  # rad/s
    signed: bool  # False: the direction is not known


@dataclass(frozen=True)
class Turned:
    """What an estimator says of the rate about z_b."""

    epoch: int
    estimator: str
    t: Array  # (n,) s
    omega: Array  # (n,) rad/s
    sigma: Array  # (n,) rad/s
    valid: NDArray[np.bool_]  # (n,)
    still: NDArray[np.bool_]  # (n,)
    aided: bool  # by the tachometer, which then cannot score it


@dataclass(frozen=True)
class Axes:
    """The axes' health and directions, from a moment on."""

    epoch: int
    t: float  # s
    unfit: tuple[tuple[int, str], ...]  # column and what is wrong, for people
    direction_b: Array  # (k, 3)


@dataclass(frozen=True)
class Line:
    """The state of the line to the board."""

    connected: bool
    text: str


@dataclass(frozen=True)
class TableSays:
    """The rate that a driven table reads on itself; it counts where no tachometer is."""

    omega: float  # rad/s


@dataclass(frozen=True)
class Trouble:
    """What goes wrong beside the board: nothing can be measured meanwhile."""

    text: str


Seen = Samples | Pulse | Turned | Axes | Line | TableSays | Trouble


def of(message: object) -> Seen | None:
    """A message of the bus as the watch takes it; None for one that says nothing to it."""
    match message:
        case pb.AccelBatch() if message.axes and len(message.f_mps2) >= message.axes:
            f = np.asarray(message.f_mps2).reshape(-1, message.axes)
            return _samples(message, f, own_axes=True)
        case pb.ImuBatch() if len(message.f_b_mps2) >= 3:
            return _samples(message, np.asarray(message.f_b_mps2).reshape(-1, 3), own_axes=False)
        case pb.TachoRate():
            h = message.header
            return Pulse(h.epoch, h.device_us * 1e-6, message.omega_radps, message.direction_known)
        case pb.RateBatch() if len(message.omega_ib_b_radps) >= 3:
            return _turned(message)
        case pb.AxisHealth() if message.axes:
            return _axes(message)
        case pb.LinkStatus():
            return Line(message.connected, message.message)
    return None


def _samples(m: pb.AccelBatch | pb.ImuBatch, f: Array, own_axes: bool) -> Samples:
    t = m.header.device_us * 1e-6 + m.period_s * np.arange(len(f))
    return Samples(m.header.epoch, t, f, m.header.utc_ns, own_axes)


def _turned(m: pb.RateBatch) -> Turned | None:
    n = rates.count(rates.complete(m))
    omega = np.asarray(m.omega_ib_b_radps)
    if len(omega) != 3 * n or len(m.omega_covariance) != 9 * n:
        return None
    sight = np.asarray(m.sight) if len(m.sight) == 3 * n else np.zeros(3 * n, dtype=int)
    variance = np.asarray(m.omega_covariance).reshape(n, 9)[:, 8]
    return Turned(
        epoch=m.header.epoch,
        estimator=m.estimator,
        t=m.header.device_us * 1e-6 + m.period_s * np.arange(n),
        omega=omega.reshape(n, 3)[:, 2],
        sigma=np.sqrt(np.maximum(variance, 0.0)),
        valid=(sight.reshape(n, 3)[:, 2] == pb.RateEstimate.SIGHT_VALID) & np.isfinite(variance),
        still=np.asarray(m.still[:n], dtype=bool),
        aided=bool(m.aid),
    )


def _axes(m: pb.AxisHealth) -> Axes | None:
    unfit = tuple(
        (k, f"axis {axis.name} {UNFIT[axis.state]}")
        for k, axis in enumerate(m.axes)
        if axis.state in UNFIT
    )
    rows = [list(axis.direction_b) for axis in m.axes]
    if any(len(row) != 3 for row in rows):
        rows = []
    h = m.header
    return Axes(h.epoch, h.device_us * 1e-6, unfit, np.array(rows).reshape(-1, 3))
