"""Navigation: accuracy on fixes the filters never saw, cost per sample, an hour of drive. One JSON
line per figure.

    python tests/bench/bench_drive.py [folder with imu.csv and gnss.csv]

Without an argument: car_drive in $GYROFREE_DATA or in ../shared/data beside the checkout.
"""

import json
import math
import os
import sys
import time
from pathlib import Path

import numpy as np

from inertial.core import navigation as core
from inertial.navigation.batch import run_filters
from inertial.navigation.error_model import ImuNoise, make_model
from inertial.navigation.filters import DEFAULT
from inertial.navigation.navigation import NAVIGATORS
from inertial.simulation.drive import simulate
from logs.drive import run_drive
from logs.drive_log import read_drive_log

ROOT = Path(__file__).resolve().parents[2]
SIX = ("kf", "kf-nhc", "huber", "huber-nhc", "fpe-p0-n10", "fpe-fuzzy")
OUTAGES = [(float(start), 30.0) for start in (120, 200, 280, 360, 440)]


def core_us(imu: np.ndarray) -> float:
    """us per sample of mechanisation, Phi and Q alone, in one call."""
    model, best = make_model(ImuNoise()), math.inf
    for _ in range(3):
        leg = core.new_leg(model.states)
        leg.x.latitude, leg.x.longitude, leg.x.height = 0.7, -1.8, 1600.0
        leg.time = imu[0, 0] - 0.01
        started = time.thread_time_ns()
        leg.run(model, imu)
        best = min(best, (time.thread_time_ns() - started) / 1000.0 / len(imu))
    return best


def batch_us(imu: np.ndarray, fixes: list) -> dict[str, float]:
    """us per sample with all updates of one fix a second, by filter; the best of three."""
    fed = fixes[::4]
    runs = [run_filters(imu, fed, [*SIX, "mhe-robust"]) for _ in range(3)]
    return {
        name: min(run[name].seconds / run[name].epochs for run in runs) * 1e6 for name in runs[0]
    }


def hour() -> dict[str, float]:
    """A simulated hour at 100 Hz: six filters offline, and one live; how far their ends are
    apart.
    """
    drive = simulate(1, "B", 3600.0)
    started = time.perf_counter()
    runs = run_filters(drive.imu, drive.fixes, SIX)
    offline = time.perf_counter() - started
    live, waiting = NAVIGATORS[DEFAULT](), list(drive.fixes)
    waiting.reverse()
    said = []
    started = time.perf_counter()
    for row in drive.imu:
        while waiting and waiting[-1].arrival <= row[0]:
            live.fix(waiting.pop())
        said += [c for c in live.imu(row[0], row[1:4], row[4:7]) if len(c.values)]
    k = len(said) - 1
    return {
        "six_filters_s": offline,
        "live_s": time.perf_counter() - started,
        "live_minus_offline": float(np.abs(said[k].values - runs[DEFAULT].innovation[k, :6]).max()),
    }


def main() -> None:
    """Print the figures."""
    data = Path(os.environ.get("GYROFREE_DATA") or ROOT.parent / "shared" / "data")
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else data / "car_drive"
    if not (folder / "imu.csv").is_file():
        sys.exit(f"{folder}: no imu.csv there; name the folder of the drive, or set GYROFREE_DATA")
    log = read_drive_log(folder)
    print(json.dumps({"bench": "drive core", "us_per_epoch": core_us(log.imu)}), flush=True)
    print(
        json.dumps({"bench": "drive batch", "us_per_epoch": batch_us(log.imu, log.fixes)}),
        flush=True,
    )
    result = run_drive(folder, every=4, outages=OUTAGES)
    for name, scores in result["filters"].items():
        ends = [end for end in scores["outage_end_m"] if end is not None]
        rms = math.sqrt(sum(end**2 for end in ends) / len(ends)) if ends else None
        print(
            json.dumps(
                {"bench": "drive accuracy", "filter": name, **scores, "outage_end_rms_m": rms}
            ),
            flush=True,
        )
    print(json.dumps({"bench": "drive hour", **hour()}), flush=True)


if __name__ == "__main__":
    main()
