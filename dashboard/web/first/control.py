"""What the first-run page has done: listening at the ports and writing the configuration, by the
same command that does it in a terminal.
"""

import json
import subprocess
import threading
from collections.abc import Sequence

from dashboard.web.control import ControlError

LONGEST_S = 240.0  # of listening at all ports


class FirstRun:
    """`<command> setup` without a person at it; one at a time."""

    def __init__(self, command: Sequence[str]) -> None:
        """command: up to `setup`, with the file it writes."""
        self._command = list(command)
        self._turn = threading.Lock()
        self.over = False  # a board is configured, or the page was left without one
        self.heard: list[dict] | None = None  # what spoke on which port; None: not looked yet

    def look(self) -> None:
        """Listen at every port; takes seconds each. Raises ControlError."""
        try:
            self.heard = self._run("--look")["ports"]
        except ControlError as error:
            if "no serial port is there" not in str(error):
                raise
            self.heard = []

    def write(self, answers: dict[str, str]) -> dict:
        """Write the configuration; answers by option. Raises ControlError with what is wrong."""
        options = [f"--{option}={value}" for option, value in answers.items()]
        done = self._run("--force", "--seconds=1.5", *options)
        self.over = True
        return done

    def _run(self, *arguments: str) -> dict:
        with self._turn:
            try:
                done = subprocess.run(
                    [*self._command, *arguments, "--json"],
                    stdin=subprocess.DEVNULL,
                    capture_output=True,
                    text=True,
                    errors="replace",
                    timeout=LONGEST_S,
                )
            except subprocess.TimeoutExpired:
                raise ControlError(f"not done after {LONGEST_S:g} s: given up") from None
            except OSError as error:
                raise ControlError(f"{self._command[0]}: {error.strerror}") from None
        if done.returncode:
            lines = [line.removeprefix("gyrofree: ") for line in done.stderr.splitlines()]
            raise ControlError(" ".join(lines[-8:]) or f"it ended with {done.returncode}")
        return json.loads(done.stdout)
