"""Where a command may write, by the parser's own list: what cannot be written is refused before any
work, no input is overwritten, and nothing is left half written.
"""

import os
import shutil

import pytest
from support.broken_files import good
from support.command_tree import commands
from support.walker import Call, Walker
from typer.testing import CliRunner

from gyrofree.commands.main import app
from gyrofree.commands.parser import output_kind

COMMANDS = commands()
WRITTEN = {"out", "plot", "folder", "layout_out", "link", "csv", "port_link", "table_link"}
READ = {("reprocess", "folder"), ("reproduce in-motion", "data")}  # of such a name, and read
GOOD = {
    "log": "cube.csv",
    "logs": "cube.csv",
    "card": "card.toml",
    "session": "session.mcap",
    "sessions": "session.mcap",
    "layout": "layout.toml",
    "layouts": "layout.toml",
}
VALUES = {"name": "published", "role": "viewer", "common_name": "x", "place": "x", "address": "x"}
OF_ITSELF = {"calibrate axes": {"log": "adc.csv"}, "run": {}}
MORE = {"export": ["--to=1"], "layout optimise": ["--axes=6", "--starts=1"]}
MAKES = {"reprocess", "calibrate axes", "calibrate fit"}  # the folder of their file
LONG = {"report", "reprocess", "procedure run", "procedure compare", "board", "demo", "play"}
LONG |= {"reproduce gyro-free", "reproduce in-motion", "sessions compare", "calibrate fit"}
LONG |= {
    "calibrate apply",
    "calibrate axes",
    "certs issue",
    "site join",
}  # want inputs that are long to make


def outputs():
    return [(n, p) for n, c in sorted(COMMANDS.items()) for p in c.params if output_kind(p)]


def ids(pair):
    return f"{pair[0]} {pair[1].opts[0]}"


@pytest.fixture(scope="module")
def seeds(tmp_path_factory):
    made = good(tmp_path_factory.mktemp("outputs") / "good")
    for path in (next(iter(made.values())).parent, *made.values()):
        while path.stat().st_mode & 0o555 != 0o555 and path.owner() == "root" and path.is_dir():
            path.chmod(path.stat().st_mode | 0o555)
            path = path.parent
    return made


@pytest.fixture(scope="module")
def walker():
    with Walker() as made:
        yield made


def line(name, output, value, seeds):
    """A good command line whose output is `value`."""
    words, last = [*name.split(), *MORE.get(name, [])], []
    if output.opts[0].startswith("--"):
        words.append(f"{output.opts[0]}={value}")
    else:
        last.append(str(value))
    for parameter in COMMANDS[name].params:
        if parameter is output or not parameter.required:
            continue
        known = {**GOOD, **OF_ITSELF.get(name, {})}.get(parameter.name)
        word = VALUES.get(parameter.name) if known is None else seeds[known]
        if output_kind(parameter):
            word = seeds["cube.csv"].parent / "another"
        assert word is not None, f"say what {parameter.name!r} may be: VALUES or GOOD"
        named = parameter.opts[0].startswith("--")
        (words if named else last).append(f"{parameter.opts[0]}={word}" if named else str(word))
    return [*words, "--", *last]


def refused(result, option, *said):
    error = result.stderr if hasattr(result, "stderr") else result.err
    code = result.exit_code if hasattr(result, "exit_code") else result.code
    assert code == 2 and "Traceback" not in error, error
    assert option in error and any(word in error for word in said), error


def test_every_parameter_that_is_written_is_looked_at_first():
    for name, command in COMMANDS.items():
        for parameter in command.params:
            if parameter.name in WRITTEN and (name, parameter.name) not in READ:
                assert output_kind(parameter), (name, parameter.name)


@pytest.mark.parametrize("pair", outputs(), ids=ids)
def test_what_cannot_be_written_is_refused_by_the_parser(pair, seeds, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    name, output = pair
    (tmp_path / "file").write_text("kept")
    (tmp_path / "folder").mkdir()
    ending = ".csv" if name == "run" and output.name == "out" else ".png"
    cases = [
        ("", "is empty"),
        (tmp_path / "file" / f"below{ending}", "is a file", "is no folder"),
        (tmp_path / f"{'x' * 300}{ending}", "too long"),
    ]
    if output_kind(output) != "folder":
        cases.append((tmp_path / "folder", "is a folder"))
        if name not in MAKES and output_kind(output) == "file":
            cases.append((tmp_path / "no" / f"parent{ending}", "is not there"))
    for value, *said in cases:
        result = CliRunner().invoke(app, line(name, output, value, seeds))
        refused(result, output.opts[0], *said)
    assert (tmp_path / "file").read_text() == "kept"


@pytest.mark.parametrize("pair", outputs(), ids=ids)
def test_without_the_right_to_write_it_is_refused(pair, seeds, tmp_path, walker):
    name, output = pair
    locked = tmp_path / "locked"
    locked.mkdir()
    for path in (*tmp_path.parents, tmp_path):
        if path.owner() == "root" and not path.stat().st_mode & 0o5:
            path.chmod(path.stat().st_mode | 0o55)
    locked.chmod(0o555)
    ending = ".csv" if name == "run" and output.name == "out" else ".png"
    value = locked / f"new{ending}"
    call = Call(tuple(line(name, output, value, seeds)), "/", nobody=os.getuid() == 0)
    refused(walker(call), output.opts[0], "may not be written")
    assert not list(locked.iterdir())


@pytest.mark.parametrize("name", ["run", "calibrate apply", "procedure compare"])
def test_no_input_is_overwritten(name, seeds, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    output = next(p for p in COMMANDS[name].params if p.name == "out")
    words = line(name, output, "same.csv", seeds)
    shutil.copy(words[-1], tmp_path / "same.csv")
    before = (tmp_path / "same.csv").read_bytes()
    result = CliRunner().invoke(app, [*words[:-1], f"{tmp_path}/./same.csv"])
    refused(result, "--out", "is also the input")
    assert (tmp_path / "same.csv").read_bytes() == before


def quick():
    return [(n, p) for n, p in outputs() if n not in LONG and output_kind(p) != "link"]


@pytest.mark.parametrize("pair", quick(), ids=ids)
def test_a_disk_that_is_full_in_the_middle_leaves_what_was_there(pair, seeds, tmp_path, walker):
    """The first 100 bytes of a file are taken, the others refused."""
    name, output = pair
    ending = {"plot": ".png", "csv": ".csv"}.get(output.name, ".csv" if name == "run" else ".toml")
    value = tmp_path / f"old{ending}"
    folder = output_kind(output) == "folder"
    if not folder:
        value.write_text("kept")
    answer = walker(Call(tuple(line(name, output, value, seeds)), str(tmp_path), largest=100))
    assert answer.code in (1, 2) and "Traceback" not in answer.err, answer
    assert "file too large" in answer.err and "Errno" not in answer.err, answer.err
    found = {path.name for path in tmp_path.iterdir()}
    assert found == (set() if folder else {value.name}), found
    assert folder or value.read_text() == "kept"


def test_standard_streams_may_be_closed_full_or_gone(walker, tmp_path):
    for words in (("--help",), ("run", "--help"), ("users", "list", "--json"), ("config", "show")):
        call = {kind: Call(words, str(tmp_path), stdout=kind) for kind in ("full", "gone")}
        full, gone = walker(call["full"]), walker(call["gone"])
        assert full.code == 1 and full.err.count("\n") == 1, full
        assert "standard output: no space left on device" in full.err
        assert gone.code == 1 and not gone.err, gone
        closed = walker(Call(words, str(tmp_path), stdin="closed", stdout="closed"))
        assert closed.code == 0 and not closed.err, closed
