"""The recording of a run: is it made, in which session, and how it ends. By what the recorder says
once a second, and by its silence.
"""

import math
import time
from collections.abc import Callable

from messages.contract import gyrofree_pb2 as pb
from sessions.procedure.run import Journal

SILENT_S = 4.0  # s, of a recorder that says something every second
UNRECORDED_S = 6.0  # s that nothing is recorded: a person is asked
WRITTEN_S = 1.0  # s that a recorder which has come back needs for how the run ended


class Recorded:
    """Of one run."""

    def __init__(self, journal: Journal, record: Callable[[bool], str]) -> None:
        """record(on): begin or end the recording; what could not be done, or empty."""
        self._journal, self._run, self._record = journal, journal.run, record
        self._heard = time.monotonic()
        self._now = pb.RecorderStatus()
        self._life = 0  # of the recorder
        self._again = False  # another life of it, not told yet
        self._since: float | None = None  # s, of the trouble
        self._unrecorded_at = -math.inf  # s, while it is being ended

    def take(self, status: pb.RecorderStatus) -> None:
        """What the recorder said."""
        life = status.header.run
        self._again = self._again or (self._life not in (0, life))
        self._life, self._now, self._heard = life, status, time.monotonic()

    def trouble(self, now: float) -> str:
        """Why what is measured now would not be in the run's recording; empty: it will be. That a
        recorder began a new life is told once.
        """
        self._follow()
        again, self._again = self._again, False
        why = self._why(now) if self._run.recorded else ""
        self._since = (now if self._since is None else self._since) if why else None
        if not why and again and self._run.recorded:
            return "the recorder was cut off and started again"
        return why

    def lasts(self, now: float) -> bool:
        """The trouble does not go away by itself."""
        return self._since is not None and now - self._since > UNRECORDED_S

    def again(self) -> str:
        """Before a step that was held: where others have ended the recording, one anew; what could
        not be done, or empty.
        """
        now, self._since = time.monotonic(), None
        trouble = self.trouble(now)
        if not trouble or self._silent(now):
            return ""
        if self._now.recording and self._now.message:
            return trouble
        if self._run.own_session:
            return self._record(True)
        if not self._now.recording:
            return "nothing is recorded: begin a recording first"
        self._goes_on_in(self._now.session, True)
        return ""

    def end(self, now: float) -> str:
        """What could not be done, or empty. A recorder that is away just now is to be waited for,
        until it has written how the run ended.
        """
        if trouble := self.trouble(now):
            self._unrecorded_at = now
            return trouble
        if now - self._unrecorded_at < WRITTEN_S:
            return "how it ended is being written"
        return self._record(False) if self._run.own_session else ""

    def _follow(self) -> None:
        """Into the session that goes on with the run's, as that was full or cut off."""
        now, run = self._now, self._run
        if run.recorded and now.recording and now.continues == run.session != "":
            self._goes_on_in(now.session, run.was_recording)

    def _goes_on_in(self, session: str, was_recording: bool) -> None:
        self._journal.add("session", id=session, was_recording=was_recording)

    def _silent(self, now: float) -> bool:
        return now - self._heard > SILENT_S

    def _why(self, now: float) -> str:
        said = self._now
        if self._silent(now):
            return f"nothing is recorded: the recorder has said nothing for {SILENT_S:.0f} s"
        if not self._life:
            return ""
        if said.message:
            return f"nothing is recorded: {said.message}"
        if not said.recording:
            return "nothing is recorded: the recording was ended"
        if said.session != self._run.session:
            return f"recorded elsewhere: session {said.session} was begun"
        return ""
