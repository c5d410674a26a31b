"""Is the default navigator right in any vehicle, not only in a car? One JSON line per ride.

Rides of inertial/simulation/vehicles.py (five seeds): RMS of position (m, in city at the end of the
outage too), heading and tilt (deg), velocity (m/s) against the truth at every fix from 60 s after
the start, of the default filter and the plain one, their ratio (wanted: at most 1.2), NEES per
component (wanted: 1 within a factor of 2), the share of fixes refused, the share of errors beyond
5 sigma (wanted: at most 0.1 %), the seeds in which the default believes a car's wheels at the end,
and when navigation began (s).
Usage: python tests/bench/bench_vehicles.py [seeds] [ride ...]; --table for Markdown.
"""

import json
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from inertial.navigation.batch import run_filters  # noqa: E402
from inertial.navigation.filters import DEFAULT  # noqa: E402
from inertial.navigation.navigation import NavigatorConfig  # noqa: E402
from inertial.navigation.solution import Wheels  # noqa: E402
from inertial.simulation.ride_score import errors_of  # noqa: E402
from inertial.simulation.vehicles import RIDES, travel  # noqa: E402

PLAIN = "kf"
RMS = ("position_m", "heading_deg", "tilt_deg", "velocity_mps")
MEANS = ("nees_position", "nees_heading", "nees_tilt", "nees_velocity", "refused", "beyond")


def figures(ride: str, seeds: int) -> dict:
    """Over all seeds, default and plain beside each other."""
    scores: dict[str, list] = {DEFAULT: [], PLAIN: []}
    began, believed = [], 0
    for seed in range(1, seeds + 1):
        drive = travel(ride, seed)
        config = NavigatorConfig(lever_arm_b=drive.lever_arm_b)
        runs = run_filters(drive.imu, drive.fixes, [DEFAULT, PLAIN], config)
        for name, run in runs.items():
            scores[name].append(errors_of(run, drive))
        began.append(runs[DEFAULT].began)
        believed += bool((runs[DEFAULT].rows["wheels"][-1:] == Wheels.BELIEVED).any())
    out: dict = {"began_s": [round(min(began), 1), round(max(began), 1)], "believed": believed}
    for key in RMS:
        pair = [float(np.sqrt(np.mean([getattr(e, key) ** 2 for e in scores[n]]))) for n in scores]
        out[key], out[f"{key}_ratio"] = [round(v, 2) for v in pair], round(pair[0] / pair[1], 2)
    for key in MEANS:
        out[key] = [round(float(np.mean([getattr(e, key) for e in scores[n]])), 4) for n in scores]
    return out


def row(ride: str, f: dict, seeds: int) -> str:
    """A line of the table of docs/navigation.md."""
    pairs = " | ".join(
        f"{f[key][0]:.2f} / {f[key][1]:.2f} ({f[key + '_ratio']:.2f})" for key in RMS[:3]
    )
    nees = ", ".join(f"{f[key][0]:.1f}" for key in MEANS[:4])
    beyond = 100.0 * f["beyond"][0]
    return f"| {ride} | {pairs} | {nees} | {beyond:.2f} | {f['believed']} of {seeds} |"


def main() -> None:
    """All figures."""
    wanted = [a for a in sys.argv[1:] if a != "--table"]
    seeds = int(wanted[0]) if wanted else 5
    for ride in wanted[1:] or RIDES:
        found = figures(ride, seeds)
        if "--table" in sys.argv:
            print(row(ride, found, seeds), flush=True)
        else:
            head = {"bench": "vehicles", "ride": ride, "seeds": seeds, "filters": [DEFAULT, PLAIN]}
            print(json.dumps(head | found), flush=True)


if __name__ == "__main__":
    main()
