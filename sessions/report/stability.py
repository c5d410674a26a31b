"""Stability at rest (Allan deviation) and the consistency of a filter (NIS)."""

from dataclasses import dataclass

import allantools
import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from sessions.report.data import Accel
from sessions.report.nis import nis_verdict
from sessions.report.segments import Segment

Array = NDArray[np.float64]
LEAST = 200  # samples at rest
RANDOM_WALK_TAU = 1.0  # s, where IEEE Std 952 reads the random walk


@dataclass(frozen=True)
class Allan:
    """Overlapping Allan deviation of one signal, in its own unit."""

    name: str
    tau: Array  # s
    deviation: Array
    low: Array  # 68 % confidence
    high: Array
    random_walk: float  # N: of the -1/2 slope, unit times sqrt(s)
    bias_instability: (
        float | None
    )  # B: minimum / 0.664; None when the minimum is at the longest tau
    slope: float  # d log deviation / d log tau over the first decade


def longest_rest(segments: list[Segment]) -> Segment | None:
    """The longest standstill."""
    resting = [part for part in segments if part.still]
    return max(resting, key=lambda part: part.seconds) if resting else None


def allan_of(name: str, values: Array, period_s: float) -> Allan | None:
    """Allan deviation by allantools; None for fewer than LEAST samples or a signal that does not
    move.
    """
    if len(values) < LEAST or np.ptp(values) == 0.0:
        return None
    taus, deviation, _, counts = allantools.oadev(
        values, 1.0 / period_s, data_type="freq", taus="octave"
    )
    keep = counts >= 3
    taus, deviation = taus[keep], deviation[keep]
    low, high = _interval(deviation, taus, period_s, len(values))
    first = taus <= taus[0] * 10.0
    slope = float(np.polyfit(np.log(taus[first]), np.log(deviation[first]), 1)[0])
    lowest = int(np.argmin(deviation))
    at_one = float(np.exp(np.interp(np.log(RANDOM_WALK_TAU), np.log(taus), np.log(deviation))))
    return Allan(
        name=name,
        tau=taus,
        deviation=deviation,
        low=low,
        high=high,
        random_walk=at_one,
        bias_instability=float(deviation[lowest] / 0.664) if lowest < len(taus) - 1 else None,
        slope=slope,
    )


def _interval(deviation: Array, taus: Array, period_s: float, n: int) -> tuple[Array, Array]:
    """68 % of chi-square with the degrees of freedom that white noise has (n averaging times, at
    least 1).
    """
    edf = np.maximum(1.0, 1.5 * n * period_s / taus - 2.0)
    return deviation * np.sqrt(edf / chi2.ppf(0.84, edf)), deviation * np.sqrt(
        edf / chi2.ppf(0.16, edf)
    )


def allan_axes(accel: Accel, rest: Segment) -> list[Allan]:
    """Every accelerometer axis over a standstill, m/s^2."""
    at = rest.holds(accel.t)
    names = [f"a{k // 3 + 1}{k % 3 + 1}" for k in range(accel.f_axis.shape[1])]
    found = [allan_of(name, accel.f_axis[at, k], accel.period_s) for k, name in enumerate(names)]
    return [one for one in found if one is not None]


@dataclass(frozen=True)
class Consistency:
    """Normalised innovation squared over its degrees of freedom; 1 is what a consistent filter
    has.
    """

    name: str
    count: int
    mean: float
    low: float  # 95 % band of the mean, were the innovations white
    high: float
    beyond: float  # share of corrections beyond their own 95 % bound
    verdict: str  # see nis_verdict


def consistency(name: str, nis: Array, dof: Array) -> Consistency | None:
    """None without corrections."""
    at = dof > 0
    if not at.any():
        return None
    total = float(dof[at].sum())
    return Consistency(
        name=name,
        count=int(at.sum()),
        mean=float(nis[at].sum() / total),
        low=float(chi2.ppf(0.025, total) / total),
        high=float(chi2.ppf(0.975, total) / total),
        beyond=float((nis[at] > chi2.ppf(0.95, dof[at])).mean()),
        verdict=nis_verdict(nis[at], dof[at]),
    )
