"""A wall clock that a test sets forward and back under real processes (wall_clock.c)."""

import os
import struct
import subprocess
from pathlib import Path

SOURCE = Path(__file__).with_name("wall_clock.c")
YEAR_S = 365 * 86400.0


class WallClock:
    """The clock of all processes that are started with `environment`."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        library = folder / "wall_clock.so"
        subprocess.run(
            ["cc", "-shared", "-fPIC", "-O1", "-o", str(library), str(SOURCE), "-ldl"], check=True
        )
        self._file = folder / "offset"
        self._file.write_bytes(struct.pack("<q", 0))
        self.environment = os.environ | {
            "LD_PRELOAD": str(library),
            "WALL_CLOCK": str(self._file),
        }

    def set(self, offset_s: float) -> None:
        """From now on the clock differs from this machine's by so much, s."""
        with self._file.open("r+b") as stream:  # in place: the processes look into this very file
            stream.write(struct.pack("<q", round(offset_s * 1e9)))
