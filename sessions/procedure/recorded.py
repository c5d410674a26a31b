"""Is a run being recorded, and in which session? By what the recorder says once a second, and by
its silence.
"""

import time

from messages.contract import gyrofree_pb2 as pb
from sessions.procedure.run import Run

SILENT_S = 4.0  # s, of a recorder that says something every second


class Recorded:
    """Of one run. `since`: when the present trouble began, s monotonic; None: there is none."""

    def __init__(self) -> None:
        self.since: float | None = None
        self._heard = time.monotonic()
        self._now = pb.RecorderStatus()
        self._life = 0  # of the recorder
        self._again = False  # another life of it, not told yet

    def take(self, status: pb.RecorderStatus) -> None:
        """What the recorder said."""
        life = status.header.run
        self._again = self._again or (self._life not in (0, life))
        self._life, self._now, self._heard = life, status, time.monotonic()

    @property
    def session(self) -> str:
        """That is recorded now; or empty."""
        return self._now.session if self._now.recording else ""

    @property
    def ended(self) -> bool:
        """The recorder is well, and does not record the run: others have ended its recording, or
        begun another.
        """
        silent = time.monotonic() - self._heard > SILENT_S
        return not (silent or self._now.recording and self._now.message)

    def goes_on_in(self, run: Run) -> str:
        """The session that goes on with the one of the run, as that was full or cut off; or
        empty.
        """
        now = self._now
        on = run.recorded and now.recording and now.continues == run.session != ""
        return now.session if on else ""

    def trouble(self, run: Run, now: float) -> str:
        """Why what is measured now would not be in the run's recording; empty: it will be. That a
        recorder began a new life is told once.
        """
        again, self._again = self._again, False
        why = self._why(run, now) if run.recorded else ""
        self.since = (now if self.since is None else self.since) if why else None
        if not why and again and run.recorded:
            return "the recorder was cut off and started again"
        return why

    def _why(self, run: Run, now: float) -> str:
        said = self._now
        if now - self._heard > SILENT_S:
            return f"nothing is recorded: the recorder has said nothing for {SILENT_S:.0f} s"
        if not self._life:
            return ""
        if said.message:
            return f"nothing is recorded: {said.message}"
        if not said.recording:
            return "nothing is recorded: the recording was ended"
        if said.session != run.session:
            return f"recorded elsewhere: session {said.session} was begun"
        return ""
