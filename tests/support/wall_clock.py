"""What a test changes under real processes while they run, by libraries that come before the
system's: the wall clock (wall_clock.c), and how long a disk takes (slow_sync.c).
"""

import os
import struct
import subprocess
from pathlib import Path

YEAR_S = 365 * 86400.0


class Preloaded:
    """A library for all processes that are started with `environment`, and the one number, in
    seconds, that a test tells it.
    """

    name: str

    def __init__(self, folder: Path, environment: dict[str, str] | None = None) -> None:
        """environment: that of the processes otherwise; None for this one's."""
        folder.mkdir(parents=True, exist_ok=True)
        source, library = Path(__file__).with_name(f"{self.name}.c"), folder / f"{self.name}.so"
        subprocess.run(
            ["cc", "-shared", "-fPIC", "-O1", "-o", str(library), str(source), "-ldl"], check=True
        )
        self._file = folder / self.name
        self._file.write_bytes(struct.pack("<q", 0))
        before = dict(os.environ) if environment is None else environment
        libraries = [text for text in (before.get("LD_PRELOAD"), str(library)) if text]
        self.environment = before | {
            "LD_PRELOAD": ":".join(libraries),
            self.name.upper(): str(self._file),
        }

    def set(self, seconds: float) -> None:
        """From now on it is so much."""
        with self._file.open("r+b") as stream:  # in place: the processes look into this very file
            stream.write(struct.pack("<q", round(seconds * 1e9)))


class WallClock(Preloaded):
    """By how much the clock differs from this machine's."""

    name = "wall_clock"


class SlowSync(Preloaded):
    """How much longer each fsync and fdatasync takes."""

    name = "slow_sync"
