"""The curves of a session on one even grid of time, kept beside its recording: what overlays and
pages draw.

A recording is read once (curves_build.py). Every line (rate of an estimator, gyro, tachometer,
truth) becomes the mean, the least and the greatest value per bin of time, at most BINS of them, so
that any window of any session is drawn and compared within milliseconds. The file curves.npz is a
cache: it carries size and time of the recording that it was made of, is made anew when they differ,
and goes with the session's folder.
"""

import json
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]

FILE = "curves.npz"
FORMAT = 4
BINS = 100_000  # at most, per line
STEPS = (1, 2, 5)  # bins are 1, 2 or 5 times a power of ten, s

RATE, GYRO, TACHO, TRUTH = "rate", "gyro", "tacho", "truth"
AXES, FORCE = "axes", "force"  # what accelerometers read, m/s²
COMPONENTS = {
    RATE: ("x", "y", "z", "angle_z"),
    TRUTH: ("x", "y", "z", "angle_z"),
    GYRO: ("x", "y", "z"),
    TACHO: ("z",),
}
#  x, y, z: omega_ib_b, rad/s; angle_z: rad


@dataclass(frozen=True)
class Line:
    """One source of rate on the session's grid; NaN where there is nothing."""

    key: str  # <device>/<kind>[/<estimator>]
    mean: Array  # (n, components)
    low: Array  # the same as mean where a bin holds one sample at most
    high: Array
    names: tuple[str, ...] = ()  # of the columns, where the kind does not say them
    # (n, 3): the worst that an estimator said of x, y, z in a bin, RateEstimate.Sight
    sight: NDArray[np.uint8] | None = None

    @property
    def kind(self) -> str:
        """rate, gyro, tacho or truth."""
        return self.key.split("/")[1]

    @property
    def device(self) -> str:
        """Whose it is."""
        return self.key.split("/")[0]

    @property
    def title(self) -> str:
        """For a legend: the estimator, or what it is."""
        return self.key.split("/")[-1]

    @property
    def components(self) -> tuple[str, ...]:
        """Names of the columns."""
        return self.names or COMPONENTS[self.kind]

    def said_of(self, component: str) -> NDArray[np.uint8] | None:
        """What an estimator says of one component, (n,), RateEstimate.Sight; of an angle, what of
        the rate that it is the integral of. None where nobody says.
        """
        axis = "xyz".find(component[-1])
        return None if self.sight is None or axis < 0 else self.sight[:, axis]

    def part(self, component: str) -> tuple[Array, Array, Array] | None:
        """Mean, least and greatest of one component, (n,); None where the line has no such."""
        if component not in self.components:
            return None
        k = self.components.index(component)
        return self.mean[:, k], self.low[:, k], self.high[:, k]


@dataclass(frozen=True)
class Track:
    """Where a navigation filter, or a receiver, was."""

    key: str  # <device>/nav/<filter> or <device>/gnss
    points: Array  # (m, 4): t s, north, east, down m from the origin
    origin: tuple[float, float, float]  # latitude, longitude rad, height m
    # (m, 4): covariance north-north, north-east, east-east, m², NaN where it is not said, and
    # GnssFix.Quality
    told: Array


@dataclass(frozen=True)
class Mark:
    """A remark in the recording."""

    t: float  # s from the first message
    text: str
    author: str
    seconds: float = 0.0  # length of what it is about


@dataclass(frozen=True)
class Curves:
    """Everything that is drawn of a session. Times in s from its first message."""

    session: str
    start_utc_ns: int  # receive time of the first message
    seconds: float
    bin_s: float
    lines: dict[str, Line] = field(default_factory=dict)
    tracks: dict[str, Track] = field(default_factory=dict)
    marks: tuple[Mark, ...] = ()
    clocks: tuple[
        str, ...
    ] = ()  # <device>/<gateway run>/<boot>: sessions that share one have one clock
    coarse: bool = False  # a first look at a part of the file
    leader: str = ""  # the first estimator of the configuration it was recorded with
    axes: dict[str, Line] = field(default_factory=dict)  # <device>/axes or /force; means alone
    said: tuple[str, ...] = ()  # sentences about damage of the recording

    @property
    def t(self) -> Array:
        """Middle of every bin, s."""
        every = [*self.lines.values(), *self.axes.values()]
        n = len(every[0].mean) if every else 0
        return (np.arange(n) + 0.5) * self.bin_s

    def of_kind(self, kind: str) -> list[Line]:
        """Lines of one kind, by name."""
        return [line for _, line in sorted(self.lines.items()) if line.kind == kind]

    def lead(self, wanted: str = "") -> Line | None:
        """The line that stands for the session's rate: the wanted estimator's, else the first
        one's, else the gyro.
        """
        rates = self.of_kind(RATE)
        wanted = wanted or self.leader
        named = [line for line in rates if line.title == wanted] or [
            line for line in rates if wanted and line.title.startswith(wanted)
        ]
        return next(iter([*named, *rates, *self.of_kind(GYRO)]), None)

    def error_of(self, line: Line) -> tuple[str, dict[str, Array]]:
        """What the line differs from: ("truth" or "tacho", component -> difference (n,)); ("", {})
        without either.
        """
        for kind in (TRUTH, TACHO):
            reference = next(
                (other for other in self.of_kind(kind) if other.device == line.device), None
            )
            if reference is None or reference is line:
                continue
            shared = [
                name
                for name in ("x", "y", "z")
                if name in reference.components and name in line.components
            ]
            return kind, {
                name: line.mean[:, line.components.index(name)]
                - reference.mean[:, reference.components.index(name)]
                for name in shared
            }
        return "", {}


def bin_for(seconds: float, least_s: float, bins: int = BINS) -> float:
    """Width of bins for a session of that length: 1, 2 or 5 times a power of ten, not below
    least_s.
    """
    wanted = max(least_s, seconds / bins, 1e-3)
    power = 10.0 ** np.floor(np.log10(wanted))
    for step in (*STEPS, 10):
        if step * power >= wanted * (1 - 1e-3):  # a clock's jitter
            return float(step * power)
    raise AssertionError("ten times a power of ten is the next one")


def bins_of(seconds: float, bin_s: float) -> int:
    """How many bins hold 0 to seconds, both included."""
    return int(np.floor(seconds / bin_s + 1e-6)) + 1


def stamp(path: Path) -> list[int]:
    """What tells one state of a recording from another. Raises OSError."""
    found = path.stat()
    return [found.st_size, found.st_mtime_ns]


def save(curves: Curves, recording: Path) -> Path:
    """Write beside the recording, in one step. Raises OSError, ValueError for a first look, which
    is not kept.
    """
    if curves.coarse:
        raise ValueError(f"{recording}: curves of a part of it are not kept")
    arrays: dict[str, Any] = {}
    for k, line in enumerate(curves.lines.values()):
        arrays[f"mean{k}"] = line.mean.astype(np.float32)
        if line.sight is not None:
            arrays[f"sight{k}"] = line.sight
        if line.low is not line.mean:
            arrays[f"low{k}"], arrays[f"high{k}"] = (
                line.low.astype(np.float32),
                line.high.astype(np.float32),
            )
    for k, track in enumerate(curves.tracks.values()):
        arrays[f"track{k}"], arrays[f"told{k}"] = track.points, track.told
    for k, line in enumerate(curves.axes.values()):
        arrays[f"axes{k}"] = line.mean.astype(np.float32)
    facts = {
        "format": FORMAT,
        "of": stamp(recording),
        "session": curves.session,
        "start_utc_ns": curves.start_utc_ns,
        "seconds": curves.seconds,
        "bin_s": curves.bin_s,
        "lines": list(curves.lines),
        "axes": [[line.key, line.names] for line in curves.axes.values()],
        "tracks": [[track.key, track.origin] for track in curves.tracks.values()],
        "clocks": curves.clocks,
        "leader": curves.leader,
        "said": curves.said,
        "marks": [[mark.t, mark.text, mark.author, mark.seconds] for mark in curves.marks],
    }
    arrays["facts"] = np.frombuffer(json.dumps(facts).encode(), np.uint8)
    target = recording.parent / FILE
    new = target.with_name(f".{os.getpid()}-{FILE}")
    try:
        with new.open("wb") as stream:
            np.savez(stream, **arrays)
        os.replace(new, target)
    finally:
        new.unlink(missing_ok=True)
    return target


def state(recording: Path) -> str:
    """`none`, `stale` or `fresh`: the curves kept beside a recording. Raises OSError without a
    recording.
    """
    facts = _facts(recording.parent / FILE)
    if facts is None:
        return "none"
    if facts["of"] != stamp(recording) or facts["format"] != FORMAT:
        return "stale"
    return "fresh"


def _facts(path: Path) -> dict[str, Any] | None:
    try:
        with np.load(path, allow_pickle=False) as data:
            found: dict[str, Any] = json.loads(bytes(data["facts"]))
            return found if isinstance(found, dict) and {"of", "format"} <= found.keys() else None
    except (
        OSError,
        ValueError,
        KeyError,
        EOFError,
        AttributeError,
        RecursionError,
    ):  # AttributeError: a bare array, no archive
        return None
    except Exception as error:  # a cut archive: zipfile and zlib have errors of their own
        if type(error).__module__ in ("zipfile", "zlib"):
            return None
        raise


def load(recording: Path) -> Curves | None:
    """The kept curves; None when there are none, when they are of another state of the recording,
    or damaged.
    """
    path = recording.parent / FILE
    if state(recording) != "fresh":
        return None
    with np.load(path, allow_pickle=False) as data:
        facts = json.loads(bytes(data["facts"]))
        lines = {}
        for k, key in enumerate(facts["lines"]):
            mean = data[f"mean{k}"]
            low, high = (data[f"low{k}"], data[f"high{k}"]) if f"low{k}" in data else (mean, mean)
            sight = data[f"sight{k}"] if f"sight{k}" in data else None
            lines[key] = Line(key, mean, low, high, sight=sight)
        axes = {
            key: Line(key, data[f"axes{k}"], data[f"axes{k}"], data[f"axes{k}"], tuple(names))
            for k, (key, names) in enumerate(facts["axes"])
        }
        tracks = {
            key: Track(key, data[f"track{k}"], (origin[0], origin[1], origin[2]), data[f"told{k}"])
            for k, (key, origin) in enumerate(facts["tracks"])
        }
    return Curves(
        facts["session"],
        facts["start_utc_ns"],
        facts["seconds"],
        facts["bin_s"],
        lines,
        tracks,
        tuple(Mark(*mark) for mark in facts["marks"]),
        tuple(facts["clocks"]),
        leader=facts["leader"],
        axes=axes,
        said=tuple(facts.get("said", ())),
    )
