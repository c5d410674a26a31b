"""States of a pipeline along a recording, so that a jump back does not begin at the beginning."""

import logging
import pickle

from sessions.replay.reproduce import Pipeline

log = logging.getLogger(__name__)

KEEP_S = 20.0  # of recording between two kept states
KEPT = 400  # states


class KeptStates:
    """Position s -> receive time ns of the message to go on with, and the pipeline, pickled."""

    def __init__(self) -> None:
        self._states: dict[float, tuple[int, bytes]] = {}
        self._newest_s = 0.0

    def go_on_from(self, position_s: float) -> None:
        """The pipeline is at this position; the next state is wanted KEEP_S later."""
        self._newest_s = position_s

    def due(self, position_s: float) -> bool:
        """Is it time for one?"""
        return position_s - self._newest_s >= KEEP_S

    def keep(self, position_s: float, next_ns: int, pipeline: Pipeline) -> None:
        """Keep the state here, unless it is kept already or there are too many."""
        self._newest_s = position_s
        if position_s in self._states or len(self._states) >= KEPT:
            return
        try:
            self._states[position_s] = (next_ns, pickle.dumps(pipeline))
        except Exception as error:  # seeking back then begins at the beginning
            log.warning("the estimators' state cannot be kept (%s): seeking takes longer", error)
            self._newest_s = float("inf")

    def before(self, position_s: float) -> float | None:
        """Position of the newest state not after a moment; None without one."""
        return max((at for at in self._states if at <= position_s), default=None)

    def at(self, position_s: float) -> tuple[int, Pipeline]:
        """Receive time to go on from, ns, and the pipeline as it was."""
        from_ns, state = self._states[position_s]
        return from_ns, pickle.loads(state)
