"""`gyrofree simulate --csv`: the simulated table as a log that `gyrofree run` reads, its truth
beside the samples.
"""

import csv
from pathlib import Path

import numpy as np

from gateway.samples.tacho import Tachometer
from inertial.layouts.catalogue import find
from inertial.simulation.profiles import Profile, named
from inertial.simulation.table import BLOCK, TableTest
from inertial.whole_file import whole
from logs.cube_log import TACHO, TRUE_ATTITUDE, TRUE_RATE


def write(
    path: Path,
    profile: str | Profile,
    seed: int,
    layout: str = "cube",
    half_side_m: float | None = None,
    rate_hz: float = 100.0,
) -> int:
    """One run of the profile as CSV; returns the number of samples. Raises ValueError
    (GeometryError), OSError.

    Columns: t_s, the axes in counts of 3.9 mg, the rate that a tachometer of 360 pulses gives, true
    rate and q_nb.
    """
    shape = find(layout, half_side_m)
    profile = named(profile) if isinstance(profile, str) else profile
    test = TableTest(seed=seed, profile=profile, layout=shape, rate_hz=rate_hz)
    n = round(test.profile.seconds / test.period_s)
    rates = _tacho(test, n)
    with whole(path) as draft, draft.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        file.write(
            f"# simulated: profile {profile.name}, seed {seed}, layout {shape.name},"
            " 3.9 mg per count\n"
        )
        writer.writerow(
            [
                "t_s",
                *(f"{name}_counts" for name in shape.axis_names),
                TACHO,
                *TRUE_RATE,
                *TRUE_ATTITUDE,
            ]
        )
        for k in range(n):
            if k % BLOCK == 0:
                block = test.block(k // BLOCK)
            row = k % BLOCK
            numbers = (rates[k], *block.omega_b[row], *block.q_nb[row])
            counts = block.counts[row].tolist()
            writer.writerow(
                [f"{block.t_s[row]:.4f}", *counts, *(f"{value:.7f}" for value in numbers)]
            )
    return n


def _tacho(test: TableTest, n: int) -> np.ndarray:
    """Newest rate of the tachometer at every sample, rad/s."""
    tachometer, rates, newest = Tachometer(test.pulses_per_rev), np.zeros(n), 0.0
    end = n * test.period_s
    pulses = test.pulses(0.0, end)
    at = 0
    for k in range(n):
        t = k * test.period_s
        while at < len(pulses) and pulses[at].t_s <= t:
            tachometer.add([pulses[at].t_s * 1e6], True, pulses[at].direction < 0)
            at += 1
        said = tachometer.rate(t * 1e6)
        newest = newest if said is None else said.omega_radps
        rates[k] = newest
    return rates
