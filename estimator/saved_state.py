"""The pipeline's whole state on disk, so that a process that crashed goes on as before it.

The gateway gives again what came since, and, because the pipeline is deterministic, what had been
published already comes out again under the same numbers and is not published twice.
"""

import hashlib
import logging
import os
import pickle
import time
from pathlib import Path

import inertial
import inertial.core
from estimator.pipeline import Pipeline
from estimator.settings import EstimatorSettings
from estimator.worker import Worker
from messages.bus.session import Publishers

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
        self._broken = False

    def save(self, worker: Worker, publishers: Publishers) -> None:
        """Replace the file; a state that cannot be saved is said once, and costs the resumption
        only.
        """
        if self._broken or worker.mender.asking:
            return
        try:
            data = pickle.dumps(
                (self._mark, worker.pipeline, worker.mender.taken(), publishers.sequences())
            )
            new = self._path.with_suffix(".new")
            new.write_bytes(data)
            os.replace(new, self._path)
        except Exception as error:  # whatever stands in an estimator's state: estimating goes on
            self._broken = True
            log.warning(
                "%s: the state cannot be saved (%s): after a crash estimates begin anew",
                self._path,
                error,
            )

    def load(self) -> tuple[Pipeline, dict, dict] | None:
        """What was saved last; None when there is nothing that can be gone on with."""
        try:
            if time.time() - self._path.stat().st_mtime > RESUME_S:
                return None
            mark, pipeline, taken, sequences = pickle.loads(self._path.read_bytes())
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
