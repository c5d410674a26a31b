"""Up to four sessions on one axis of time: aligned, and what differs between them.

Times of a comparison are those of its first session, s from that one's first message.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from inertial.earth import ned_between
from sessions.library.align import GOOD, Shift, correlate
from sessions.library.curves import RATE, TACHO, Curves, Line, Track

Array = NDArray[np.float64]

MOST = 4  # sessions
METHODS = ("auto", "clock", "tacho", "rate", "start")
XYZ = ("x", "y", "z")


class CompareError(ValueError):
    """Sessions that cannot be compared as asked; the text says why."""


@dataclass(frozen=True)
class Overlaid:
    """One session of a comparison."""

    curves: Curves
    offset_s: float  # time in the first session = time in this one + offset
    by: str  # clock (the same board's and gateway's run), tacho, rate, start, or given by a person
    shift: Shift | None = None  # what the correlation found; None where none was made
    lead: str = ""  # key of the line that stands for the session

    @property
    def quality(self) -> str:
        """exact (one clock), good, ambiguous, poor, none; given for a person's offset."""
        if self.by in ("clock", "reference"):
            return "exact"
        if self.by == "given":
            return "given"
        return self.shift.quality if self.shift is not None and self.by != "start" else "none"


@dataclass(frozen=True)
class Difference:
    """RMS of one line minus another over the time that both have."""

    session: str
    line: str  # of that session
    against: str  # of the first session
    rms: dict[str, float]  # component -> rad/s
    seconds: float  # compared


@dataclass(frozen=True)
class TrackDifference:
    """RMS of one track minus another."""

    session: str
    track: str
    against: str
    rms_ned_m: tuple[float, float, float]
    seconds: float


@dataclass(frozen=True)
class Comparison:
    """Sessions laid over one another, the first one unmoved."""

    sessions: list[Overlaid]
    bin_s: float  # of the grid on which differences are taken
    differences: list[Difference] = field(default_factory=list)
    tracks: list[TrackDifference] = field(default_factory=list)

    @property
    def span(self) -> tuple[float, float]:
        """Earliest and latest time of all, s."""
        begins = [one.offset_s for one in self.sessions]
        ends = [one.offset_s + one.curves.seconds for one in self.sessions]
        return min(begins), max(ends)


def compare(
    found: Sequence[Curves],
    method: str = "auto",
    given: Mapping[str, float] | None = None,
    estimator: str = "",
) -> Comparison:
    """Align sessions to the first one and take their differences.

    `method`: one of METHODS; `given`: session id -> offset that a person wants; `estimator`: the
    one whose rate stands for a session, else the first by name. Raises CompareError.
    """
    if not 1 <= len(found) <= MOST:
        raise CompareError(f"{len(found)} sessions: want two to {MOST}")
    if len({one.session for one in found}) < len(found):
        raise CompareError("the same session twice: want different ones")
    if method not in METHODS:
        raise CompareError(f"align by {method!r}: want one of {', '.join(METHODS)}")
    given = given or {}
    unknown = given.keys() - {one.session for one in found}
    if unknown:
        raise CompareError(
            f"offset of {', '.join(sorted(unknown))}: not among the sessions compared"
        )
    first = found[0]
    overlaid = [Overlaid(first, 0.0, "reference", None, _key(first.lead(estimator)))]
    for other in found[1:]:
        overlaid.append(_laid(first, other, method, given.get(other.session), estimator))
    dt = max(one.bin_s for one in found)
    differences = [d for one in overlaid[1:] for d in _differences(overlaid[0], one, dt)]
    tracks = [d for one in overlaid[1:] for d in _track_differences(overlaid[0], one)]
    return Comparison(overlaid, dt, differences, tracks)


def _key(line: Line | None) -> str:
    return line.key if line is not None else ""


def _laid(a: Curves, b: Curves, method: str, given: float | None, estimator: str) -> Overlaid:
    """Where b lies over a."""
    lead = _key(b.lead(estimator))
    if given is not None:
        return Overlaid(b, given, "given", None, lead)
    if method in ("auto", "clock") and (offset := _by_clock(a, b, estimator)) is not None:
        return Overlaid(b, offset, "clock", None, lead)
    for kind in (TACHO, RATE):
        if method not in ("auto", kind):
            continue
        shift = _by_correlation(a, b, kind, estimator)
        if shift is not None and (shift.quality != "none" or method == kind):
            return Overlaid(b, shift.offset_s, kind, shift, lead)
    if method in ("auto", "start"):
        return Overlaid(b, 0.0, "start", None, lead)
    have = (
        "they do not share a run of one gateway"
        if method == "clock"
        else f"one of them has no {method} that varies"
    )
    raise CompareError(f"{b.session} cannot be aligned to {a.session} by {method}: {have}")


def _by_clock(a: Curves, b: Curves, estimator: str) -> float | None:
    """Both recorded one boot of a board through one run of a gateway (or one is the other,
    estimated again).
    """
    offset = (b.start_utc_ns - a.start_utc_ns) / 1e9
    if not set(a.clocks) & set(b.clocks) or not -b.seconds < offset < a.seconds:
        return None
    dt = max(a.bin_s, b.bin_s)
    first, second = signal(a, RATE, estimator, dt), signal(b, RATE, estimator, dt)
    if first is None or second is None:
        return offset
    here = resampled(second, dt, offset, len(first), dt)
    both = np.isfinite(first) & np.isfinite(here)
    if both.sum() < 3 or min(first[both].std(), here[both].std()) == 0.0:
        return offset
    # logs imported without a date share the run number 1, so the number alone proves nothing
    return offset if np.corrcoef(first[both], here[both])[0, 1] >= GOOD else None


def _by_correlation(a: Curves, b: Curves, kind: str, estimator: str) -> Shift | None:
    dt = max(a.bin_s, b.bin_s)
    first, second = signal(a, kind, estimator, dt), signal(b, kind, estimator, dt)
    if first is None or second is None:
        return None
    if kind == TACHO and (np.nanmin(first) >= 0.0) != (np.nanmin(second) >= 0.0):
        first, second = np.abs(first), np.abs(second)  # one of them does not know the direction
    return correlate(first, second, dt)


def signal(curves: Curves, kind: str, estimator: str, dt: float) -> Array | None:
    """What a session is aligned by, every dt s (n,): the tachometer's rate, or |omega|, rad/s; None
    without it.
    """
    if kind == TACHO:
        line = next(iter(curves.of_kind(TACHO)), None)
        values = None if line is None else line.mean[:, 0].astype(float)
    else:
        line = curves.lead(estimator)
        values = None if line is None else np.linalg.norm(line.mean[:, :3].astype(float), axis=1)
    if values is None or not np.isfinite(values).any():
        return None
    n = max(1, round(len(values) * curves.bin_s / dt))
    return resampled(values, curves.bin_s, 0.0, n, dt)


def resampled(values: Array, bin_s: float, offset_s: float, n: int, dt: float) -> Array:
    """Bin means every bin_s s, moved by offset_s, as n means every dt >= bin_s s; NaN outside and
    in gaps.
    """
    width = round(dt / bin_s)
    smooth = (
        uniform_filter1d(values, width, mode="nearest")
        if width > 1 and not np.isnan(values).any()
        else values
    )
    t = (np.arange(len(values)) + 0.5) * bin_s + offset_s
    return np.interp((np.arange(n) + 0.5) * dt, t, smooth, left=np.nan, right=np.nan)


def _differences(a: Overlaid, b: Overlaid, dt: float) -> list[Difference]:
    """Lead against lead, and every further line against its namesake."""
    pairs = [(b.lead, a.lead)] if a.lead and b.lead else []
    pairs += [
        (key, key) for key in b.curves.lines if key in a.curves.lines and (key, key) not in pairs
    ]
    # estimated again beside the old ones: products-ekf-new against products-ekf
    pairs += [
        (key, old)
        for key in b.curves.lines
        if key not in a.curves.lines
        for old in a.curves.lines
        if key.startswith(old + "-") and (key, old) not in pairs
    ]
    found = (difference(b, b.curves.lines[mine], a, a.curves.lines[its], dt) for mine, its in pairs)
    return [one for one in found if one is not None]


def difference(b: Overlaid, line: Line, a: Overlaid, against: Line, dt: float) -> Difference | None:
    """RMS of line minus against per component, on a's grid of dt; None where they have no time in
    common.
    """
    rms: dict[str, float] = {}
    seconds = 0.0
    n = max(1, round(a.curves.seconds / dt))
    for name in XYZ:
        mine, its = line.part(name), against.part(name)
        if mine is None or its is None:
            continue
        delta = resampled(
            mine[0].astype(float), b.curves.bin_s, b.offset_s - a.offset_s, n, dt
        ) - resampled(its[0].astype(float), a.curves.bin_s, 0.0, n, dt)
        there = np.isfinite(delta)
        if there.any():
            rms[name] = float(np.sqrt(np.mean(delta[there] ** 2)))
            seconds = max(seconds, float(there.sum() * dt))
    return Difference(b.curves.session, line.key, against.key, rms, seconds) if rms else None


def moved(track: Track, origin: tuple[float, float, float]) -> Array:
    """A track (m, 4) with its NED counted from another origin; axes are taken as parallel, for
    places near by.
    """
    points = track.points.copy()
    points[:, 1:] += ned_between(origin, track.origin)
    return points


def _track_differences(a: Overlaid, b: Overlaid) -> list[TrackDifference]:
    result = []
    for key, track in b.curves.tracks.items():
        against = a.curves.tracks.get(key)
        if against is None or len(against.points) < 2 or len(track.points) < 2:
            continue
        mine, its = moved(track, against.origin), against.points
        t = mine[:, 0] + b.offset_s - a.offset_s
        inside = (t >= its[0, 0]) & (t <= its[-1, 0])
        if not inside.any():
            continue
        delta = [mine[inside, k] - np.interp(t[inside], its[:, 0], its[:, k]) for k in (1, 2, 3)]
        north, east, down = (float(np.sqrt(np.mean(part**2))) for part in delta)
        seconds = float(t[inside][-1] - t[inside][0])
        result.append(TrackDifference(b.curves.session, key, key, (north, east, down), seconds))
    return result


def errors(curves: Curves) -> dict[str, dict[str, Any]]:
    """Line -> what it was compared with, and the RMS per component, rad/s."""
    result = {}
    for key, line in curves.lines.items():
        reference, parts = curves.error_of(line)
        rms = {
            name: float(np.sqrt(np.nanmean(e.astype(float) ** 2)))
            for name, e in parts.items()
            if np.isfinite(e).any()
        }
        if rms:
            result[key] = {"against": reference, "rms_radps": rms}
    return result


def as_dict(found: Comparison) -> dict[str, Any]:
    """For programs; SI."""
    sessions = []
    for one in found.sessions:
        shift = one.shift
        sessions.append(
            {
                "id": one.curves.session,
                "offset_s": one.offset_s,
                "aligned_by": one.by,
                "quality": one.quality,
                "correlation": shift.correlation if shift else None,
                "overlap_s": shift.overlap_s if shift else None,
                "rival_offset_s": shift.rival_s if shift else None,
                "rival_correlation": shift.rival_correlation if shift else None,
                "seconds": one.curves.seconds,
                "bin_s": one.curves.bin_s,
                "line": one.lead,
                "lines": list(one.curves.lines),
                "tracks": list(one.curves.tracks),
                "errors": errors(one.curves),
            }
        )
    return {
        "sessions": sessions,
        "bin_s": found.bin_s,
        "differences": [
            {
                "session": d.session,
                "line": d.line,
                "against": d.against,
                "rms_radps": d.rms,
                "seconds": d.seconds,
            }
            for d in found.differences
        ],
        "track_differences": [
            {
                "session": d.session,
                "track": d.track,
                "against": d.against,
                "rms_ned_m": list(d.rms_ned_m),
                "seconds": d.seconds,
            }
            for d in found.tracks
        ],
    }
