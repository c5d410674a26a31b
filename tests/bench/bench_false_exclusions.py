"""Axis monitor on good axes: exclusions under vibration, noise, loss, large biases and calibrations
that are worse than expected.

One JSON line per condition and profile (tests/support/good_axes.py); wanted: no run in which an
axis is left out. Widened are runs in which all axes were found less exact than expected, and that
is said.
Usage: python tests/bench/bench_false_exclusions.py [seeds] [part of a condition's name ...]
"""

import json
import sys
from pathlib import Path

sys.path[:0] = [str(Path(__file__).resolve().parents[k]) for k in (2, 1)]

from support.good_axes import BOARDS, watch  # noqa: E402

PROFILES = ("published", "wobble", "fast", "still")


def figures(name: str, profile: str, seeds: int) -> dict:
    """Over all seeds."""
    excluded, most, widened, restarts = 0, 0, 0, 0
    for seed in range(1, seeds + 1):
        monitor, out = watch(BOARDS[name](profile, seed))
        excluded += bool(out)
        most = max(most, len(out))
        widened += monitor.counts.widened > 0
        restarts += monitor.counts.restarts
    return {
        "runs_with_a_good_axis_left_out": excluded,
        "most_axes": most,
        "runs_widened": widened,
        "unexplained_restarts": restarts,
    }


def main() -> None:
    """All conditions and profiles."""
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 10
    wanted = sys.argv[2:]
    for name in BOARDS:
        if wanted and not any(word in name for word in wanted):
            continue
        for profile in PROFILES:
            line = {"bench": "false exclusions", "condition": name, "profile": profile}
            print(json.dumps(line | {"seeds": seeds} | figures(name, profile, seeds)), flush=True)


if __name__ == "__main__":
    main()
