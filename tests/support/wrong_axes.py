"""Boards whose axes are not what they should be, and what monitor and estimator make of them."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inertial.layouts.catalogue import CUBE
from inertial.rate import sight
from inertial.rate.estimators import ESTIMATORS, leave_out
from inertial.rate.health import HealthMonitor
from inertial.simulation.disturbed import record
from inertial.simulation.imperfect import Imperfections, device, table_run

Array = NDArray[np.float64]
BATCH = 10  # samples, as a gateway sends them


class Log(NamedTuple):
    """Readings (n, N), m/s^2, at t_s (n,), and the true rate (n, 3), rad/s."""

    t_s: Array
    f_axis: Array
    omega_b: Array


class Run(NamedTuple):
    """What was said of a log, by sample (n)."""

    error: Array  # (n, 3) rad/s
    sigma: Array  # (n, 3) rad/s
    nees: Array  # (n,), of all three components
    valid: NDArray[np.bool_]  # (n, 3)
    masks: NDArray[np.int64]  # (n,), axes left out
    message: str


def published(profile: str, seed: int) -> Log:
    """The published sensors."""
    one = record(seed, profile)
    return Log(one.t_s, one.readings.copy(), one.omega_b)


def scaled(factor: float, since_s: float = 0.0) -> Callable[[str, int], Log]:
    """One axis, another one by every seed, reads `factor` times what it should."""

    def made(profile: str, seed: int) -> Log:
        log = published(profile, seed)
        log.f_axis[log.t_s >= since_s, (5 * seed + 2) % log.f_axis.shape[1]] *= factor
        return log

    return made


def all_scaled(factor: float) -> Callable[[str, int], Log]:
    """All axes alike: a wrong range, or counts of another resolution."""

    def made(profile: str, seed: int) -> Log:
        log = published(profile, seed)
        return log._replace(f_axis=factor * log.f_axis)

    return made


def rounded(step: float) -> Callable[[str, int], Log]:
    """Readings in steps that hide the noise, m/s^2: a wide range at few bits."""

    def made(profile: str, seed: int) -> Log:
        log = published(profile, seed)
        return log._replace(f_axis=np.round(log.f_axis / step) * step)

    return made


def exchanged(axes: int, since_s: float = 0.0) -> Callable[[str, int], Log]:
    """One axis of a triad (1) or all (3) with those of another one, others by every seed."""

    def made(profile: str, seed: int) -> Log:
        log = published(profile, seed)
        draw = np.random.default_rng([seed, 5])
        if axes == 1:
            a, b = draw.choice(log.f_axis.shape[1], 2, replace=False)[:, None]
        else:
            a, b = (3 * draw.choice(4, 2, replace=False))[:, None] + np.arange(3)
        rows = log.t_s >= since_s
        both = log.f_axis[rows]
        both[:, np.r_[a, b]] = both[:, np.r_[b, a]]
        log.f_axis[rows] = both
        return log

    return made


def turning(begin_s: float) -> Callable[[str, int], Log]:
    """The log begins when the table has turned for a while."""

    def made(profile: str, seed: int) -> Log:
        log = published(profile, seed)
        return Log(*(column[log.t_s >= begin_s] for column in log))

    return made


def imperfect(off: Imperfections) -> Callable[[str, int], Log]:
    """A device that was never calibrated."""

    def made(profile: str, seed: int) -> Log:
        run = table_run(device(CUBE(0.05), seed, off), profile=profile, seed=10 * seed + 9)
        return Log(run.t_s, run.readings, run.omega_b)

    return made


CASES: dict[str, Callable[[str, int], Log]] = {
    "scale 1.2": scaled(1.2),
    "scale 1.3": scaled(1.3),
    "scale 1.5": scaled(1.5),
    "scale 0.7": scaled(0.7),
    "scale 1.3 from 12 s": scaled(1.3, 12.0),
    "all scales 1.1": all_scaled(1.1),
    "all scales 0.9": all_scaled(0.9),
    "rounded to 31 mg": rounded(0.304),
    "imperfect device": imperfect(Imperfections()),
    "scale 5 %": imperfect(Imperfections(scale=0.05)),
    "misalignment 3 deg": imperfect(Imperfections(scale=0.005, misalignment=0.052, position=0.0)),
    "position 2 mm": imperfect(Imperfections(scale=0.005, misalignment=0.0, position=0.002)),
    "begins turning 7 s": turning(7.0),
    "begins turning 9 s": turning(9.0),
    "begins turning 12 s": turning(12.0),
    "swap": exchanged(1),
    "swap from 12 s": exchanged(1, 12.0),
    "triads": exchanged(3),
    "triads from 12 s": exchanged(3, 12.0),
}


def followed(log: Log, name: str = "products-ekf", batch: int = BATCH) -> Run:
    """The monitor and an estimator over a log, as live."""
    layout = CUBE(0.05)
    monitor, estimator = HealthMonitor(layout), ESTIMATORS[name](layout)
    omega, P, valid, masks, left_out = [], [], [], [], 0
    for first in range(0, len(log.t_s), batch):
        t_s, f_axis = (column[first : first + batch] for column in log[:2])
        at = 0
        for end, mask, doubted in monitor.feed(t_s, f_axis):
            estimator.doubt(doubted)
            if mask != left_out:
                left_out = mask
                leave_out(estimator, left_out)
            if end == at:
                continue
            said = estimator.feed(t_s[at:end], f_axis[at:end])
            omega.append(said.omega_b.copy())
            P.append(said.P.copy())
            valid.append(said.sight == sight.VALID)
            masks += [left_out] * (end - at)
            at = end
    covariance, error = np.concatenate(P), np.concatenate(omega) - log.omega_b
    return Run(
        error,
        np.sqrt(np.einsum("kii->ki", covariance)),
        np.einsum("ki,kij,kj->k", error, np.linalg.inv(covariance), error),
        np.concatenate(valid),
        np.array(masks),
        monitor.message,
    )
