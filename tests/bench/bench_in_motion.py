"""Errors of the in-motion filters beside the reference's: one JSON line per condition, for a few
drives.

    python tests/bench/bench_in_motion.py [SEEDS]      default 2; the reference used 10

`within_15_percent` counts velocity errors within 15 % of the reference's; `rank` is Spearman's
correlation of the order of the methods in a column: 1 is the same order.
"""

import json
import sys

from scipy.stats import spearmanr

from logs.reproduce.in_motion import methods
from logs.reproduce.in_motion_comparison import compare, mean_covariance

# 3-D velocity error, m/s: the prototype's table of the comparison, columns A B C D K E F G H J
COLUMNS = "ABCDKEFGHJ"
REFERENCE = {
    "KF": (0.125, 0.152, 0.247, 0.175, 0.329, 0.193, 0.194, 0.180, 0.771, 0.152),
    "FPE-P0 N=1": (0.214, 0.232, 0.388, 0.232, 0.232, 0.234, 0.257, 0.176, 0.243, 0.232),
    "FPE-P0 N=2": (0.191, 0.211, 0.352, 0.210, 0.210, 0.216, 0.242, 0.176, 0.236, 0.211),
    "FPE-P0 N=5": (0.176, 0.199, 0.325, 0.198, 0.198, 0.209, 0.221, 0.174, 0.215, 0.199),
    "FPE-P0 N=10": (0.155, 0.180, 0.294, 0.179, 0.179, 0.200, 0.206, 0.165, 0.191, 0.180),
    "FPE-P0 fuzzy": (0.185, 0.205, 0.339, 0.205, 0.204, 0.212, 0.232, 0.174, 0.230, 0.205),
    "FPE-Pbar N=1": (0.157, 0.190, 0.274, 0.196, 0.196, 0.194, 0.222, 1.244, 0.603, 0.213),
    "FPE-Pbar N=2": (0.154, 0.186, 0.272, 0.193, 0.194, 0.196, 0.203, 0.998, 0.582, 0.205),
    "FPE-Pbar N=5": (0.142, 0.176, 0.263, 0.183, 0.185, 0.194, 0.195, 0.600, 0.500, 0.197),
    "FPE-Pbar N=10": (0.133, 0.165, 0.254, 0.171, 0.174, 0.193, 0.194, 0.383, 0.382, 0.181),
    "FPE-Pbar fuzzy": (0.147, 0.178, 0.266, 0.184, 0.186, 0.194, 0.198, 0.769, 0.549, 0.198),
    "FPE-4Pbar N=10": (0.134, 0.161, 0.262, 0.160, 0.160, 0.193, 0.198, 0.216, 0.234, 0.165),
    "FPE-4Pbar fuzzy": (0.150, 0.173, 0.285, 0.172, 0.172, 0.194, 0.207, 0.275, 0.307, 0.179),
    "Huber-KF": (0.123, 0.154, 0.159, 0.236, 0.931, 0.191, 0.172, 0.181, 11.678, 0.155),
    "MHE-Huber N=10": (0.124, 0.152, 0.169, 0.187, 0.411, 0.193, 0.187, 0.180, 1.837, 0.153),
    "KF+NHC": (0.109, 0.138, 0.224, 0.162, 0.311, 0.172, 0.190, 0.156, 0.714, 0.138),
    "Huber-KF+NHC": (0.106, 0.139, 0.143, 0.216, 0.816, 0.170, 0.165, 0.158, 13.829, 0.139),
}


def against_reference(conditions: dict) -> list[dict]:
    """One row per condition that the reference has: order and closeness of the velocity errors."""
    rows = []
    for k, column in enumerate(COLUMNS):
        if column not in conditions:
            continue
        names = [name for name in REFERENCE if name in conditions[column]]
        ours = [conditions[column][name]["error_velocity_mps"] for name in names]
        theirs = [REFERENCE[name][k] for name in names]
        far = [
            name for name, a, b in zip(names, ours, theirs, strict=True) if abs(a / b - 1.0) > 0.15
        ]
        rows.append(
            {
                "bench": "in_motion",
                "condition": column,
                "kf_mps": round(ours[names.index("KF")], 3),
                "reference_kf_mps": theirs[names.index("KF")],
                "rank": round(float(spearmanr(ours, theirs).statistic), 3),
                "within_15_percent": f"{len(names) - len(far)} of {len(names)}",
                "further_off": far,
            }
        )
    return rows


def main() -> None:
    """Entry point."""
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 2
    conditions = compare(methods(mean_covariance()), seeds, lambda done, what: None, list(COLUMNS))
    for row in against_reference(conditions):
        print(json.dumps(row | {"seeds": seeds}), flush=True)


if __name__ == "__main__":
    main()
