"""Every command as a stranger meets it: help, JSON, and one line where a path or id is wrong."""

import json
import logging
import math

import pytest
from support.command_tree import commands
from typer.testing import CliRunner

from estimator.settings import EstimatorSettings
from gyrofree.commands.main import app
from gyrofree.running.rerun_settings import with_changes

SERVICES = {
    "demo",
    "up",
    "router",
    "gateway",
    "estimator",
    "record",
    "dashboard",
    "simulate",
    "play",
    "procedures",
    "site serve",
}
ORDERS = {
    "users add",
    "users remove",
    "calibrate simulate",
    "config default",
    "config reference",
    "completion",
    "users token create",
    "users token revoke",
    *(f"alarms {verb}" for verb in ("acknowledge", "shelve", "test", "unshelve")),
    *(f"procedure {verb}" for verb in ("abort", "next", "repeat", "run", "stop")),
    "procedure check",
    "procedure show",
}  # they do something, and have no result to print


COMMANDS = commands()


def gyrofree(*arguments):
    level = logging.getLogger().level
    result = CliRunner().invoke(app, list(arguments))
    logging.getLogger().setLevel(level)
    return result


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_help_says_what_every_option_is_for(name):
    result = gyrofree(*name.split(), "--help")
    assert result.exit_code == 0 and "Traceback" not in result.output
    command = COMMANDS[name]
    first = " ".join((command.help or "").split("\n\n")[0].split())
    assert len(first) > 15 and first.endswith(".")
    silent = [p.name for p in command.params if not getattr(p, "help", None)]
    assert not silent, f"{name}: no word on {silent}"


def test_every_command_with_a_result_speaks_json():
    without = {
        name for name, c in COMMANDS.items() if not any("--json" in p.opts for p in c.params)
    }
    assert without == SERVICES | ORDERS


def test_every_number_that_is_taken_has_two_ends():
    """So neither inf nor nan nor a number that takes all memory gets further than the parser."""
    for name, command in COMMANDS.items():
        for parameter in command.params:
            annotation = str(parameter.type_descriptor.annotation)
            if "float" in annotation or "int" in annotation:
                ends = parameter.min, parameter.max
                assert None not in ends and all(map(math.isfinite, ends)), (name, parameter.name)
    for value in ("nan", "inf", "-inf", "1e999"):
        result = gyrofree("calibrate", "plan", f"--seconds={value}")
        assert result.exit_code == 2 and "--seconds" in result.stderr, result.output


WRONG = (
    "sessions show 20990101-000000",
    "sessions verify 20990101-000000",
    "sessions delete 20990101-000000 --yes",
    "sessions note 20990101-000000 text",
    "sessions tag 20990101-000000 --add keep",
    "sessions compare 20990101-000000 20990101-000001",
    "sessions compare nowhere.mcap",
    "sessions show ../../etc",
    "export 20990101-000000",
    "export rubbish.mcap --out out",
    "report nowhere.mcap",
    "report rubbish.mcap",
    "rerun 20990101-000000",
    "replay 20990101-000000",
    "reprocess nowhere",
    "import nowhere.csv",
    "import rubbish.csv",
    "run nowhere.csv",
    "run rubbish.csv",
    "run nowhere --attitude",
    "demo --profile nowhere.toml",
    "demo --profile gentle",
    "demo --profile still --source arm",
    "layout show nowhere",
    "layout compare cube nowhere",
    "calibrate show nowhere.json",
    "calibrate show rubbish.json",
    "calibrate apply nowhere.json nowhere.csv",
    "sessions list --config nowhere.toml",
    "sessions list --config a_file_as_root.toml",
    "sessions compare 20990101-000000 20990101-000001 --config a_file_as_root.toml",
    "replay --list --config a_file_as_root.toml",
    "sessions retain --config a_file_as_root.toml",
)


@pytest.mark.parametrize("line", WRONG)
def test_what_is_wrong_is_said_in_few_words(line, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("rubbish.csv", "rubbish.mcap", "rubbish.json"):
        (tmp_path / name).write_bytes(b"\x00\xffthis is not what you want\n1,2,3\n")
    (tmp_path / "a_file_as_root.toml").write_text('[recorder]\nroot = "rubbish.csv"\n')
    result = gyrofree(*line.split())
    assert result.exit_code not in (0, None)
    assert result.exception is None or isinstance(result.exception, SystemExit), repr(
        result.exception
    )
    said = result.stderr.strip()
    assert said and "Traceback" not in said and len(said.splitlines()) <= 6
    assert "Errno" not in said  # a name and a reason, not a number
    assert result.stdout == ""


@pytest.mark.parametrize("line", ["sessions list", "replay --list", "users list"])
def test_a_list_of_nothing_says_so_and_what_to_do(line, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = gyrofree(*line.split())
    assert result.exit_code == 0
    assert result.stdout.startswith("no") and "; " in result.stdout and "┃" not in result.stdout
    assert json.loads(gyrofree(*line.split(), "--json").stdout) == []


def test_comparing_takes_an_offset_with_its_session(tmp_path):
    result = gyrofree("sessions", "compare", "a.mcap", "b.mcap", "--offset", "3")
    assert result.exit_code != 0 and "a.mcap" in result.stderr
    empty = tmp_path / "empty.toml"
    empty.write_text("")
    listed = gyrofree("sessions", "retain", "--json", "--config", str(empty))
    assert listed.exit_code == 0 and isinstance(json.loads(listed.stdout), list)


def test_settings_for_one_run_are_checked_like_the_configuration():
    changed = with_changes(
        EstimatorSettings(),
        ["layout.half_side_m=0.0493", "use_every_fix=4", 'rate=["products-ukf"]'],
    )
    assert (changed.layout.half_side_m, changed.use_every_fix, changed.rate) == (
        0.0493,
        4,
        ["products-ukf"],
    )
    for text, said in (
        ("layout.size=1", "layout.half_side_m"),
        ("half=1", "a key of"),
        ("layout.half_side_m", "KEY=VALUE"),
        ("layout.half_side_m=-1", "greater than 0"),
        ("layout.kind=sphere", "no layout 'sphere'"),
    ):
        with pytest.raises(ValueError, match=said):
            with_changes(EstimatorSettings(), [text])
