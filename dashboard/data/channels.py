"""What a device has to draw, by name: `omega_z`, `products_free_omega_z`, `a1_x`, `tachometer`.

A name says the estimator first, or what measures. Without one it is the leading estimator's, and of
a board with gyroscopes but no rate estimator the gyroscope's. Units are those of the charts.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dashboard.data.device import Device
from dashboard.data.ring import blank, gap_limit
from dashboard.data.tables import TABLES
from logs.figures.expression import Expression, evaluate, known_names, read, unit_of
from logs.figures.names import axis_channel, line_title, slug
from logs.figures.quantity import ExpressionError, Quantity
from logs.figures.units import spelt, unit

Array = NDArray[np.float64]

DEG = 180.0 / np.pi
SHOWN = {"rad/s": ("°/s", DEG), "rad": ("°", DEG)}  # unit of a table -> of the charts
XYZ, NED = ("_x", "_y", "_z"), ("_north", "_east", "_down")
TRIADS = tuple(axis_channel(k).removeprefix("a") for k in range(48))
INPUTS = tuple(str(k + 1) for k in range(16))
# topic: who it is where no estimator says so, and (column, word, what its components are called)
NAMED = {
    "rate": (
        "",
        (
            ("omega_ib_b", "omega", XYZ),
            ("f_b", "f", XYZ),
            ("sigma", "sigma", XYZ),
            ("bound", "bound", XYZ),
            ("angle_z", "angle_z", ()),
            ("nis", "nis", ()),
        ),
    ),
    "imu": ("gyro", (("omega_ib_b", "omega", XYZ), ("f_b", "f", XYZ))),
    "tacho": ("", (("omega", "tachometer", ()), ("sigma", "tachometer_sigma", ()))),
    "accel": ("", (("f", "a", TRIADS),)),
    "adc": ("", (("counts", "adc", INPUTS),)),
    "truth": (
        "truth",
        (("omega_ib_b", "omega", XYZ), ("f_b", "f", XYZ), ("angle_z", "angle_z", ())),
    ),
    "attitude": ("", (("roll", "roll", ()), ("pitch", "pitch", ()), ("bias", "bias", XYZ))),
    "nav": (
        "",
        (
            ("p_n", "p", NED),
            ("v_n", "v", NED),
            ("sigma_p_n", "sigma", NED),
            ("yaw", "yaw", ()),
            ("horizon", "horizon", ()),
        ),
    ),
    "gnss": ("gnss", (("p_n", "p", NED),)),
    "innovation": ("", (("nis", "nis", ()), ("error", "error", NED))),
}
JUDGED = {"omega_ib_b": 0, "angle_z": 2}  # columns that `sight` is about, and of which component
LEADING = ("rate", "imu", "attitude", "nav", "innovation")  # whose names stand alone, too


@dataclass(frozen=True)
class Channel:
    """One component of a table of a device."""

    name: str
    who: str  # for people
    topic: str
    estimator: str
    column: str
    part: int | None
    unit: str
    factor: float  # to the unit

    def of(self, rows: np.ndarray) -> Array:
        """Its values (n,) of rows (n,) of the table."""
        values = rows[self.column]
        return self.factor * (values if self.part is None else values[:, self.part])


def channels(device: Device) -> dict[str, Channel]:
    """What a device has, by name. Call under the store's lock."""
    found: dict[str, Channel] = {}
    for topic, (measures, columns) in NAMED.items():
        estimators = [e for e in device.estimators(topic) if (topic, e) in device.rings]
        for estimator in estimators:
            ring = device.rings[topic, estimator]
            own = [pair for one in columns for pair in _parts(topic, estimator, ring.dtype, one)]
            before = slug(estimator) or measures
            for word, one in own:
                name = f"{before}_{word}" if before else word
                found.setdefault(name, replace(one, name=name))
            if topic in LEADING and estimator == estimators[0]:
                for word, one in own:
                    found.setdefault(word, replace(one, name=word))
    return found


def _parts(
    topic: str, estimator: str, dtype: np.dtype, column: tuple[str, str, tuple[str, ...]]
) -> Iterable[tuple[str, Channel]]:
    name, word, parts = column
    if name not in (dtype.names or ()):
        return
    declared = next(one.unit for one in TABLES[topic].columns if one.name == name)
    shown, factor = SHOWN.get(declared, (declared, 1.0))
    width = (dtype[name].shape or (0,))[0]
    who = line_title(estimator or {"imu": "gyro"}.get(topic, topic))
    for k in range(min(width, len(parts))) if width else (None,):
        called = word if k is None else word + parts[k]
        whose = f"axis a{k // 3 + 1}{k % 3 + 1}" if topic == "accel" else who  # as in the scene
        yield called, Channel(called, whose, topic, estimator, name, k, shown, factor)


@dataclass(frozen=True)
class Drawn:
    """A derived curve: t (n,) s, y (n,) in `unit`, and the channels that it was made of.

    It knows no more than they do: sight (n,) is the worst that is said of one of them.
    """

    t: Array
    y: Array
    unit: str
    of: tuple[Channel, ...]
    sight: Array


def derived(
    device: Device, expression: Expression, t0: float, t1: float, named: dict[str, Channel]
) -> Drawn:
    """A derived curve in a window, at the samples of the channel that has the fewest: the others
    are taken between their neighbours, and not across a gap. Raises ExpressionError.
    """
    known_names(expression, {*named, "t"})
    used = {name: named[name] for name in expression.names if name != "t"}
    sources = {(one.topic, one.estimator) for one in used.values()}
    tables = {source: device.window(*source, t0, t1) for source in sorted(sources)}
    if not tables:  # of time alone
        tables = {("", ""): (np.linspace(t0, t1, 2), blank(np.dtype([("t", float)]), 2))}
    t = min((table[0] for table in tables.values()), key=len)
    known, sight = {"t": Quantity(t, unit("s"))}, np.zeros(len(t))
    for name, one in used.items():
        own, rows = tables[one.topic, one.estimator]
        known[name] = Quantity(between(t, own, one.of(rows)), unit(one.unit))
        words = sight_of(one, rows)
        if words is not None:
            sight = np.fmax(sight, _nearest(t, own, words))
    if not len(t):
        return Drawn(t, t, expression.given, tuple(used.values()), sight)
    found = evaluate(expression, known)
    return Drawn(
        np.array(t), np.asarray(found.values), spelt(found.unit), tuple(used.values()), sight
    )


def judged(device: Device, lines: Sequence[str]) -> list[dict[str, str]]:
    """Of each line its unit, or the sentence that says what is wrong with it, for this device."""
    found = []
    units = {name: unit(one.unit) for name, one in channels(device).items()} if lines else {}
    for line in lines:
        said = {"text": line, "unit": "", "fault": ""}
        try:
            said["unit"] = unit_of(read(line), units | {"t": unit("s")})
        except ExpressionError as error:
            said["fault"] = str(error)
        found.append(said)
    return found


def between(at: Array, t: Array, y: Array) -> Array:
    """y (n,) of times t (n,) at other times (m,): on the line between neighbours, NaN where there
    is none on both sides, or where they are further apart than samples usually are.
    """
    if len(at) == len(t) and np.array_equal(at, t):
        return np.asarray(y)
    if len(t) < 2:
        return np.full(len(at), np.nan)
    after = np.clip(np.searchsorted(t, at, side="left"), 1, len(t) - 1)
    inside = (at >= t[0]) & (at <= t[-1]) & (t[after] - t[after - 1] <= gap_limit(t))
    share = (at - t[after - 1]) / (t[after] - t[after - 1])
    with np.errstate(invalid="ignore"):
        found = y[after - 1] + share * (y[after] - y[after - 1])
    exact = at == t[after]  # a neighbour that is not known does not matter there
    return np.where(inside, np.where(exact, y[after], found), np.nan)


def sight_of(one: Channel, rows: np.ndarray) -> Array | None:
    """What the estimator says of a channel (n,), RateEstimate.Sight; None: it has no such word."""
    if one.topic != "rate" or one.column not in JUDGED:
        return None
    part = JUDGED[one.column] if one.part is None else one.part
    return rows["sight"][:, part]


def _nearest(at: Array, t: Array, words: Array) -> Array:
    """The words (n,) of times t (n,) at other times (m,): of the sample after each, and the last's
    beyond it.
    """
    if not len(t):
        return np.zeros(len(at))
    return words[np.clip(np.searchsorted(t, at), 0, len(t) - 1)]
