"""Run a log of a gyro-free cube through two estimators, score them and draw the result.

Shown: a log in CSV (docs/logs.md describes its columns), the estimators on it without any bus or
service, their errors against the truth in the log, and a picture. Without a log of your own one is
simulated: the cube on its rotating table for 30 s.

    python examples/run_log.py [LOG.csv]
"""

import sys
import tempfile
from pathlib import Path

import numpy as np

from gyrofree.running.simulate_csv import write
from logs.cube import run_cube

ESTIMATORS = ["products-ekf", "least-squares"]


def main(log: Path | None = None, picture: Path = Path("run_log.png")) -> dict[str, np.ndarray]:
    """RMS of the error of all that an estimator said, deg/s, axes x y z of the cube."""
    with tempfile.TemporaryDirectory() as folder:
        if log is None:
            log = Path(folder) / "log.csv"
            write(log, profile="published", seed=1, layout="cube", half_side_m=0.05)
        result = run_cube(log, estimators=ESTIMATORS, half_side_m=0.05, plot=picture)
    found = {
        name: np.degrees(result["estimators"][name]["rate_rms_all_radps"]) for name in ESTIMATORS
    }
    for name, (x, y, z) in found.items():
        print(f"{name:14} error of the rate {x:6.2f} {y:6.2f} {z:6.2f} deg/s RMS (x y z)")
    worst = max(found, key=lambda name: found[name].max())
    print(f"the worst is {worst}; {picture} shows why")
    return found


if __name__ == "__main__":
    main(*(Path(argument) for argument in sys.argv[1:2]))
