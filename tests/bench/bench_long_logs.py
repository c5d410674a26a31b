"""Peak memory of the commands over the length of a log: does it stay flat but for the numbers that
are kept?

    python tests/bench/bench_long_logs.py [rows ..., default 100000 300000]

A simulated table whose last standstill is made as long as wanted. One JSON line a command and
length: peak resident memory, MB; what a row costs beyond the shortest log, bytes.
"""

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from support.kill_stack import line  # noqa: E402

from gyrofree.running.simulate_csv import write  # noqa: E402

SESSION = "20240101-000000-long"
COMMANDS = {
    "run": ["run", "log.csv", "--estimators", "products-ekf"],
    "import": ["import", "log.csv", "--name", "long", "--device", "cube"],
    "verify": ["sessions", "verify", SESSION],
    "export": ["export", SESSION],
    "report": ["report", SESSION],
}


def long_log(path: Path, rows: int) -> None:
    """A cube's log of so many rows at 100 Hz."""
    write(path, "published", 3, "cube", 0.05)
    *begin, header = (text for text in path.read_text().splitlines() if not text[0].isdigit())
    samples = [text for text in path.read_text().splitlines() if text[0].isdigit()]
    rest = [text.partition(",")[2] for text in samples[:150]]
    with path.open("w") as file:
        file.write("\n".join([*begin, header]) + "\n")
        for k in range(rows):
            rows_of = samples[k].partition(",")[2] if k < len(samples) else rest[k % len(rest)]
            file.write(f"{k * 0.01:.2f},{rows_of}\n")


def peak_mb(arguments: list[str], folder: Path) -> tuple[float, float]:
    """Peak resident memory, MB, and time, s, of one command in a process of its own."""
    begin = time.monotonic()
    with (folder / "said.txt").open("ab") as said:
        child = subprocess.Popen(
            [sys.executable, "-P", "-m", "gyrofree", *arguments],
            cwd=folder,
            stdout=said,
            stderr=said,
        )
        _, status, used = os.wait4(child.pid, 0)
    assert os.waitstatus_to_exitcode(status) == 0, (folder / "said.txt").read_text()[-500:]
    return used.ru_maxrss / 1024.0, time.monotonic() - begin


def main(lengths: list[int]) -> None:
    """Run and print."""
    first: dict[str, tuple[int, float]] = {}
    for rows in lengths:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            long_log(folder / "log.csv", rows)
            for command, arguments in COMMANDS.items():
                peak, seconds = peak_mb(arguments, folder)
                begin, least = first.setdefault(command, (rows, peak))
                more = {"rows": rows, "seconds": round(seconds, 1)}
                if rows > begin:
                    more["bytes_a_row"] = round((peak - least) * 1024**2 / (rows - begin))
                line(f"peak_memory_{command}", round(peak, 1), "MB", **more)


if __name__ == "__main__":
    main([int(word) for word in sys.argv[1:]] or [100_000, 300_000])
