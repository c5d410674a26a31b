"""Where a session lies on the time of another: by clock, tachometer or rate."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from sessions.library.correlation import GOOD, Shift, correlate
from sessions.library.curves import RATE, TACHO, Curves, Line

Array = NDArray[np.floating[Any]]

MOST = 4  # sessions
METHODS = ("auto", "clock", "tacho", "rate", "start")


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


def key_of(line: Line | None) -> str:
    return line.key if line is not None else ""


def laid(a: Curves, b: Curves, method: str, given: float | None, estimator: str) -> Overlaid:
    """Where b lies over a."""
    lead = key_of(b.lead(estimator))
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
