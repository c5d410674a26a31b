"""Clone to turning cube: what a stranger waits for, nothing cached.

Clones the repository that this file is in, runs `make demo` there, packages and compiling included,
and stops when the page answers and the estimators estimate; then compiles the core once more,
alone. One JSON line. pip's cache is not used. Takes a minute or two.
"""

import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from support.stack import free_port  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
PATIENCE_S = 900.0


def seconds_to_cube(clone: Path) -> dict[str, float]:
    """Run `make demo` in a clone; seconds until setup was done, until the page, until estimates."""
    ports = [f"PORT={free_port()}", f"BUS_PORT={free_port()}"]
    marks = {
        "packages_and_core_s": r"starting; configuration",
        "page_s": r"open\s+http://",
        "estimating_s": r"estimating",
    }
    seen: dict[str, float] = {}
    begun = time.monotonic()
    log = clone / "demo.log"
    with log.open("wb") as out:
        demo = subprocess.Popen(
            ["make", "demo", *ports],
            cwd=clone,
            env=os.environ | {"PIP_NO_CACHE_DIR": "1"},
            stdin=subprocess.DEVNULL,
            stdout=out,
            stderr=out,
            start_new_session=True,
        )
    try:
        while len(seen) < len(marks):
            text, now = log.read_text(errors="replace"), time.monotonic() - begun
            for name, pattern in marks.items():
                if name not in seen and re.search(pattern, text):
                    seen[name] = round(now, 1)
            if demo.poll() is not None or now > PATIENCE_S:
                raise SystemExit(f"make demo did not come up:\n{text[-3000:]}")
            time.sleep(0.1)
    finally:
        os.killpg(demo.pid, signal.SIGINT)
        demo.wait(60)
    return seen


def seconds_to_compile(clone: Path) -> float:
    """The core alone, on all cores, from nothing."""
    for folder in (clone / "build").glob("core-*"):
        subprocess.run(["rm", "-rf", folder], check=True)
    (clone / ".make" / "core").unlink()
    begun = time.monotonic()
    subprocess.run(["make", ".make/core"], cwd=clone, check=True, capture_output=True)
    return round(time.monotonic() - begun, 1)


def main() -> None:
    with tempfile.TemporaryDirectory(prefix="gyrofree-setup-") as folder:
        clone, begun = Path(folder) / "gyrofree", time.monotonic()
        subprocess.run(["git", "clone", "--quiet", ROOT, clone], check=True)
        cloned = round(time.monotonic() - begun, 1)
        figures = {"clone_s": cloned, **seconds_to_cube(clone)}
        print(json.dumps({"bench": "setup", **figures, "core_s": seconds_to_compile(clone)}))


if __name__ == "__main__":
    main()
