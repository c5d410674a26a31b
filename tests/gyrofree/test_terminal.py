"""What the command line and the log write: texts from outside move no cursor and are no markup."""

import ast
import io
import logging
import subprocess
import sys
from pathlib import Path

import pytest
from rich.table import Table
from support.hostile import HOSTILE

from gyrofree.commands.options import Terminal, say
from gyrofree.operations.log_form import OneLine
from sessions.library.annotations import FILE, Annotations, SessionNote
from sessions.recording.manifest import Manifest, write_manifest

COMMANDS = Path(__file__).resolve().parents[2] / "gyrofree" / "commands"
ACTING = {"\x1b", "\x07", "\x9b", "\x7f", "\r", "\u202e", "\u2066", "\u200b", "\ufeff"}


@pytest.mark.parametrize("word", HOSTILE, ids=range(len(HOSTILE)))
def test_a_cell_a_line_and_a_log_message_are_text(word, capsys):
    out = io.StringIO()
    table = Table("name", title=word)
    table.add_row(word)
    console = Terminal(file=out, width=20_000)
    console.print(table)
    console.print(word)
    say(word)
    say("a", word, sep="|", file=out)
    record = logging.LogRecord("x", logging.INFO, "f", 1, "%s said %s", (word, word), None)
    line = OneLine("%(levelname)s %(message)s").format(record)
    assert "\n" not in line and line.startswith("INFO ")
    whole = out.getvalue() + capsys.readouterr().out + line
    assert not ACTING & set(whole)
    assert out.getvalue().count(word.split("\n")[0][:10]) >= 3 or ACTING & set(word)


def test_commands_print_by_the_helper():
    for path in COMMANDS.glob("*.py"):
        calls = [
            node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Call)
        ]
        direct = [c.lineno for c in calls if isinstance(c.func, ast.Name) and c.func.id == "print"]
        assert len(direct) == (path.name == "options.py"), (path.name, direct)


@pytest.mark.parametrize("order", [["list"], ["show"], ["list", "--json"], ["show", "--json"]])
def test_sessions_of_somebody_else_are_listed_as_text(tmp_path, order):
    for k, word in enumerate(HOSTILE):
        folder = tmp_path / "sessions" / f"20260101-0000{k:02d}"
        folder.mkdir(parents=True)
        write_manifest(
            folder,
            Manifest(id=folder.name, state="closed", note=word, devices=[word], recovery=word),
        )
        (folder / "recording.mcap").write_bytes(b"")
        said = Annotations.model_construct(
            title=word[:200], tags=[word], notes=[SessionNote(text=word[:2000], author=word)]
        )
        (folder / FILE).write_text(said.model_dump_json())
    (tmp_path / "gyrofree.toml").write_text(f'[recorder]\nroot = "{tmp_path / "sessions"}"\n')
    names = [""] if order[0] == "list" else [f"20260101-0000{k:02d}" for k in (0, 8, 10, 13)]
    for name in names:
        command = [
            sys.executable,
            "-P",
            "-m",
            "gyrofree",
            "sessions",
            order[0],
            *filter(None, [name]),
        ]
        ran = subprocess.run([*command, *order[1:]], cwd=tmp_path, capture_output=True, text=True)
        assert ran.returncode == 0, ran.stderr
        assert not ACTING & set(ran.stdout + ran.stderr)
