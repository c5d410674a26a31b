"""Small inputs that once failed, kept outside of the project: how a folder of them is run.

A case is a folder with a run.sh that calls $GF; it is copied with the tools beside it, and what
each command said is kept, so that an expectation (case_expectations.py) can be held against it.
"""

import csv
import json
import math
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
TOOLS = "tools"
LONGEST_S = 300
PORTS = ("7511", "7512")  # of the tools: replaced, so that several runs share a machine


@dataclass(frozen=True)
class Command:
    """One call of gyrofree."""

    arguments: list[str]
    code: int
    out: str
    err: str

    @property
    def said(self) -> str:
        """Everything that a person saw."""
        return self.out + self.err

    def row(self, name: str) -> list[str]:
        """Cells of the table's row of this name, without the name; empty without such a row. The
        default filter's name ends in a star.
        """
        for line in self.out.splitlines():
            first, *cells = line.split() or [""]
            if first.removesuffix("*") == name:
                return cells
        return []

    def rates(self, name: str) -> tuple[list[float], float]:
        """RMS errors x y z of a cube's estimator, rad/s, and the least share that is
        called valid, %; behind them stand angle, NEES and time.
        """
        assert "deg/s" in self.out, self.out
        cells = self.row(name)
        shares, errors = cells[:-6], cells[-6:-3]
        return (
            [math.radians(float(cell)) for cell in errors if cell != "-"],
            min((float(cell.lstrip("<>")) for cell in shares if cell != "-"), default=0.0),
        )


@dataclass(frozen=True)
class Outcome:
    """What came of a case."""

    folder: Path  # where it ran
    commands: list[Command]
    output: str  # of run.sh

    def of(self, name: str) -> list[Command]:
        """Calls of one command."""
        return [one for one in self.commands if one.arguments[0] == name]

    def table(self, pattern: str) -> list[dict[str, str]]:
        """Rows of an exported CSV file; empty where there is none."""
        files = sorted(self.folder.glob(pattern))
        if not files:
            return []
        with files[0].open(newline="", encoding="utf-8") as file:
            return list(csv.DictReader(file))


def cases_dir() -> Path | None:
    """$GYROFREE_CASES, else shared/cases beside the checkout; None where neither is there."""
    named = os.environ.get("GYROFREE_CASES")
    if named:
        assert Path(named).is_dir(), f"GYROFREE_CASES={named}: no such folder"
        return Path(named)
    beside = ROOT.parent / "shared" / "cases"
    return beside if beside.is_dir() else None


def names() -> list[str]:
    """Folders with a case."""
    folder = cases_dir()
    found = folder.iterdir() if folder else ()
    return sorted(one.name for one in found if (one / "run.sh").is_file())


def run(name: str, scratch: Path) -> Outcome:
    """Run a case in a copy; the processes it leaves are ended."""
    source = cases_dir()
    place, log = scratch / name, scratch / "commands.jsonl"
    for part in (TOOLS, name):
        if (source / part).is_dir():
            shutil.copytree(source / part, scratch / part)
    for path in (scratch, *scratch.rglob("*")):
        path.chmod(0o755)
    _own_ports([*(scratch / TOOLS).glob("*"), place / "run.sh", place / "gyrofree.toml"])
    environment = os.environ | {"GF": str(_command(scratch)), "CASE_LOG": str(log)}
    environment |= {"PY": sys.executable, "PYTHONDONTWRITEBYTECODE": "1"}
    child = subprocess.Popen(
        ["bash", "run.sh"],
        cwd=place,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        start_new_session=True,
    )
    try:
        output, _ = child.communicate(timeout=LONGEST_S)
    finally:
        try:
            os.killpg(child.pid, signal.SIGKILL)
        except ProcessLookupError:
            pass
    lines = log.read_text(encoding="utf-8").splitlines() if log.exists() else []
    commands = [
        Command(one["arguments"], one["code"], one["out"], one["err"])
        for one in map(json.loads, lines)
    ]
    return Outcome(place, commands, output)


def _command(scratch: Path) -> Path:
    script = scratch / "gyrofree"
    wrapper = Path(__file__).with_name("case_command.py")
    script.write_text(f'#!/bin/sh\nexec "{sys.executable}" -P "{wrapper}" "$@"\n')
    script.chmod(0o755)
    return script


def _own_ports(files: list[Path]) -> None:
    free = {port: str(_free_port()) for port in PORTS}
    for file in files:
        if file.is_file():
            text = file.read_text(encoding="utf-8", errors="surrogateescape")
            new = re.sub("|".join(PORTS), lambda found: free[found.group()], text)
            file.write_text(new, encoding="utf-8", errors="surrogateescape")


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]
