"""Questions in the terminal. Each has a proposal, which Enter takes and an unattended run too."""

import getpass
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from rich.console import Console
from rich.prompt import Confirm, Prompt
from rich.table import Table
from rich.text import Text

from dashboard.web.accounts.passwords import PASSWORD_MIN, fault_of
from gyrofree.commands.options import Terminal
from gyrofree.running.process import EXIT_CONFIG, fail
from gyrofree.setup.ports import Found

T = TypeVar("T", int, float)
COLOURS = {"board": "bold green", "receiver": "green", "text": "yellow", "other": "yellow"}


class YesOrNo(Confirm):
    """Without markup, which the terminal of texts from outside does not obey."""

    validate_error_message = "want y or n"


class Asker:
    """Asks at a terminal.

    quiet: takes every proposal instead. silent: says nothing either.
    """

    def __init__(self, quiet: bool, silent: bool) -> None:
        self.quiet, self.silent = quiet or silent, silent
        self.console: Console = Terminal(stderr=True, highlight=False)

    def say(self, text: str, style: str = "") -> None:
        """A line."""
        if not self.silent:
            self.console.print(Text(text, style), soft_wrap=True)

    def heard(self, found: list[Found]) -> None:
        """What speaks where, as a table with numbers to choose by."""
        if self.silent or not found:
            return
        table = Table("", "port", "baud", "what speaks", show_lines=len(found) > 1)
        for number, one in enumerate(found, 1):
            said = Text(one.said, COLOURS.get(one.kind, "dim"))
            table.add_row(str(number), Text(one.port, overflow="fold"), str(one.baud), said)
        self.console.print(table)

    def text(self, what: str, proposal: str, right: Callable[[str], str] = lambda _: "") -> str:
        """A text. right: why one is not taken, or ""."""
        while not self.quiet:
            answer = self._ask(Prompt, what, proposal).strip()
            if not (fault := right(answer)):
                return answer
            self.say(fault, "red")
        if fault := right(proposal):
            raise fail(fault, EXIT_CONFIG)
        return proposal

    def whole(self, what: str, proposal: int, least: int, most: int) -> int:
        """A whole number."""
        return self._number(int, what, proposal, least, most)

    def number(self, what: str, proposal: float, least: float, most: float) -> float:
        """A number."""
        return self._number(float, what, proposal, least, most)

    def yes(self, what: str, proposal: bool) -> bool:
        """Yes or no."""
        return proposal if self.quiet else self._ask(YesOrNo, what, proposal)

    def password(self, user: str) -> str:
        """A new password, twice."""
        while True:
            first = self._hidden(f"Password of {user}, {PASSWORD_MIN} characters at least: ")
            if fault := fault_of(first, user):
                self.say(fault, "red")
            elif self._hidden("Once more: ") == first:
                return first
            else:
                self.say("the two differ", "red")

    def _number(self, form: type[T], what: str, proposal: T, least: T, most: T) -> T:
        while not self.quiet:
            answer = self._ask(Prompt, what, str(proposal)).strip()
            try:
                number = form(answer.replace(",", "."))
            except ValueError:
                number = None
            if number is not None and least <= number <= most:
                return number
            kind = "a whole number" if form is int else "a number"
            self.say(f"{answer!r}: want {kind} from {least} to {most}", "red")
        return proposal

    def _ask(self, form: type, what: str, proposal: object):  # noqa: ANN202
        shown = proposal != ""
        try:
            return form.ask(Text(what), console=self.console, default=proposal, show_default=shown)
        except (EOFError, KeyboardInterrupt):
            raise self._ended() from None

    def _hidden(self, what: str) -> str:
        try:
            return getpass.getpass(what)
        except (EOFError, KeyboardInterrupt):
            raise self._ended() from None

    def _ended(self) -> Exception:
        self.console.print()
        return fail("ended before all was answered; nothing was written")


def password_in(file: str) -> str:
    """The first line of a file, or of standard input for `-`; ends the command where it cannot be
    read.
    """
    try:
        text = input() if file == "-" else Path(file).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError, EOFError) as error:
        raise fail(f"--password-file {file}: {error or 'is empty'}", EXIT_CONFIG) from None
    return (text.splitlines() or [""])[0]
