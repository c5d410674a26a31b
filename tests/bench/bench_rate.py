"""Rate error of the gyro-free estimators on simulated tables: one JSON line on standard output.

RMS over 30 s of the error by axis (deg/s), pooled over seeds, with the angle's error at the end and the CPU time of a
sample. Figures to reach: products below 4 deg/s on the published test where least squares is above 15, 300 us per
sample. Usage: python tests/bench/bench_rate.py [seeds] [profile]
"""

import json
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent.parent))

from estimator.rate.estimators import ESTIMATORS  # noqa: E402
from estimator.simulation.table import TableTest  # noqa: E402


def errors(name: str, seed: int, profile: str) -> tuple[np.ndarray, float, float]:
    """Rate errors (n, 3) in deg/s, angle error at the end in deg, CPU us per sample."""
    table = TableTest(seed, profile=profile)
    estimator, omega, truth, us = ESTIMATORS[name](table.layout), [], [], 0.0
    for number in range(3):
        block = table.block(number)
        began = time.process_time()
        for row in range(len(block.t_s)):
            state = estimator.step(block.index + row, float(block.t_s[row]), block.readings[row])
            omega.append(state.omega_b)
        us += (time.process_time() - began) * 1e6 / 3000
        truth.append(block.omega_b)
    return np.rad2deg(omega - np.concatenate(truth)), float(np.rad2deg(state.angle_z - block.angle_z[-1])), us


def main() -> None:
    """Both estimators over the same seeds."""
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 8
    profile = sys.argv[2] if len(sys.argv) > 2 else "published"
    figures: dict[str, object] = {"profile": profile, "seeds": seeds}
    for name in ESTIMATORS:
        errors(name, 0, profile)  # compiles
        runs = [errors(name, seed, profile) for seed in range(1, seeds + 1)]
        by_seed = np.array([np.sqrt(np.mean(e**2, axis=0)) for e, _, _ in runs])
        figures[name] = {
            "rms_deg_per_s": np.round(np.sqrt(np.mean(by_seed**2, axis=0)), 3).tolist(),
            "worst_seed_deg_per_s": np.round(by_seed.max(axis=0), 3).tolist(),
            "angle_rms_deg": round(float(np.sqrt(np.mean([a**2 for _, a, _ in runs]))), 2),
            "cpu_us_per_sample": round(float(np.median([us for _, _, us in runs])), 1),
        }
    print(json.dumps(figures))


if __name__ == "__main__":
    main()
