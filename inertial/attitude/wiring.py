"""A guided detection of axes and signs, sample by sample: what to do next, what it showed. Pure; no
time of day.

Level, tip the nose up, level, tip the right side down, level, turn right on the table: after each
movement the board rests, the movement is judged (axes.py) and either counts or is asked for again.
Deterministic: the same samples give the same map.
"""

from collections import deque

import numpy as np
from numpy.typing import NDArray

from inertial.attitude.axes import LEAST_SHIFT, Assignment, Unclear, assign, movement
from inertial.attitude.axis_map import AXES, AxisMap
from inertial.attitude.wiring_found import (
    WINDOW_S,
    BoardColumns,
    Tipped,
    Turn,
    compared,
    lies_level,
    map_of,
    remarks,
    seen_end,
    with_third,
)

Array = NDArray[np.float64]

IDLE, WAITING, MOVING, FOUND, SAVED = range(5)  # as WiringStatus.State
LEVEL, NOSE_UP, RIGHT_DOWN, TURNED_RIGHT = range(4)  # as WiringStatus.Pose
STEPS = (LEVEL, NOSE_UP, LEVEL, RIGHT_DOWN, LEVEL, TURNED_RIGHT)
SAY = {
    LEVEL: "lay the board level, its upper side up, and let it rest",
    NOSE_UP: "tip its nose up by a quarter turn, and let it rest there",
    RIGHT_DOWN: "tip its right side down by a quarter turn, and let it rest there",
    TURNED_RIGHT: "turn it to the right by a quarter, flat on the table, and let it rest",
}
FIRST_S = 2.0  # s of rest before the first movement
UNUSED_S = 4.0  # s that an input is restless while five others rest: nothing is attached to it
REST_S = 1.0  # s of rest that end a movement
LONGEST_S = 20.0  # s, of a movement
NEAR_LEVEL = 2.5  # m/s^2, a quarter of g: how exactly "level again" is wanted
ON_TABLE = 0.35  # part of the limits below that holds where the board lies, not in a hand
FORCE_REST, RATE_REST, VOLT_REST = (
    0.4,
    0.15,
    0.02,
)  # m/s^2, rad/s, V: standard deviations of a board at rest


class GuidedWiring:
    """The state machine; feed() takes samples, the properties say where it stands."""

    def __init__(self, board: BoardColumns) -> None:
        """board: what the columns are."""
        self.board = board
        self.step = 0
        self.state = WAITING
        self.message = ""
        self.turns: list[Turn] = []
        self.unused: set[int] = set()
        self.map: AxisMap | None = None
        self.reading = np.zeros(len(board.names))
        self._window: deque[Array] = deque()
        self._buffer: list[Array] = []
        self._rested = 0.0
        self._since_quiet, self._since_restless = (
            np.zeros(len(board.names)),
            np.zeros(len(board.names)),
        )  # s
        self._moved = False
        self._level: Array | None = None  # readings of the level board
        self._taken: dict[int, Array] = {}  # pose -> rows of its movement
        self._period = 0.01
        self._offered = False  # a third turn makes sense

    # --- data

    def feed(self, period_s: float, values: Array) -> None:
        """Samples (n, columns), period_s apart, in order."""
        self._period = period_s
        for row in values:
            self._sample(row)

    def gap(self) -> None:
        """Samples are missing: the movement under way is not whole."""
        self._window.clear()
        if self._moved:
            self._back("samples were lost: once more")

    # --- where it stands

    @property
    def pose(self) -> int:
        """The pose wanted now."""
        return STEPS[min(self.step, len(STEPS) - 1)]

    @property
    def progress(self) -> float:
        """0 to 1 of the whole detection."""
        return 1.0 if self.state in (FOUND, SAVED) else self.step / len(STEPS)

    @property
    def complete(self) -> bool:
        """The map may be saved: a converter may have no third gyroscope, columns of rate are
        three.
        """
        return self.map is not None and (self.state in (FOUND, SAVED) or self.board.source == "adc")

    @property
    def instruction(self) -> str:
        """What the person does next."""
        if self.state == SAVED:
            return "saved and in use"
        if self.state == FOUND:
            return "every axis is found: save the map"
        if self.state == MOVING:
            return "let it rest there" if self.pose != LEVEL else "let it rest level"
        say = SAY[self.pose]
        if self.step == len(STEPS) - 1 and self.complete:
            say += "; a board without a third gyroscope is complete, save the map"
        return say

    def axis_of(self, column: int) -> tuple[str, bool]:
        """What a column was found to be and whether it is inverted; an empty name while that is not
        known.
        """
        if self.map is None or column not in self.map.column:
            return "", False
        k = self.map.column.index(column)
        return AXES[k], self.map.sign[k] < 0

    # --- inside

    def _sample(self, row: Array) -> None:
        n = max(4, round(WINDOW_S / self._period))
        self._window.append(row)
        if len(self._window) > 2 * n:  # the first half: rest from before a movement was noticed
            self._window.popleft()
        if self.state in (FOUND, SAVED):
            self.reading = row
            return
        window = np.array(self._window)[-n:]
        self.reading = window.mean(axis=0)
        quiet = window.std(axis=0) < self.board.rest * (ON_TABLE if self.pose == LEVEL else 1.0)
        used = [c for c in range(len(quiet)) if c not in self.unused]
        resting = len(window) == n and bool(quiet[used].all())
        self._rested = self._rested + self._period if resting else 0.0
        if self.step == 0:
            self._first(quiet)
        elif STEPS[self.step] == LEVEL:
            self._level_again()
        else:
            self._turning(row, resting)

    def _first(self, quiet: Array) -> None:
        """Rest on the table; an input that never rests while five others do is attached to
        nothing.
        """
        self._since_quiet = np.where(quiet, 0.0, self._since_quiet + self._period)
        self._since_restless = np.where(quiet, self._since_restless + self._period, 0.0)
        if self._rested >= FIRST_S and (self._level is None or self._near_level()):
            self._level = np.array(self._window)[: len(self._window) // 2].mean(
                axis=0
            )  # not what may just begin
            self._next(self.message)
            return
        restless = np.flatnonzero(self._since_quiet > UNUSED_S)
        if (
            len(restless)
            and len(quiet) - len(restless) >= 5
            and (self._since_restless > UNUSED_S).sum() >= 5
        ):
            self.unused = {int(c) for c in restless}
            names = ", ".join(self.board.names[c] for c in sorted(self.unused))
            self.message = f"{names}: never quiet, taken as unused"

    def _level_again(self) -> None:
        if self._rested >= REST_S and self._near_level():
            self._next(self.message)

    def _near_level(self) -> bool:
        return bool(
            np.abs(self.reading - self._level)[self._used].max()
            < NEAR_LEVEL * self.board.figures.force
        )

    def _turning(self, row: Array, resting: bool) -> None:
        if not self._moved:
            self._buffer = list(self._window)
            self._moved = not resting and self._rested == 0.0 and bool(self._buffer)
            if self._moved:
                self.state = MOVING
            return
        self._buffer.append(row)
        if len(self._buffer) * self._period > LONGEST_S:
            self._back("that took too long: turn it within a few seconds, then let it rest")
        elif self._rested >= REST_S:
            try:
                self._judge(np.array(self._buffer) / self.board.quantum)
            except Unclear as unclear:
                self._back(str(unclear))

    @property
    def _used(self) -> list[int]:
        return [c for c in range(len(self.board.names)) if c not in self.unused]

    def _next(self, message: str) -> None:
        self.step, self.state, self.message = self.step + 1, WAITING, message
        self._moved, self._buffer = False, []

    def _back(self, message: str) -> None:
        """Level again, then the same movement."""
        self.message, self.state = message, WAITING
        self.step, self._moved, self._buffer, self._rested = self.step - 1, False, [], 0.0

    def _judge(self, rows: Array) -> None:
        """Take a movement, rows (n, columns) in quanta; raises Unclear."""
        used, pose = self._used, self.pose
        if pose == TURNED_RIGHT:
            self._third(rows)
            return
        seen = movement(rows[:, used], self._period)
        size = np.abs(seen.shift)
        shifted = int((size > LEAST_SHIFT * size.max()).sum())
        if size.max() < 20.0 * seen.noise[int(size.argmax())]:
            raise Unclear("nothing changed: turn it by about a quarter, and leave it there")
        if shifted > 2:
            raise Unclear(f"{shifted} inputs changed, want two: turn it about one edge only")
        self._taken[pose] = np.vstack(
            [rows[: round(WINDOW_S / self._period)].mean(axis=0), *rows, seen_end(rows)]
        )
        if pose == NOSE_UP:
            self._next(f"taken: {self._moved_names(size, used)} changed")
            return
        try:
            found = assign(
                self._rows(NOSE_UP)[:, used], self._rows(RIGHT_DOWN)[:, used], self._period
            )
        except Unclear as unclear:
            self._restart(str(unclear))
            return
        self._found(found)

    def _rows(self, pose: int) -> Array:
        return self._taken[pose][1:-1]

    def _moved_names(self, size: Array, used: list[int]) -> str:
        return ", ".join(
            self.board.names[used[i]] for i in np.flatnonzero(size > LEAST_SHIFT * size.max())
        )

    def _restart(self, message: str) -> None:
        """Both turns together made no sense: from the first one on."""
        self._taken.clear()
        self.step = 1
        self._back(message + "; both turns once more")

    def _found(self, a: Assignment) -> None:
        used = self._used
        self.map = map_of(a, self.board, self._level, used)
        if not lies_level(self.map, self._level):
            self.map, self._level = None, None
            self._restart("the board was not level at first")
            return
        left = [c for c in used if c not in self.map.column]
        self._offered = any(
            np.ptp(self._rows(pose)[:, c]) > 0.0 for c in left for pose in (NOSE_UP, RIGHT_DOWN)
        )
        self._check("y", NOSE_UP)
        self._check("x", RIGHT_DOWN)
        self._next(remarks(self.turns, self.map))
        if not self._offered:
            self.state = FOUND

    def _third(self, rows: Array) -> None:
        """The turn on the table: which of the inputs left over is the gyroscope about the
        vertical.
        """
        tipped = Tipped(self._taken[NOSE_UP], self._rows(NOSE_UP), self._period)
        self.map = with_third(self.map, self.board, rows, tipped, self._level, self._used)
        self._taken[TURNED_RIGHT] = np.vstack([rows[0], *rows, seen_end(rows)])
        self._check("z", TURNED_RIGHT)
        self._next(remarks(self.turns, self.map))
        self.state = FOUND

    def _check(self, about: str, pose: int) -> None:
        """The same angle by both sensors."""
        rows = self._rows(pose) * self.board.quantum
        turn = compared(self.map, about, rows, self._period)
        self.turns = [t for t in self.turns if t.about != about] + [turn]
