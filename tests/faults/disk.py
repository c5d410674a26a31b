"""A small disk that a scenario fills or makes read-only; an ordinary folder where none can be
mounted.
"""

import subprocess
from pathlib import Path

SIZE = 64 << 20  # bytes
BLOCK = 1 << 16


class Disk:
    """A tmpfs at a path, if this is root and the kernel lets us."""

    def __init__(self, path: Path, size: int = SIZE) -> None:
        path.mkdir(parents=True, exist_ok=True)
        self.path = path
        self._filler = path / "filler"
        done = subprocess.run(
            ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(path)], capture_output=True
        )
        self.small = done.returncode == 0

    def fill(self) -> None:
        """To the last byte."""
        with self._filler.open("ab", buffering=0) as filler:
            for size in (BLOCK, 1):
                try:
                    while filler.write(b"\0" * size) == size:
                        pass
                except OSError:
                    continue

    def free(self) -> None:
        """What was filled is empty again."""
        self._filler.unlink(missing_ok=True)

    def close(self) -> None:
        """Take it away, with all that is on it."""
        if self.small:
            self.free()
            subprocess.run(["umount", "-l", str(self.path)], check=False)
