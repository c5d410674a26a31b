"""Whatever file a command is given: a right result, or one sentence and an exit code. Every command
is tried, by the parser's own list, with every file that it takes.
"""

import importlib
import os
import pkgutil
import random
import shutil
import signal
import subprocess
import sys
import traceback
from pathlib import Path

import pytest
from support.broken_files import SPOILS, WHOLE, broken, good
from support.command_tree import commands
from typer.testing import CliRunner

import gyrofree.commands
from gyrofree.commands.main import app

ROUNDS = int(os.environ.get("GYROFREE_FUZZ_ROUNDS", "3"))  # of each command and file
SEED = os.environ.get("GYROFREE_FUZZ_SEED", "3")
LONGEST_S = 30  # of one call, of the processor: a command that works for ever is a fault
WAITS_S = 300  # of the clock: so is one that waits for ever
OUTPUTS = {"out", "plot", "folder", "layout_out", "link", "csv", "port_link"}
FILES = {"session", "sessions", "layout", "layouts", "log", "imu", "gnss"}  # named by a text
VALUES = {  # of what is no file
    "name": "anna",
    "role": "viewer",
    "text": "a remark",
    "user": "anna",
    "token": "0123456789ab",
    "common_name": "viewer.anna",
    "place": "office",
    "address": "127.0.0.1",
    "id": "link/cube",
    "minutes": "5",
    "service": "router",
    "level": "debug",
}
GOOD = {  # of a file that is wanted beside the broken one
    "log": "cube.csv",
    "logs": "cube.csv",
    "card": "card.toml",
    "session": "session.mcap",
    "sessions": "session.mcap",
    "archive": "cube.csv",
}
ALSO = {  # further ways of a command
    "run": [[], ["--attitude"], ["--estimators", "least-squares", "--resolve", "--tacho-aid"]],
    "export": [["--format", form] for form in ("csv", "mcap", "mat", "gpx", "kml", "parquet")],
    "import": [[], ["--units-as-named"]],
    "replay": [[], ["--check"]],
    "play": [["--link"], ["--units-as-named", "--link"]],
    "sessions compare": [["--align", "start"]],
    "demo": [["--source", "drive"]],
}
KEEPS = {"sessions", "users", "export", "report", "rerun", "replay", "reprocess"}
LONG = {"demo", "layout optimise", "reproduce in-motion", "reproduce gyro-free", "reprocess"}


COMMANDS = commands()


def is_file(parameter) -> bool:
    """Does this parameter name a file or folder to be read?"""
    if parameter.name in OUTPUTS:
        return False
    return parameter.name in FILES or "Path" in str(parameter.type_descriptor.annotation)


def pairs():
    for name, command in sorted(COMMANDS.items()):
        for parameter in command.params:
            if getattr(parameter, "type_descriptor", None) and is_file(parameter):
                yield name, parameter.name


@pytest.fixture(scope="module")
def seeds(tmp_path_factory):
    return good(tmp_path_factory.mktemp("seeds") / "good")


@pytest.fixture
def no_services(monkeypatch):
    """A service that could start has read its files well: that is all that is asked here."""
    for module in pkgutil.iter_modules(gyrofree.commands.__path__):
        loaded = importlib.import_module(f"gyrofree.commands.{module.name}")
        if hasattr(loaded, "run_service"):
            monkeypatch.setattr(loaded, "run_service", lambda *_: None)
    monkeypatch.setattr("gyrofree.demo.bench.run", lambda plan: None)
    monkeypatch.setattr("gyrofree.running.up.run", lambda plan: None)


def arguments(command, spoilt, value, seeds, place):
    """A command line in which one parameter is the broken file."""
    words, last = [], []
    for parameter in command.params:
        option = next((word for word in parameter.opts if word.startswith("--")), "")
        if parameter.name == spoilt:
            (words if option else last).append(f"{option}={value}" if option else str(value))
            if parameter.name == "sessions":
                last.append(str(seeds["session.mcap"]))
        elif parameter.name in OUTPUTS and option and parameter.name in ("out", "layout_out"):
            words.append(f"{option}={place / 'out'}")
        elif parameter.name in OUTPUTS and parameter.required:
            last.append(str(place / "out"))
        elif parameter.required:
            known = seeds[GOOD[parameter.name]] if parameter.name in GOOD else None
            word = known or VALUES.get(parameter.name)
            assert word is not None, f"say what {parameter.name!r} may be: VALUES or GOOD"
            (words if option else last).append(f"{option}={word}" if option else str(word))
    return words, last


class Hung(BaseException):
    """A command did not end."""


def called(line):
    """Run a command line here; its exit code, what was said, what went wrong."""

    def hung(*_):
        raise Hung

    old = {number: signal.signal(number, hung) for number in (signal.SIGALRM, signal.SIGPROF)}
    signal.alarm(WAITS_S)
    signal.setitimer(signal.ITIMER_PROF, LONGEST_S)
    try:
        result = CliRunner().invoke(app, line)
    except Hung:
        return None, "", "did not end"
    finally:
        signal.alarm(0)
        signal.setitimer(signal.ITIMER_PROF, 0)
        for number, before in old.items():
            signal.signal(number, before)
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        return None, result.output, "".join(traceback.format_exception(result.exception)[-6:])
    return result.exit_code, result.output, ""


def judged(line, code, said, fault):
    assert not fault, f"{line}\n{said[-500:]}\n{fault}"
    assert code in (0, 1, 2, 3), (line, code)
    assert "Traceback" not in said, (line, said)
    assert code == 0 or said.strip(), f"{line}: exit code {code} without a word"
    assert "\x1b[31m" not in said and "\0" not in said, f"{line}: control characters: {said!r}"


@pytest.mark.parametrize(("name", "parameter"), list(pairs()))
def test_a_broken_file_is_answered(name, parameter, seeds, tmp_path, no_services, monkeypatch):
    monkeypatch.chdir(tmp_path)
    rng = random.Random(f"{name} {parameter} {SEED}")
    rounds = 2 if name in LONG else ROUNDS
    for k in range(rounds):
        place = tmp_path / str(k)
        value = broken(seeds, place, rng)
        words, last = arguments(COMMANDS[name], parameter, value, seeds, place)
        more = list(rng.choice(ALSO.get(name, [[]])))
        if more[-1:] == ["--link"]:
            more[-1] = f"--link={place / 'board'}"
        line = [*name.split(), *words, *more, "--", *last]
        judged(line, *called(line))


STATE = ("session.json", "recording.mcap", "curves.npz", "annotations.json", "users.json")


@pytest.mark.parametrize("name", sorted(n for n in COMMANDS if n.split()[0] in KEEPS))
def test_what_is_kept_may_be_broken_too(name, seeds, tmp_path, no_services, monkeypatch):
    """Sessions and users as a crash, a bad disk or an editor left them."""
    monkeypatch.chdir(tmp_path)
    rng = random.Random(f"{name} {int(SEED) + 2}")
    session = "20240101-000000-table"
    for k in range(2 if name in LONG else ROUNDS):
        root = tmp_path / str(k)
        shutil.copytree(seeds["session.mcap"].parent / "kept", root)
        for _ in range(rng.choice([1, 2])):
            part = rng.choice(STATE)
            path = root / part if part == "users.json" else root / "sessions" / session / part
            data = path.read_bytes() if path.is_file() else b'{"notes": [{"at_s": 1.0}]}'
            for _ in range(rng.choice([1, 3])):
                data = rng.choice(SPOILS)(data, rng) if data else data
            path.write_bytes(rng.choice([data, data, WHOLE[rng.choice(sorted(WHOLE))]]))
        config = root / "gyrofree.toml"
        config.write_text(
            f'[recorder]\nroot = "{root}/sessions"\n'
            f'[dashboard]\nusers = "{root}/users.json"\nsessions_root = "{root}/sessions"\n'
        )
        words = [*name.split(), f"--config={config}"]
        words += ["--yes"] if name == "sessions delete" else []
        words += [f"--out={root / 'out'}"] if name in ("export", "report") else []
        words += rng.choice(ALSO.get(name, [[]])) if name in ("export", "replay") else []
        words += ["--role=viewer"] if name == "users add" else []
        last = [session, session] if name == "sessions compare" else [session]
        last = (
            [] if name in ("sessions list", "sessions retain", "users list", "reprocess") else last
        )
        last = ["anna"] if name in ("users add", "users remove") else last
        last += ["a remark"] if name == "sessions note" else []
        judged([*words, "--", *last], *called([*words, "--", *last]))


def test_every_command_that_takes_a_file_is_tried():
    tried = {name for name, _ in pairs()}
    assert set(COMMANDS) - tried <= {
        "layout optimise",
        "calibrate plan",
        "calibrate simulate",
        "config default",
        "config reference",
        "completion",
    }


def test_a_sample_in_processes_of_their_own(seeds, tmp_path):
    rng = random.Random(11)
    for name, parameter in (("run", "log"), ("import", "log"), ("export", "session")):
        for k in range(2):
            place = tmp_path / f"{name}{k}"
            value = broken(seeds, place, rng)
            words, last = arguments(COMMANDS[name], parameter, value, seeds, place)
            line = [*name.split(), *words, "--", *last]
            done = subprocess.run(
                [sys.executable, "-P", "-m", "gyrofree", *line],
                cwd=tmp_path,
                capture_output=True,
                text=True,
                errors="replace",
                timeout=WAITS_S,
            )
            judged(line, done.returncode, done.stdout + done.stderr, "")
    assert Path(tmp_path).is_dir()
