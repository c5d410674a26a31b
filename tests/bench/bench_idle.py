"""CPU of the whole demo without a browser, as a share of one core. Prints one JSON line."""

import json
import sys
import tempfile
import time
from pathlib import Path

import psutil

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from support.stack import RunningDemo

SETTLE = 10.0  # s
SPAN = 30.0  # s, one run of the profile


def seconds(processes: dict[str, psutil.Process]) -> dict[str, float]:
    return {name: sum(process.cpu_times()[:2]) for name, process in processes.items()}


def main() -> None:
    with tempfile.TemporaryDirectory() as folder, RunningDemo(Path(folder)) as demo:
        time.sleep(SETTLE)
        processes = demo.children() | {"demo": psutil.Process(demo.process.pid)}
        before, start = seconds(processes), time.monotonic()
        time.sleep(SPAN)
        after, span = seconds(processes), time.monotonic() - start
        memory = {
            name: round(process.memory_info().rss / 2**20) for name, process in processes.items()
        }
    share = {name: round(100 * (after[name] - before[name]) / span, 1) for name in processes}
    total = round(sum(share.values()), 1)
    print(
        json.dumps(
            {
                "bench": "idle",
                "cpu_percent_of_one_core": total,
                "by_process": share,
                "rss_mib": memory,
            }
        )
    )


if __name__ == "__main__":
    main()
