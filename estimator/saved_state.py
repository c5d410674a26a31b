"""The pipeline's whole state on disk, so that a process that crashed goes on as before it.

The gateway gives again what came since, and, because the pipeline is deterministic, what had been
published already comes out again under the same numbers and is not published twice.
"""

import contextlib
import hashlib
import logging
import os
import pickle
from pathlib import Path

import inertial
import inertial.core
from estimator.pipeline import Pipeline
from estimator.settings import EstimatorSettings
from estimator.worker import Worker
from messages.bus.session import Publishers
from messages.clock import Moment
from messages.history.journal_folder import remedy_of

log = logging.getLogger(__name__)

RESUME_S = 600.0  # an older state is of another measurement
STATE = "state.pickle"


class SavedState:
    """The pipeline between two inputs, with what it had taken and published by then, as one
    file.
    """

    def __init__(self, folder: Path, settings: EstimatorSettings, version: str) -> None:
        self._path = folder / STATE
        self._mark = hashlib.sha256(
            f"{version} {settings!r}".encode()
        ).hexdigest()  # of another setup it is of no use
        self.message = ""  # why the newest state is not on the disk, for people; empty when it is

    def save(self, worker: Worker, publishers: Publishers) -> None:
        """Replace the file. A state that cannot be saved costs the resumption only: it is said once
        and tried again the next time, and that it is kept again is said as well.
        """
        if worker.mender.asking:
            return
        new = self._path.with_suffix(".new")
        try:
            content = self._mark, worker.pipeline, worker.mender.taken(), publishers.sequences()
            new.write_bytes(pickle.dumps((list(Moment.now()), content)))
            os.replace(new, self._path)
        except Exception as error:  # whatever stands in an estimator's state: estimating goes on
            with contextlib.suppress(OSError):
                new.unlink(missing_ok=True)  # half a file takes the room that others want
            self._say(error)
            return
        if self.message:
            log.warning("%s: the estimators' state is saved again", self._path)
        self.message = ""

    def _say(self, error: Exception) -> None:
        why, remedy = type(error).__name__, "see its log"
        if isinstance(error, OSError):
            why = error.strerror or why
            remedy = remedy_of(error)
        message = (
            f"the estimators' state cannot be saved ({why}): {remedy}; until then estimates begin"
            " anew after a crash"
        )
        if message != self.message:
            log.warning("%s: %s", self._path, message, exc_info=why == type(error).__name__)
        self.message = message

    def load(self) -> tuple[Pipeline, dict, dict] | None:
        """What was saved last; None when there is nothing that can be gone on with."""
        try:
            saved_at, content = pickle.loads(self._path.read_bytes())
            if Moment(*saved_at).age_s > RESUME_S:
                return None
            mark, pipeline, taken, sequences = content
        except FileNotFoundError:
            return None
        except Exception as error:  # cut by a power failure, or of another version
            log.warning("%s: cannot be read (%s): estimates begin anew", self._path, error)
            return None
        return (pipeline, taken, sequences) if mark == self._mark else None

    def forget(self) -> None:
        """After an orderly end there is nothing to go on with."""
        self._path.unlink(missing_ok=True)


def version() -> str:
    """Of everything a saved state depends on: the package's sources and the core, so that a changed
    one begins anew.
    """
    digest = hashlib.sha256(inertial.core.VERSION.encode())
    rooms = (Path(__file__).parent, Path(inertial.__file__).parent)
    for path in sorted(p for room in rooms for p in room.rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()
