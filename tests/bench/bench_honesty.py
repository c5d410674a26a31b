"""Is a number called valid only where the data bear it out? A line per condition and profile.

For every condition of inertial/simulation/disturbed.py, three profiles, ten seeds, an estimator as
it comes (products-ekf unless others are named): of the samples whose components are called valid,
the share that is off by more than 5 sigma (wanted: at most 0.001), and the mean NEES per component,
of all samples and of those that turn (wanted there: between 0.5 and 2 over all components). At rest
the right value is not 1: the error is 0, and sigma stands for a turn that is not noticed yet. One
component of ten seeds is a chi-square of about ten degrees, and so sure to 45 %. Then what share of
the time is called valid, and the rate RMS over it, deg/s.
Usage: python tests/bench/bench_honesty.py [seeds] [estimator ...] [part of a condition's name ...]
"""

import json
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from inertial.layouts.catalogue import CUBE  # noqa: E402
from inertial.rate import sight  # noqa: E402
from inertial.rate.estimators import ESTIMATORS  # noqa: E402
from inertial.simulation.disturbed import CONDITIONS, Record, record  # noqa: E402

PROFILES = ("published", "wobble", "fast")
TURNS = np.radians(2.0)  # rad/s, the true rate of what turns
BATCH = 10  # samples, as a gateway sends them


def estimate(log: Record, name: str = "products-ekf"):
    """omega_b (n, 3), P (n, 3, 3) and what is valid (n, 3), fed in batches; holes are announced."""
    estimator = ESTIMATORS[name](CUBE(0.05))
    omega, P, valid = [], [], []
    for first in range(0, len(log.t_s), BATCH):
        rows = slice(first, first + BATCH)
        cuts = np.nonzero(np.diff(log.index[rows]) != 1)[0] + 1
        for part in np.split(np.arange(*rows.indices(len(log.t_s))), cuts):
            if part[0] and log.index[part[0]] != log.index[part[0] - 1] + 1:
                estimator.skip(int(log.index[part[0]] - log.index[part[0] - 1] - 1))
            said = estimator.feed(log.t_s[part], log.readings[part])
            omega.append(said.omega_b.copy())
            P.append(said.P.copy())
            valid.append(said.sight == sight.VALID)
    return np.concatenate(omega), np.concatenate(P), np.concatenate(valid)


def figures(name: str, condition: str, profile: str, seeds: int) -> dict:
    """Over all seeds, the worst axis of each figure."""
    beyond, nees, turning, share, rms, worst = [], [], [], [], [], []
    for seed in range(1, seeds + 1):
        log = record(seed, profile, **CONDITIONS[condition])
        omega, P, valid = estimate(log, name)
        error, sigma = omega - log.omega_b, np.sqrt(np.einsum("kii->ki", P))
        said = np.maximum(valid.sum(axis=0), 1)
        beyond.append(((np.abs(error) > 5.0 * sigma) & valid).sum(axis=0) / said)
        nees.append(((error / sigma) ** 2 * valid).sum(axis=0) / said)
        turns = valid & (np.linalg.norm(log.omega_b, axis=1) > TURNS)[:, None]
        turning.append(
            ((error / sigma) ** 2 * turns).sum(axis=0) / np.maximum(turns.sum(axis=0), 1)
        )
        share.append(valid.mean(axis=0))
        rms.append(np.degrees(np.sqrt((error**2 * valid).sum(axis=0) / said)))
        worst.append(np.degrees(np.abs(error * valid).max()))
    return {
        "beyond_5_sigma": round(float(np.mean(beyond, axis=0).max()), 5),
        "beyond_5_sigma_worst_seed": round(float(np.max(beyond)), 5),
        "nees_per_component": np.round(np.mean(nees, axis=0), 2).tolist(),
        "nees_turning_per_component": np.round(np.mean(turning, axis=0), 2).tolist(),
        "nees_turning": round(float(np.mean(turning)), 2),
        "share_called_valid": round(float(np.mean(share)), 3),
        "rate_called_valid_median": round(float(np.median(np.max(rms, axis=1))), 2),
        "largest_error_called_valid": round(float(np.max(worst)), 1),
    }


def main() -> None:
    """All figures."""
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 10
    wanted = [word for word in sys.argv[2:] if word not in ESTIMATORS]
    names = [word for word in sys.argv[2:] if word in ESTIMATORS] or ["products-ekf"]
    for name in names:
        for condition in CONDITIONS:
            if wanted and not any(word in condition for word in wanted):
                continue
            for profile in PROFILES:
                said = {"bench": "honesty", "estimator": name, "condition": condition}
                said |= {"profile": profile, "seeds": seeds}
                print(json.dumps(said | figures(name, condition, profile, seeds)), flush=True)


if __name__ == "__main__":
    main()
