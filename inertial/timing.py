"""When samples were taken: period, sample numbers, jitter and holes of a row of time stamps.

The one answer to "is a sample missing?" for logs, whatever reads them. Stamps may be cut to whole
milliseconds, may jitter by half a period, may come in bursts after a loss. Two readings of a row
compete on its longest stretch without a hole:

    even      nothing is missing: stamps are a + T k with errors            T by least squares
    gappy     the usual step is the period, longer ones are lost samples    T about the median step

`gappy` is believed only where it explains the stamps much better, and not where the stamps are too
coarse to show single steps: 800 Hz in whole milliseconds looks like 1 kHz with every fifth sample
lost, but no loss is that regular.

Before that, `straight` mends what is a property of the clock and not of the samples: counters that
began anew at their end, and samples that were read in a burst and share one stamp.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

HOLE = 2.2  # of the longest usual step; a longer one ends a stretch
OFTEN = 0.96  # quantile of the steps that are usual: bursts of up to 25 samples are no holes
LONG = 16  # samples that a stretch has at least, on the average
COARSE = 3.0  # units of the stamps' last digit; a shorter period cannot be seen in single steps
BETTER = 0.6  # of the even reading's residual: the gappy one must be this good to be believed
PICO = 12  # digits of a period, s: what stands behind is what sums of stamps were rounded by
DIGITS = 10.0 ** np.arange(-3, -10, -1)  # s, last digits that clocks have; 10 ms is a period
MOST = 0.75  # share of a stretch that may be missing; more is a burst, not a loss
ENOUGH = 8  # steps; fewer tell nothing of a pattern
WRAPS = {  # s, after which counters begin anew
    **{
        bits_units * unit: f"a counter of {bits} bits in {name}"
        for bits, bits_units in ((16, 2**16), (24, 2**24), (32, 2**32))
        for unit, name in ((1e-9, "ns"), (1e-6, "us"), (1e-3, "ms"))
    },
    86_400.0: "the time of day",
    604_800.0: "the time of the GPS week",
}
WRAP_STEPS = 8.0  # usual steps that may lie between the samples around a counter's end


class TimingError(ValueError):
    """Stamps that are no time axis. `row` is the first one that is wrong, from 0."""

    def __init__(self, row: int, text: str) -> None:
        super().__init__(text)
        self.row = row


@dataclass(frozen=True)
class Hole:
    """Samples that are missing."""

    row: int  # of the first sample after it
    t_s: float  # s, of the last sample before it
    seconds: float  # between the samples around it
    missing: int  # samples


@dataclass(frozen=True)
class Timing:
    """What a row of n stamps says."""

    period_s: float
    index: NDArray[np.int64]  # (n,) sample numbers from 0, the missing ones counted
    jitter_s: float  # RMS of the stamps about even times, between holes
    resolution_s: float  # last digit of the stamps; 0 where none is seen
    holes: tuple[Hole, ...]
    mended: tuple[str, ...] = ()  # for people: what `straight` made of the stamps

    @property
    def missing(self) -> int:
        """Samples between the first and the last that are not there."""
        return int(self.index[-1]) + 1 - len(self.index)


def straight(t_s: Array, same: NDArray[np.bool_] | None = None) -> tuple[Array, tuple[str, ...]]:
    """Stamps t_s (n,), s, without the ends of their counter and with bursts spread, and in words
    what was done. same (n,): rows that repeat the one before in all that was measured.

    Raises TimingError for samples that stand there twice.
    """
    t, said = _unwrapped(np.asarray(t_s, dtype=np.float64))
    equal = np.concatenate([[False], np.diff(t) == 0.0])
    if not equal.any() or (np.diff(t) < 0.0).any() or t[0] == t[-1]:
        return t, said
    rows, twice = int(equal.sum()), 0 if same is None else int((equal & same).sum())
    if 2 * twice > rows:
        row = int(np.argmax(equal))
        raise TimingError(
            row,
            f"time {t[row]:.6f} s after {t[row - 1]:.6f} s does not rise ({rows} such rows), and"
            f" {twice} of them repeat the row before in every column: remove repeated samples",
        )
    between = float(np.median(np.diff(t)[~equal[1:]]))
    if between < COARSE * max(_resolution(t), _digit(t)):
        return t, said  # too few digits, no bursts: sample_timing says so
    spread, most = _spread(t, equal)
    return spread, (
        *said,
        f"{rows} samples have the time of the one before, up to {most} in a row: they are spread"
        " evenly, as read in bursts at the time of the last",
    )


def _unwrapped(t: Array) -> tuple[Array, tuple[str, ...]]:
    """Stamps that fall where a counter begins anew, made to rise; as they are where no counter
    explains every fall.
    """
    step = np.diff(t)
    fallen = step < 0.0
    if not fallen.any() or fallen.all():
        return t, ()
    usual = float(np.median(step[step > 0.0])) if (step > 0.0).any() else 0.0
    width = float(t.max() - t.min())
    for after, name in WRAPS.items():
        across = step[fallen] + after
        if width > 1.001 * after or not (across > 0.0).all():
            continue
        if (across <= min(WRAP_STEPS * usual, 0.5 * after)).all():
            count = int(fallen.sum())
            times = "once" if count == 1 else f"{count} times"
            mended = t + after * np.concatenate([[0.0], np.cumsum(fallen)])
            return mended, (f"{name} began anew {times}: times are taken as going on",)
    return t, ()


def _spread(t: Array, equal: NDArray[np.bool_]) -> tuple[Array, int]:
    """Stamps (n,) that do not fall, those of a burst spread back from the last of it, and how many
    the longest burst has.
    """
    starts = np.nonzero(~equal)[0]
    lengths = np.diff(np.concatenate([starts, [len(t)]]))
    steps = np.diff(t[starts]) / lengths[1:]  # of one sample, where none is missing
    usual = float(np.median(steps))
    steps = np.where(steps < 1.5 * usual, steps, usual)  # a longer one has lost samples before it
    of_sample = np.repeat(np.concatenate([[usual], steps]), lengths)
    place = np.arange(len(t)) - np.repeat(starts, lengths)
    return t - (np.repeat(lengths, lengths) - 1 - place) * of_sample, int(lengths.max())


def sample_timing(t_s: Array) -> Timing:
    """Timing of stamps t_s (n,), s, n >= 2. Raises TimingError for times that do not rise."""
    t = np.asarray(t_s, dtype=np.float64)
    if len(t) < 2:
        raise TimingError(0, f"{len(t)} samples; want at least two")
    step = np.diff(t)
    fallen = np.nonzero(~(step > 0.0))[0]  # `straight` has spread equal ones
    if len(fallen):
        row = int(fallen[0]) + 1
        many = f"({len(fallen)} such row{'s' if len(fallen) > 1 else ''})"
        advice = "sort the rows by time"
        if not (step < 0.0).any():
            advice = (
                "write times with more digits, or from the sample's number and the rate; where"
                " samples stand there twice, remove the second (all others are needed)"
            )
        raise TimingError(
            row,
            f"time {t[row]:.6f} s after {t[row - 1]:.6f} s does not rise {many}; {advice}",
        )
    resolution = _resolution(t)
    usual = _usual_step(step)
    longest_usual = max(usual, float(np.quantile(step, OFTEN)))
    ends = np.nonzero(step > HOLE * longest_usual)[0]
    starts = np.concatenate([[0], ends + 1])
    if len(t) < LONG * len(starts):  # losses everywhere, not holes between stretches
        starts = np.zeros(1, dtype=np.int64)
    lengths = np.diff(np.concatenate([starts, [len(t)]]))
    longest = int(starts[lengths.argmax()])
    stretch = t[longest : longest + int(lengths.max())]
    period, even = _period(stretch, usual, resolution)
    index = _number(t, period, starts, even)
    jump = np.diff(index)
    holes = tuple(
        Hole(int(k) + 1, float(t[k]), float(step[k]), int(jump[k]) - 1)
        for k in np.nonzero(jump > 1)[0]
    )
    jitter = _jitter(t, index, starts, period)
    return Timing(round(period, PICO), index, jitter, resolution, holes)


def _digit(t: Array) -> float:
    """The last digit of stamps that have few: 1 s, 0.1 s or 0.01 s; 0 for finer ones."""
    for digit in (1.0, 0.1, 0.01):
        if np.allclose(t / digit, np.rint(t / digit), rtol=0.0, atol=1e-6):
            return digit
    return 0.0


def _resolution(t: Array) -> float:
    """The largest last digit that all stamps agree with, s; 0 for finer ones than a nanosecond."""
    since, rounding = t - t[0], 2.0 * np.spacing(np.abs(t).max())
    for digit in DIGITS:
        units = since / digit
        if np.all(np.abs(units - np.rint(units)) < 1e-4 + rounding / digit) and rounding < digit:
            return float(digit)
    return 0.0


def _usual_step(step: Array) -> float:
    """A typical step, s: the median of means over a few, so that bursts and digits even out."""
    few = max(1, min(16, len(step) // 4))
    means = np.convolve(step, np.full(few, 1.0 / few), mode="valid")
    return float(np.median(means))


def _period(t: Array, usual: float, resolution: float) -> tuple[float, bool]:
    """Period of a stretch without large holes, and whether nothing is missing in it."""
    if len(t) < 3:
        return usual, True
    even, even_error = _line(t, np.arange(len(t)))
    if len(t) < ENOUGH:
        return even, True
    median = _single_step(np.diff(t))
    if median < COARSE * resolution or even_error <= resolution:
        return even, True
    index = _tracked(t, median)
    gappy, gappy_error = _line(t, index)
    lost = 1.0 - len(t) / (index[-1] + 1)
    if not 0.0 < lost < MOST or gappy_error > BETTER * even_error:
        return even, True
    index = _tracked(t, gappy)
    return _line(t, index)[0], False


def _single_step(step: Array) -> float:
    """The step of neighbours, s: the mean of those near the median, until it rests."""
    single = float(np.median(step))
    for _ in range(5):
        near = step[np.abs(step - single) < 0.5 * single]
        single = float(near.mean())
    return single


def _line(t: Array, index: Array) -> tuple[float, float]:
    """Slope of t over index by least squares, s, and the RMS residual, s."""
    k = index - index.mean()
    slope = float((k * (t - t.mean())).sum() / (k * k).sum())
    residual = t - t.mean() - slope * k
    return slope, float(np.sqrt(np.mean(residual**2)))


def _tracked(t: Array, period: float) -> NDArray[np.int64]:
    """Sample numbers where single samples may be missing: each stamp against a slow mean of those
    before it.
    """
    index = np.zeros(len(t), dtype=np.int64)
    phase, gain = float(t[0]), 0.1
    for k in range(1, len(t)):
        n = max(1, round((float(t[k]) - phase) / period))
        phase += n * period
        phase += gain * (float(t[k]) - phase)
        index[k] = index[k - 1] + n
    return index


def _number(t: Array, period: float, starts: NDArray[np.int64], even: bool) -> NDArray[np.int64]:
    """Sample numbers of the whole row: across holes by their length, within stretches as read."""
    index = np.zeros(len(t), dtype=np.int64)
    ends = np.concatenate([starts[1:], [len(t)]])
    last, last_time = -1, 0.0
    for first, end in zip(starts.tolist(), ends.tolist(), strict=True):
        stretch = t[first:end]
        inner = np.arange(len(stretch)) if even else _tracked(stretch, period)
        began = float(np.mean(stretch - period * inner))  # even time of its first sample
        jump = 1 if last < 0 else max(1, round((began - last_time) / period))
        index[first:end] = (last if last >= 0 else -1) + jump + inner
        last = int(index[end - 1])
        last_time = began + period * float(inner[-1])
    return index


def _jitter(t: Array, index: NDArray[np.int64], starts: NDArray[np.int64], period: float) -> float:
    """RMS of stamps about even times, each stretch by itself, s."""
    off = t - period * index
    ends = np.concatenate([starts[1:], [len(t)]])
    parts = [off[a:b] - off[a:b].mean() for a, b in zip(starts, ends, strict=True)]
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))
