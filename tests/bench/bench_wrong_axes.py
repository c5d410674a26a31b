"""Is what is called valid borne out where axes are not as expected? A line per case and profile.

Cases: one axis with a wrong scale, devices less exact than expected, two axes and two triads
exchanged, a log that begins while turning. The axis monitor tells the estimator what to leave out,
in batches of ten samples as live. Over all samples called valid: the share beyond 5 sigma and the
mean NEES per component of the worst axis (1 is right), the mean NEES of all three (3 is right), the
share of the time called valid, the RMS of the worst axis, and what the monitor said at the end.
Usage: python tests/bench/bench_wrong_axes.py [seeds] [part of a case's name ...]
"""

import json
import sys
from pathlib import Path

import numpy as np

sys.path[:0] = [str(Path(__file__).resolve().parents[k]) for k in (2, 1)]

from support.wrong_axes import CASES, followed  # noqa: E402

PROFILES = ("published", "wobble", "fast")


def figures(case: str, profile: str, seeds: int) -> dict:
    """Over all seeds."""
    beyond, nees, nees3, share, rms, said = [], [], [], [], [], []
    for seed in range(1, seeds + 1):
        run = followed(CASES[case](profile, seed))
        ratio, valid = run.error / run.sigma, run.valid
        count = np.maximum(valid.sum(axis=0), 1)
        beyond.append(((np.abs(ratio) > 5.0) & valid).sum(axis=0).max() / count.max())
        nees.append(((ratio**2 * valid).sum(axis=0) / count).max())
        nees3.append(run.nees[valid.all(axis=1)].mean() if valid.all(axis=1).any() else 0.0)
        share.append(valid.mean())
        rms.append(np.degrees(np.sqrt((run.error**2 * valid).sum(axis=0) / count)).max())
        said.append(run.message)
    return {
        "beyond_5_sigma": round(float(np.mean(beyond)), 5),
        "beyond_worst_seed": round(float(np.max(beyond)), 5),
        "nees_worst_axis": round(float(np.mean(nees)), 2),
        "nees_worst_seed": round(float(np.max(nees)), 2),
        "nees_of_3": round(float(np.mean(nees3)), 2),
        "share_called_valid": round(float(np.mean(share)), 3),
        "rate_called_valid": round(float(np.median(rms)), 2),
        "said": sorted(set(filter(None, said))),
    }


def main() -> None:
    """All cases and profiles."""
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 5
    wanted = sys.argv[2:]
    for case in CASES:
        if wanted and not any(word in case for word in wanted):
            continue
        for profile in PROFILES:
            line = {"bench": "wrong axes", "case": case, "profile": profile, "seeds": seeds}
            print(json.dumps(line | figures(case, profile, seeds)), flush=True)


if __name__ == "__main__":
    main()
