"""Axis health: time to name a fault by kind, axis and profile; false alarms over hours of good
data; cost.

One JSON line per figure on standard output, progress on standard error. Figures to reach: every
fault named within 2 s of the moment it can be seen, by its right name, and no good axis excluded. A
fault at rest or of a reading near zero cannot be seen by any check; the profiles turn when faults
begin (12 s).
Usage: python tests/bench/bench_parity.py [seeds] [hours of good data per profile]
       python tests/bench/bench_parity.py 0 HOURS LAYOUT ...   false alarms only, on other layouts
       of 10 cm side
"""

import json
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent.parent))

from inertial.layouts.catalogue import find  # noqa: E402
from inertial.rate.health import AxisState, HealthMonitor  # noqa: E402
from inertial.simulation.faults import Faults, parse  # noqa: E402
from inertial.simulation.table import BLOCK, TableTest  # noqa: E402

PROFILES = ("published", "wobble", "fast")
CALM = ("still", "slow")  # more profiles for false alarms
KINDS = {
    "stuck": AxisState.STUCK,
    "saturated": AxisState.SATURATED,
    "swapped": AxisState.SWAPPED,
    "flipped": AxisState.FLIPPED,
    "spiking": AxisState.SPIKING,
    "biased": AxisState.BIASED,
}
START, PATIENCE = 12.0, 8.0  # s


def detect(kind: str, axis: int, profile: str, seed: int) -> dict:
    """Time to exclusion (s, None: not), whether named rightly at once, and good axes excluded."""
    table = TableTest(seed, profile=profile)
    names = table.layout.axis_names
    partner = (axis + 4) % 12  # of another triad and another body direction
    value = f"={names[partner]}" if kind == "swapped" else "=1.0" if kind == "biased" else ""
    faults = Faults([parse(f"{names[axis]}:{kind}{value}@{START}", names)])
    monitor = HealthMonitor(table.layout)
    guilty = {axis, partner} if kind == "swapped" else {axis}
    blamed, found, right, apart = set(), None, False, 0.0
    for number in range(2):
        good = table.block(number)
        block = faults.into(good)
        if number == 1:  # what the fault changes, RMS while it lasts
            apart = float(np.sqrt(np.mean((block.readings - good.readings)[200:, axis] ** 2)))
        for t, readings in zip(block.t_s, block.readings, strict=True):
            monitor.step(float(t), readings)
            out = {i for i, fault in enumerate(monitor.faults) if fault.excluded}
            blamed |= out - guilty
            if found is None and guilty <= out:
                found = float(t) - START
                right = all(monitor.faults[i].state == KINDS[kind] for i in guilty)
    return {"s": found, "right": right, "blamed": len(blamed), "changes": apart}


def detections(seeds: int) -> None:
    """The table of detections."""
    for profile in PROFILES:
        for kind in KINDS:
            print(f"{profile} {kind} ...", file=sys.stderr)
            runs = [
                detect(kind, axis, profile, seed)
                for axis in range(12)
                for seed in range(1, seeds + 1)
            ]
            times = [run["s"] for run in runs if run["s"] is not None]
            line = {
                "bench": "parity detection",
                "profile": profile,
                "fault": kind,
                "runs": len(runs),
                "named": len(times),
                "median_s": round(float(np.median(times)), 2) if times else None,
                "worst_s": round(max(times), 2) if times else None,
                "within_2s": sum(t <= 2.0 for t in times),
                "not_named_changed_m_s2": [
                    round(run["changes"], 2) for run in runs if run["s"] is None
                ],
                "right_name": sum(run["right"] for run in runs),
                "good_axes_excluded": sum(run["blamed"] for run in runs),
            }
            print(json.dumps(line), flush=True)


def false_alarms(hours: float, layout: str = "cube") -> None:
    """Good data, uncalibrated sensors, a new seed every 30 s run."""
    for profile in (*PROFILES, *CALM):
        print(f"{layout}, {profile}: {hours:g} h of good data ...", file=sys.stderr)
        named = restarts = samples = 0
        cpu = 0.0
        for seed in range(max(1, round(hours * 3600.0 / 30.0))):
            table = TableTest(1000 + seed, profile=profile, layout=find(layout, 0.05))
            monitor = HealthMonitor(table.layout)
            for number in range(3):
                block = table.block(number)
                began = time.process_time()
                monitor.feed(block.t_s, block.readings)
                cpu += time.process_time() - began
            samples += 3 * BLOCK
            named += monitor.counts.named
            restarts += monitor.counts.restarts
        line = {
            "bench": "parity false alarms",
            "layout": layout,
            "profile": profile,
            "hours": round(samples / 360_000.0, 2),
            "axes_excluded": named,
            "unexplained_restarts": restarts,
            "at_most_per_hour_95": round(3.0 / (samples / 360_000.0), 2) if not named else None,
            "cpu_us_per_sample": round(1e6 * cpu / samples, 1),
        }
        print(json.dumps(line), flush=True)


def main() -> None:
    """Both tables."""
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 1
    if seeds:
        detections(seeds)
    for layout in sys.argv[3:] or ["cube"]:
        false_alarms(float(sys.argv[2]) if len(sys.argv) > 2 else 0.5, layout)


if __name__ == "__main__":
    main()
