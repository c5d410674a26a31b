"""One source for every default: the models. The page and the shipped file are made from them."""

import json
import tomllib
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from gyrofree.commands.main import app
from gyrofree.config import Settings, check
from gyrofree.setup.keys import keys_of, tables
from gyrofree.setup.reference import page
from gyrofree.setup.written import as_toml, shipped

ROOT = Path(__file__).resolve().parents[2]
NAMES = st.from_regex(r"[a-z][a-z0-9_-]{0,8}", fullmatch=True)
TEXTS = st.text(st.characters(exclude_categories=["Cs"]), max_size=20)


def gyrofree(*arguments):
    return CliRunner().invoke(app, [str(a) for a in arguments])


def test_the_page_of_the_configuration_is_current():
    here = (ROOT / "docs/configuration.md").read_text()
    assert here == page(), "gyrofree config reference > docs/configuration.md"


def test_the_shipped_file_shows_the_defaults_in_force():
    """One that `gyrofree setup` has filled in is a person's own, and says another first line."""
    here = (ROOT / "gyrofree.toml").read_text()
    if here.splitlines()[0] == shipped().splitlines()[0]:
        assert here == shipped(), "gyrofree config default > gyrofree.toml"
    assert check(tomllib.loads(shipped()), "shipped") == Settings()


def test_every_key_says_what_it_does_in_one_line():
    for path, model in tables(Settings):
        for key in keys_of(model):
            place = ".".join((*path, key.name))
            assert len(key.text) > 2 and "\n" not in key.text and key.text[-1] != " ", place
            assert not key.text.endswith("."), f"{place}: no full stop, it stands in a comment"
            ends = {"_s": "s", "_m": "m", "_bytes": "bytes", "_hz": "Hz", "_v": "V"}
            for end, unit in ends.items():
                if key.name.endswith(end):
                    assert key.unit == unit, place


@pytest.mark.parametrize("everything", [False, True])
def test_what_is_written_is_read_as_the_same(everything):
    assert check(tomllib.loads(as_toml(Settings(), everything=everything)), "x") == Settings()


@settings(max_examples=40, deadline=None)
@given(
    st.dictionaries(
        NAMES, st.fixed_dictionaries({"kind": st.sampled_from(["cube", "nine"])}), max_size=3
    ),
    st.lists(NAMES, unique=True, max_size=3),
    TEXTS,
    st.floats(0.001, 2.0),
    st.sampled_from(["", "var/e"]),
    st.dictionaries(NAMES, TEXTS.filter(lambda t: "\0" not in t), max_size=2),
)
def test_any_settings_come_back(layouts, names, text, number, journal, cards):
    data = {
        "gateway": {
            "devices": [
                {"name": n, "port": text, "gnss_latency_s": number, "gnss_port": text}
                for n in names
            ]
        },
        "estimator": {"layouts": layouts, "journal": journal, "calibrations": cards},
        "dashboard": {"allowed_hosts": ["a.example", "b"], "trusted_proxies": [text]},
    }
    made = check(data, "made")
    for everything in (False, True):
        assert check(tomllib.loads(as_toml(made, text, everything)), "back") == made


def test_check_and_show(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert "all defaults" in gyrofree("config", "check").output
    (tmp_path / "gyrofree.toml").write_text(
        '[[gateway.devices]]\nname = "cube"\nport = "/dev/x"\n[estimator]\njournal = ""\n'
    )
    assert "cube on /dev/x" in gyrofree("config", "check").output
    shown = gyrofree("config", "show").output
    assert 'port = "/dev/x"' in shown and 'journal = ""' in shown and "lease_ms" not in shown
    assert "lease_ms" in gyrofree("config", "show", "--all").output
    assert json.loads(gyrofree("config", "show", "--json").output)["recorder"]["root"]
    assert json.loads(gyrofree("config", "check", "--json").output)["boards"] == {"cube": "/dev/x"}
    (tmp_path / "gyrofree.toml").write_text("[estimator]\njurnal = 1\n")
    wrong = gyrofree("config", "check")
    assert wrong.exit_code == 2 and "gyrofree.toml:2" in wrong.output
    assert gyrofree("config", "default").output == shipped()
    assert gyrofree("config", "reference").output == page()
