"""Up to four sessions on one axis of time: aligned, and what differs between them.

Times of a comparison are those of its first session, s from that one's first message.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inertial.earth import ned_between
from logs.figures.sight import vouched
from sessions.library.align import METHODS, MOST, CompareError, Overlaid, key_of, laid, resampled
from sessions.library.curves import Curves, Line, Track

Array = NDArray[np.float64]

XYZ = ("x", "y", "z")


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
    rms_ned_m: tuple[float | None, ...]  # None: one of the two has no height
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
    overlaid = [Overlaid(first, 0.0, "reference", None, key_of(first.lead(estimator)))]
    for other in found[1:]:
        overlaid.append(laid(first, other, method, given.get(other.session), estimator))
    dt = max(one.bin_s for one in found)
    differences = [d for one in overlaid[1:] for d in _differences(overlaid[0], one, dt)]
    tracks = [d for one in overlaid[1:] for d in _track_differences(overlaid[0], one)]
    return Comparison(overlaid, dt, differences, tracks)


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
    """RMS of line minus against per component, on a's grid of dt, over the time for which both
    estimators vouch; None without any.
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
        t = (np.arange(n) + 0.5) * dt
        there &= _vouches(line, name, (t - (b.offset_s - a.offset_s)) / b.curves.bin_s)
        there &= _vouches(against, name, t / a.curves.bin_s)
        if there.any():
            rms[name] = float(np.sqrt(np.mean(delta[there] ** 2)))
            seconds = max(seconds, float(there.sum() * dt))
    return Difference(b.curves.session, line.key, against.key, rms, seconds) if rms else None


def _vouches(line: Line, component: str, at: Array) -> NDArray[np.bool_]:
    """Whether an estimator vouches for a component at so many bins (n,) from its start."""
    sight = line.said_of(component)
    if sight is None or not len(sight):
        return np.ones(len(at), dtype=bool)
    return sight[np.clip(at.astype(np.int64), 0, len(sight) - 1)] == 0


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
        rms = tuple(
            float(np.sqrt(np.nanmean(part**2))) if np.isfinite(part).any() else None
            for part in delta
        )
        seconds = float(t[inside][-1] - t[inside][0])
        result.append(TrackDifference(b.curves.session, key, key, rms, seconds))
    return result


def errors(curves: Curves) -> dict[str, dict[str, Any]]:
    """Line -> what it was compared with, per component the RMS of what the estimator vouches for,
    rad/s, and how much of all that is, 0 to 1.
    """
    result = {}
    for key, line in curves.lines.items():
        reference, parts = curves.error_of(line)
        rms, share = {}, {}
        for name, error in parts.items():
            there = np.isfinite(error)
            known = np.isfinite(vouched(error.astype(float), line.said_of(name)))
            if there.any():
                share[name] = float(known.sum() / there.sum())
            if known.any():
                rms[name] = float(np.sqrt(np.mean(error[known].astype(float) ** 2)))
        if share:
            result[key] = {"against": reference, "rms_radps": rms, "valid_share": share}
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
                "damage": list(one.curves.said),
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
