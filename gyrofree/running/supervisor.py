"""Child processes under one roof: one readable log, restart of what dies, an orderly end.

A child that ends is started again after a pause that grows from 0.05 to 5 s and shrinks back after
20 s of good life; one that says that its configuration is wrong or its port is taken (exit code 2
or 3) ends the whole.
"""

import ctypes
import logging
import os
import signal
import subprocess
import threading
import time
from dataclasses import dataclass, field

from rich.console import Console
from rich.text import Text

from gyrofree.operations.log_form import FORMAT, SUPERVISED, said
from gyrofree.running.guardian import ANEW
from gyrofree.running.process import EXIT_CONFIG, EXIT_TAKEN, command
from messages.bus.pulse import Pulse
from messages.text import printed

PAUSE_FIRST = 0.05  # s; while a gateway is away its board's samples are lost
PAUSE_LONGEST = 5.0  # s
GOOD_LIFE = 20.0  # s
LONGEST_WAIT = 30.0  # s, for a child that waits for another
PATIENCE = 8.0  # s between SIGTERM and SIGKILL; Docker gives ten to all of us
TELLERS = ("router", "site", "record", "estimator", "alarms", "dashboard")  # one beats for us, too
GUARDED = "gateway"  # has a guardian, which begins it anew by itself
PR_SET_PDEATHSIG = 1  # linux/prctl.h
COLOURS = ("cyan", "green", "magenta", "blue", "yellow", "bright_cyan", "bright_green")
LEVELS = {"WARNING": "yellow", "ERROR": "bold red", "CRITICAL": "bold red", "DEBUG": "dim"}

log = logging.getLogger(__name__)


@dataclass
class Child:
    """One process and what is known of its life."""

    name: str
    arguments: list[str]
    colour: str = "white"
    process: subprocess.Popen | None = None
    started: float = 0.0  # s, monotonic
    restarts: int = 0
    pause: float = PAUSE_FIRST  # s
    due: float = 0.0  # s, monotonic: when to start again
    readers: list[threading.Thread] = field(default_factory=list)
    waits_for: tuple[str, str] | None = (
        None  # another child, and what its log must say before this one starts
    )
    once: bool = False  # its end is the end of all: done with exit code 0, else a fault
    hushed: tuple[str, str] | None = (
        None  # lines with the first text are not shown before the other
    )


def die_with_parent() -> None:
    """Ask Linux for SIGTERM when the supervisor is gone, however it went."""
    ctypes.CDLL(None, use_errno=True).prctl(PR_SET_PDEATHSIG, signal.SIGTERM)


class Supervisor:
    """Starts children in order, keeps them alive, stops them in reverse order."""

    def __init__(
        self, console: Console | None = None, name: str = "gyrofree", as_json: bool = False
    ) -> None:
        """name: of the command, before the supervisor's own lines. as_json: every line is an
        object, as the children's are then.
        """
        self.as_json = as_json
        self.name = name
        self.console = console or Console(stderr=True, highlight=False)
        self.children: list[Child] = []
        self.fatal: Child | None = None
        self.fatal_code = 0  # its exit code
        self.done = False  # a child that runs once has done its work
        self.lines = 0  # that were shown
        self.last_line = 0.0  # s, monotonic: when the last of them was
        self._printing, self._pulse = threading.Lock(), Pulse()
        self._stopping = False

    def add(
        self,
        name: str,
        *arguments: str,
        waits_for: tuple[str, str] | None = None,
        once: bool = False,
        hushed: tuple[str, str] | None = None,
    ) -> None:
        """Have `gyrofree ARGUMENTS` as a child called `name`.

        waits_for: another child and a text of its log, before which this one is not started; at
        most LONGEST_WAIT. once: it is not started again, and `done` or `fatal` says how it ended.
        hushed: lines with the first text are no news until one has the second.
        """
        child = Child(name, list(arguments), waits_for=waits_for, once=once, hushed=hushed)
        child.colour = COLOURS[len(self.children) % len(COLOURS)]
        self.children.append(child)

    def say(self, text: str, style: str = "bold") -> None:
        """A line of the supervisor's own."""
        if self.as_json:
            self._print_json(self.name, text, _level(style))
            return
        self._print(self.name, "bold white", text, style)

    def start(self) -> None:
        """Start every child."""
        for child in self.children:
            if child.waits_for is None:
                self._spawn(child)
            else:
                child.due = time.monotonic() + LONGEST_WAIT

    def step(self) -> None:
        """Look after the children once; call a few times a second."""
        self._pulse.turn()
        now = time.monotonic()
        for child in self.children:
            if child.process is None:
                if now >= child.due and not self._stopping and not (child.once and child.started):
                    self._spawn(child)
            elif child.process.poll() is not None:
                self._ended(child, child.process.returncode, now)

    def restart(self, *names: str) -> None:
        """Have these children end in order; `step` starts them again."""
        for child in self.children:
            if child.name in names and child.process and child.process.poll() is None:
                child.process.terminate()

    def begin_anew(self, *names: str) -> None:
        """The same for services that go on where they were when they are killed, and would end
        their work in order: a recorder its recording, a gateway its open ports.
        """
        for child in self.children:
            if child.name in names and child.process and child.process.poll() is None:
                child.process.send_signal(ANEW if child.name == GUARDED else signal.SIGKILL)

    def stop(self) -> bool:
        """SIGTERM in reverse order, SIGKILL after PATIENCE; True when all ended by themselves."""
        self._stopping = True
        running = [
            child
            for child in reversed(self.children)
            if child.process and child.process.poll() is None
        ]
        for child in running:
            child.process.terminate()
        end = time.monotonic() + PATIENCE
        clean = True
        for child in running:
            try:
                child.process.wait(max(0.0, end - time.monotonic()))
            except subprocess.TimeoutExpired:
                clean = False
                self.say(f"{child.name} did not end within {PATIENCE:g} s: killed", "bold red")
                child.process.kill()
                child.process.wait()
        for child in self.children:
            for reader in child.readers:
                reader.join(0.5)
        return clean

    def _command(self, child: Child) -> list[str]:
        return command(*child.arguments)

    def _tells(self, child: Child) -> bool:
        """Is this the child that beats for us? The first of those that can."""
        names = {one.name for one in self.children}
        return child.name == next((name for name in TELLERS if name in names), None)

    def _spawn(self, child: Child) -> None:
        child.started = time.monotonic()
        tells = self._tells(child)
        child.process = subprocess.Popen(
            self._command(child),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
            bufsize=1,
            env=os.environ
            | {SUPERVISED: "1", "PYTHONUNBUFFERED": "1"}
            | {FORMAT: "json" if self.as_json else "text"}
            | (self._pulse.environment() if tells else {}),
            pass_fds=(self._pulse.descriptor,) if tells else (),
            # Ctrl-C reaches the supervisor alone, which then ends them in order
            start_new_session=True,
            preexec_fn=die_with_parent,
        )
        reader = threading.Thread(target=self._read, args=(child, child.process), daemon=True)
        reader.start()
        child.readers = [thread for thread in child.readers if thread.is_alive()] + [reader]

    def _ended(self, child: Child, code: int, now: float) -> None:
        child.process = None
        how = f"by signal {signal.Signals(-code).name}" if code < 0 else f"with exit code {code}"
        if child.once and code == 0:
            self.done = True
            return
        if child.once or code in (EXIT_CONFIG, EXIT_TAKEN):
            self.fatal, self.fatal_code = child, code
            self.say(
                f"{child.name} ended {how} and cannot go on: its line above says why", "bold red"
            )
            return
        child.pause = (
            PAUSE_FIRST if now - child.started > GOOD_LIFE else min(2 * child.pause, PAUSE_LONGEST)
        )
        child.due = now + child.pause
        child.restarts += 1
        self.say(f"{child.name} ended {how}: starting it again in {child.pause:g} s", "yellow")

    def _read(self, child: Child, process: subprocess.Popen) -> None:
        for line in process.stdout:
            level, _, rest = line.rstrip().partition(" ")
            known = level in LEVELS or level == "INFO"
            for other in self.children:
                if (
                    other.waits_for is not None
                    and other.waits_for[0] == child.name
                    and other.waits_for[1] in line
                ):
                    other.waits_for, other.due = None, 0.0
            if child.hushed and child.hushed[1] in line:
                child.hushed = None
            if child.hushed and child.hushed[0] in line:
                continue
            if self.as_json:
                self._print_json(child.name, line.rstrip())
                continue
            self._print(
                child.name, child.colour, rest if known else line.rstrip(), LEVELS.get(level, "")
            )

    def _print_json(self, name: str, line: str, level: str = "") -> None:
        """A child's object as it is; what it said otherwise, such as a fault of the interpreter,
        as one.
        """
        whole = line.startswith("{") and line.endswith("}") and not level
        with self._printing:
            text = line if whole else said(name, level or "error", printed(line))
            print(text, file=self.console.file, flush=True)
            self.lines, self.last_line = self.lines + 1, time.monotonic()

    def _print(self, name: str, colour: str, text: str, style: str) -> None:
        clock = time.strftime("%H:%M:%S")
        line = Text.assemble(
            (clock, "dim"), " ", (f"{name:<10}", colour), " ", (printed(text), style)
        )
        with self._printing:
            self.console.print(line, soft_wrap=True)
            self.lines, self.last_line = self.lines + 1, time.monotonic()


def _level(style: str) -> str:
    """Of a line that is shown so."""
    return "error" if "red" in style else "warning" if style == "yellow" else "info"
