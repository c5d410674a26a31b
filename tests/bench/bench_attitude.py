"""Inclination error and cost of the attitude filters on trials with optical truth: one JSON line
per figure.

python tests/bench/bench_attitude.py [FOLDER]      FOLDER: attitude_optical, default
$GYROFREE_DATA/attitude_optical
"""

import json
import math
import os
import sys
from pathlib import Path

from logs.attitude import run_attitude

ROOT = Path(__file__).resolve().parent.parent.parent
BAR_DEG = 0.75


def main() -> None:
    """Entry point."""
    data = Path(os.environ.get("GYROFREE_DATA", ROOT.parent / "shared" / "data"))
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else data / "attitude_optical"
    if not folder.is_dir():
        print(f"{folder}: no such folder; no attitude figures", file=sys.stderr)
        return
    result = run_attitude(folder)
    for name, figures in result["filters"].items():
        line = {
            "bench": "attitude",
            "filter": name,
            "inclination_rms_deg": round(math.degrees(figures["inclination_rms_rad"]), 3),
            "us_per_sample": round(figures["us_per_sample"], 3),
        }
        for log, entry in result["logs"].items():
            line[log] = round(math.degrees(entry["filters"][name]["inclination_rms_rad"]), 3)
        if name == result["default"]:
            line["bar_deg"] = BAR_DEG
            line["met"] = line["inclination_rms_deg"] <= BAR_DEG
        print(json.dumps(line))


if __name__ == "__main__":
    main()
