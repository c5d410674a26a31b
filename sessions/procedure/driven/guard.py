"""A process beside the one that drives a table: it stops the table when that one is gone or hangs.

It holds nothing but a pipe while all is well. Killed with all of the machine it is of no use; then
only the table's own watchdog is left.
"""

import logging
import subprocess
import sys

log = logging.getLogger(__name__)

CHILD = "sessions.procedure.driven.left_alone"
ALIVE, LET_GO = b".", b"q"
HANGS_S = 20.0  # without a word; a recording that is closed and another begun may take as long


class Guard:
    """The driver's end of the pipe. A guard that cannot be started is said, and the table is driven
    without.
    """

    def __init__(self, description: str, port: str) -> None:
        """The table's description as JSON, and its port."""
        self._arguments = [description, port]
        self._process: subprocess.Popen[bytes] | None = None

    def begin(self) -> None:
        """From now on: without a word the table is stopped."""
        if self._process is not None and self._process.poll() is None:
            return
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", CHILD, *self._arguments],
                stdin=subprocess.PIPE,
                start_new_session=True,  # what ends the driver's group must not end it
            )
        except OSError as error:
            log.error("no guard for the table, it turns on when this process is killed: %s", error)

    def alive(self) -> None:
        """The driver is alive, and in its senses."""
        self._say(ALIVE)

    def end(self) -> None:
        """The table was stopped, or let go; waits for nobody."""
        self._say(LET_GO)
        self.leave()

    def leave(self) -> None:
        """As if the driver were gone: the guard stops the table, again and again."""
        if self._process is not None and self._process.stdin is not None:
            self._process.stdin.close()
        self._process = None

    def _say(self, word: bytes) -> None:
        if self._process is None or self._process.stdin is None:
            return
        try:
            self._process.stdin.write(word)
            self._process.stdin.flush()
        except OSError:
            log.error("the guard of the table is gone: it turns on when this process is killed")
            self._process = None
