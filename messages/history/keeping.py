"""Publishers of a service that there is one of, whose words are kept for who misses some: through a
router that is away, or while its own listener was stopped.
"""

import logging
import time
from pathlib import Path

import zenoh

from messages.bus.session import Publishers
from messages.history.answers import declare
from messages.history.journal_folder import JournalBusy
from messages.history.spool import Spool

MOST_BYTES = 64 << 20  # of what is kept; a service says little
SEGMENT_BYTES = 1 << 20

log = logging.getLogger(__name__)


class KeptPublishers(Publishers):
    """Publishers that answer what was missed. `run`: of their headers, greater than any before."""

    def __init__(
        self, session: zenoh.Session, prefix: str, source: str, folder: Path, number: int
    ) -> None:
        """source: of the topics. folder: where they are kept; while another process has it they are
        published all the same. number: of the claim.
        """
        self._kept = _open(folder)
        super().__init__(session, prefix, self._kept)
        self.number, self.run = number, time.time_ns()
        self._answering: zenoh.Queryable | None = None
        if self._kept is not None:
            self._kept.journal.outrun(number - 1)
            self.run = self._kept.journal.run
            self._answering = declare(session, prefix, "*", source, self._kept)

    def close(self) -> None:
        """Answer no more."""
        if self._answering is not None:
            self._answering.undeclare()
        if self._kept is not None:
            self._kept.close()


def _open(folder: Path) -> Spool | None:
    try:
        return Spool(folder, MOST_BYTES, segment_bytes=SEGMENT_BYTES)
    except JournalBusy as busy:
        log.error("%s; what is published is not kept for who misses some", busy)
        return None
