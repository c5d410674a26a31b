"""Is the body still? Questions on the newest samples, with stated limits (E-20 to E-25).

    spread    do omega', products and p scatter more than their noise?     chi-square of 12 (window
    - 1) degrees quiet     do the mean omega' and products of two windows differ
              from those of the last standstill?                           chi-square of 3 + m
              degrees
    turn      does omega', summed over 4 to 128 samples, differ from the
              bias of this standstill? Sees a slow start early.            chi-square of 3 degrees
              at each length
    tilt      does p differ from that of this standstill?                  chi-square of 3 degrees
    steady    is p now what it was a second ago? Gravity turns in a body
              that turns slowly about an axis that is not quite vertical.  chi-square of 3 degrees
    rate      does the caller's rate exclude zero? In doubt: it and
              `steady` together?                                           waived after `patience_s`
              of the others
    biases    when they have moved for good, `quiet` would fail for ever: it is waived after twice
    `patience_s`

`turn` and `tilt` are asked of a body that stands; they end a standstill and say how many samples
ago it ended. A body that turns steadily below about 10 deg/s about an axis within half a degree of
the vertical reads the same as one that
stands: `rate` is for that, and nothing can help when the rate is wrong as well. `steady` takes more
than a second; a caller who knows the rate well, and finds it zero, need not wait for it.
Deterministic, no time of day. What is asked at each sample: inertial/core/rate/still.cpp.
"""

from dataclasses import dataclass, fields

from inertial.core import native

DEPTH = 128  # samples that the detector remembers


@dataclass(frozen=True)
class Config:
    """Limits of the zero-velocity detector; false alarms by chance at 100 Hz as measured by
    tests/bench/bench_rate.py.
    """

    sigma_axis: float | None = None  # m/s^2, one sample of one axis; None: what the layout says
    window: int = 25  # samples
    short_window: int = 8  # samples; notices the start of a turn sooner
    spread_limit: float = (
        1.45  # mean square scatter over the noise: 5 sigma above 1 for 12 numbers and 25 samples
    )
    quiet_limit: float = 38.0  # chi-square, 9 degrees: once in 50 000 windows by chance
    turn_limit: float = 22.0  # chi-square, 3 degrees: once in 15 000 sums by chance
    tilt_limit: float = 30.0  # chi-square, 3 degrees
    steady_span: int = 100  # samples between the two windows in which p must be the same
    steady_limit: float = 20.0  # chi-square, 3 degrees: once in 6000 windows by chance
    drift_steady: float = 0.003  # m/s^2, of p over steady_span
    rate_limit: float = 16.0  # chi-square, 3 degrees
    rate_slack: float = 0.02  # rad/s, added to the caller's sigma
    sure_rate: float = (
        0.105  # rad/s; a caller whose rate is below it by 2 sigma need not wait for `steady`,
    )
    likely_rate: float = 0.19  # rad/s; below this only for `brief_span`
    brief_span: int = 60  # samples
    begin_limit: float = 18.0  # chi-square, 6 degrees: of `rate` and `steady` together
    patience_s: float = 6.0  # s of stillness by the axes alone that outweigh the caller's rate
    drift: float = 0.02  # 1/s^2, sigma by which biases of the quiet quantities may have moved since
    drift_now: float = 0.004  # rad/s^2, the same within one standstill
    drift_tilt: float = 0.01  # m/s^2, of p within one standstill
    scale: float = 0.007  # of 1, scale errors of the axes: they are told by another attitude
    guard: int = 64  # newest samples of a standstill that are not learnt: they may already move
    hold: int = 50  # samples after the end of a standstill before there can be another


def limits(config: Config) -> native.RateStillLimits:
    """Config as the core takes it. Raises ValueError for windows longer than the
    memory.
    """
    if not 2 <= config.short_window <= config.window <= config.guard < DEPTH:
        raise ValueError(
            f"zero-velocity detector: windows {config.short_window} <= {config.window} <="
            f" {config.guard} < {DEPTH}"
        )
    if not 1 <= config.brief_span <= config.steady_span < 2 * DEPTH - config.window:
        raise ValueError(
            f"zero-velocity detector: spans {config.brief_span} <= {config.steady_span} <"
            f" {2 * DEPTH} - {config.window}"
        )
    out = native.RateStillLimits()
    for one in fields(Config):
        if one.name != "sigma_axis":  # it is in the sensor's constants
            setattr(out, one.name, getattr(config, one.name))
    return out
