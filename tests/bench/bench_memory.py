"""Memory of every process of the running demo over time: does it stay flat?

    python tests/bench/bench_memory.py [minutes, default 10]

The whole demo runs in real time (simulated table, 100 samples/s, two estimators, recording,
dashboard). Resident and private memory of each process are read every ten seconds; growth is the
slope of a straight line through the last two thirds, when all rings and buffers are full.
bench_soak.py does hours of recorder and gateway compressed in time.
"""

import sys
import tempfile
import time
from collections import defaultdict
from pathlib import Path

import numpy as np
import psutil

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from support.kill_stack import line  # noqa: E402
from support.stack import RunningDemo  # noqa: E402

EVERY_S = 10.0


def watch(demo: RunningDemo, seconds: float) -> dict[str, list[tuple[float, float, float]]]:
    """By service: time (s), resident and private memory (MB)."""
    found, begun = defaultdict(list), time.monotonic()
    while (now := time.monotonic() - begun) < seconds:
        for name, process in demo.children().items():
            try:
                memory = process.memory_full_info()
            except psutil.Error:
                continue  # it has just ended
            found[name].append((now, memory.rss / 1e6, memory.uss / 1e6))
        time.sleep(EVERY_S)
    return found


def main(minutes: float = 10.0) -> None:
    """Run and print."""
    with tempfile.TemporaryDirectory() as name, RunningDemo(Path(name)) as demo:
        found = watch(demo, 60.0 * minutes)
    for service, rows in sorted(found.items()):
        t, rss, private = np.array(rows).T
        late = t > t[-1] / 3.0
        slope = np.polyfit(t[late] / 3600.0, private[late], 1)[0]
        more = {
            "minutes": round(t[-1] / 60.0, 1),
            "rss_MB": [round(rss[len(rss) // 3], 1), round(rss[-1], 1)],
        }
        more["private_MB"] = [round(private[len(private) // 3], 1), round(private[-1], 1)]
        line(f"memory_growth_{service}", round(float(slope), 2), "MB/h", target=0.0, **more)


if __name__ == "__main__":
    main(*(float(word) for word in sys.argv[1:2]))
