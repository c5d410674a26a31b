"""Files that a browser sends in pieces, until they are made a session of."""

import itertools
import re
import shutil
import tempfile
import threading
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from logs.sheet import open_sheet

HEAD = 8192  # bytes of a file that its header and some rows are in
LATITUDE = re.compile(r"(?<![a-z])lat(itude)?(?![a-z])")
SAMPLES = re.compile(r"(f|w)[xyz]_|a\d{2,3}_")
RECEIVER = re.compile(r"gnss|gps")
FILES = 4  # of one upload
AT_ONCE = 12  # uploads that have not been finished; the oldest gives way
EACH_AT_ONCE = 3  # of them of one user: nobody's take the room of another's


class UploadError(ValueError):
    """Files that no session can be made of; the text says what is wanted."""


def samples_and_tacho(files: list[Path]) -> tuple[Path, Path] | None:
    """A cube's samples and the tachometer's reports of it, by their columns; None for other files.
    Raises LogError, OSError.
    """
    if len(files) != 2:
        return None
    reports = [file for file in files if is_tachometer(open_sheet(file).header)]
    return next((a, b) for a in files for b in reports if a != b) if len(reports) == 1 else None


def is_tachometer(header: Sequence[str]) -> bool:
    """A rate of a table, and no sample of anything."""
    return "tacho_rad_s" in header and not any(SAMPLES.match(name) for name in header)


def samples_and_fixes(files: list[Path]) -> tuple[Path, Path | None]:
    """Which of the files has the samples, and which, for a drive, the fixes: by their columns, and
    where those say nothing by their names. Raises UploadError.
    """
    if len(files) == 1:
        return files[0], None  # whatever it is called
    if len(files) == 2:
        for sign in (has_latitude, named_after_a_receiver):
            fixes = [file for file in files if sign(file)]
            if len(fixes) == 1:
                return next(file for file in files if file not in fixes), fixes[0]
    names = ", ".join(file.name for file in files) or "no file"
    raise UploadError(
        f"{names}: want one CSV of samples and, for a drive, one of fixes, whose columns have"
        " latitude and longitude, or for a cube one of its tachometer, with tacho_rad_s"
    )


def has_latitude(file: Path) -> bool:
    """Does its beginning name a latitude? In any encoding: the word is ASCII."""
    with file.open("rb") as stream:
        head = stream.read(HEAD).replace(b"\0", b"").decode("latin-1").lower()
    return LATITUDE.search(head) is not None


def named_after_a_receiver(file: Path) -> bool:
    """gnss or gps in its name."""
    return RECEIVER.search(file.name.lower()) is not None


@dataclass
class Upload:
    """Files that come in pieces."""

    user: str
    folder: Path
    reading: bool = False  # a job makes a session of it: no more pieces
    taken: int = 0  # bytes
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
            idle = {key: one.user for key, one in self.open.items() if not one.reading}
            mine = [key for key, owner in idle.items() if owner == user]
            for key in {*mine[:-EACH_AT_ONCE], *list(idle)[:-AT_ONCE]}:
                self._forget(key)
            return number

    def room(self, user: str, most: int) -> int:
        """Bytes that this user may still send, of `most`; what is made a session of counts, too."""
        with self._lock:
            return most - sum(one.taken for one in self.open.values() if one.user == user)

    def _forget(self, number: int) -> None:
        gone = self.open.pop(number, None)
        if gone is not None:
            shutil.rmtree(gone.folder, ignore_errors=True)

    def forget(self, number: int) -> None:
        """It is a session now, or has failed to become one."""
        with self._lock:
            self._forget(number)

    def close(self) -> None:
        """Forget all."""
        with self._lock:
            for number in list(self.open):
                self._forget(number)
