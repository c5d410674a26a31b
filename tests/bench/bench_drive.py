"""Navigation on a real car drive: accuracy on the fixes the filter never saw, and the cost per sample. One JSON line.

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

from estimator.ins import ekf as ins_ekf
from estimator.ins.error_model import ImuNoise
from estimator.offline.score import read_drive, score_drive
from estimator.warm import warm

ROOT = Path(__file__).resolve().parents[2]
EVERY = 4
REPEATS = 3


def core_us(folder: Path) -> float:
    """us per sample of the compiled loop alone: mechanisation, Phi and Q, in one call over the log."""
    imu = read_drive(folder / "imu.csv", folder / "gnss.csv").imu
    t, f, w = imu[:, 0].copy(), imu[:, 1:4].copy(), imu[:, 4:7].copy()
    work, best = ins_ekf.Workspace(ImuNoise()), math.inf
    for _ in range(REPEATS):
        state = ins_ekf.InsState()
        state.x[:3] = 0.7, -1.8, 1600.0
        state.x[6:15] = np.eye(3).ravel()
        state.acc[ins_ekf.ACC_TIME] = t[0] - 0.01
        k, started = 0, time.thread_time_ns()
        while k < len(t):
            k = ins_ekf.advance_state(state, t, f, w, k, len(t), math.inf, work)
        best = min(best, (time.thread_time_ns() - started) / 1000.0 / len(t))
    return best


def main() -> None:
    """Print the scores."""
    data = Path(os.environ.get("GYROFREE_DATA") or ROOT.parent / "shared" / "data")
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else data / "car_drive"
    if not (folder / "imu.csv").is_file():
        sys.exit(f"{folder}: no imu.csv there; name the folder of the drive, or set GYROFREE_DATA")
    warm()
    runs = [score_drive(folder / "imu.csv", folder / "gnss.csv", EVERY) for _ in range(REPEATS)]
    result = min(runs, key=lambda run: run["us_per_epoch"])
    print(json.dumps({"bench": "drive", "every": EVERY, **result, "core_us_per_epoch": core_us(folder)}))


if __name__ == "__main__":
    main()
