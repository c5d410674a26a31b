"""Files that a browser sends in pieces, until they are made a session of."""

import itertools
import shutil
import tempfile
import threading
from dataclasses import dataclass, field
from pathlib import Path

AT_ONCE = 4  # uploads that have not been finished; the oldest gives way


@dataclass
class Upload:
    """Files that come in pieces."""

    user: str
    folder: Path
    lock: threading.Lock = field(default_factory=threading.Lock)


class Uploads:
    """Those under way."""

    def __init__(self) -> None:
        self._numbers = itertools.count(1)
        self._lock = threading.Lock()
        self.open: dict[int, Upload] = {}

    def begin(self, user: str) -> int:
        """A new one."""
        with self._lock:
            number = next(self._numbers)
            self.open[number] = Upload(user, Path(tempfile.mkdtemp(prefix="gyrofree-upload-")))
            while len(self.open) > AT_ONCE:
                self._forget(next(iter(self.open)))
            return number

    def _forget(self, number: int) -> None:
        shutil.rmtree(self.open.pop(number).folder, ignore_errors=True)

    def close(self) -> None:
        """Forget all."""
        with self._lock:
            for number in list(self.open):
                self._forget(number)
