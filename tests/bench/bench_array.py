"""A real flat array of 24 axes with its calibration file, shaken by hand: how well its axes agree,
and what products-ekf says of the rate where it calls it valid.

Two JSON lines. Data: $GYROFREE_DATA, or shared/data beside the checkout (accelerometer_array).
Usage: python tests/bench/bench_array.py
"""

import json
import os
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]

from support.array_log import calibrate_at_rest, read_array  # noqa: E402

from inertial.layouts.catalogue import find  # noqa: E402
from inertial.rate import sight  # noqa: E402
from inertial.rate.beliefs import make  # noqa: E402
from inertial.rate.estimators import ESTIMATORS  # noqa: E402
from logs.cube_axes import agreement  # noqa: E402

STILL_S, BATCH = 470.0, 1000


def main() -> None:
    """Both lines."""
    folder = Path(os.environ.get("GYROFREE_DATA", ROOT.parent / "shared" / "data"))
    log, layout = read_array(folder / "accelerometer_array" / "exp_1.npz"), find("array-24")
    card, omega_b = calibrate_at_rest(log, layout, STILL_S, "2026-01-02T00:00:00Z")
    shape, f_axis = card.layout(layout), card.correct(log.f_axis)
    turning = np.abs(omega_b).max(axis=1) > 0.2
    found = agreement(shape, f_axis, turning)
    line = {"noise": found.noise, "still": found.still, "turning": found.turning}
    print(json.dumps({"bench": "array agreement, m/s2"} | line), flush=True)
    estimator = make(ESTIMATORS["products-ekf"], shape, card)
    said = [
        estimator.feed(log.t_s[k : k + BATCH], f_axis[k : k + BATCH])
        for k in range(0, len(log.t_s), BATCH)
    ]
    omega, P, seen = (
        np.concatenate([getattr(one, name) for one in said]) for name in ("omega_b", "P", "sight")
    )
    use = turning & (log.t_s > STILL_S) & ~log.clipped
    error, sigma = omega - omega_b, np.sqrt(np.einsum("kii->ki", P))
    valid = (seen == sight.VALID) & use[:, None]
    off = np.abs(error) > 5.0 * sigma
    line = {
        "turning_samples": int(use.sum()),
        "called_valid": (valid.sum(axis=0) / use.sum()).round(4).tolist(),
        "of_them_beyond_5_sigma": int((valid & off).sum()),
        "nees_of_all": np.mean((error[use] / sigma[use]) ** 2, axis=0).round(2).tolist(),
    }
    print(json.dumps({"bench": "array rates"} | line), flush=True)


if __name__ == "__main__":
    main()
