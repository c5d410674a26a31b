"""gyrofree.toml as editors of several countries write it."""

import pytest

from dashboard.web.users import UsersError, load_users
from gyrofree.config import ConfigError, load
from inertial.calibration.card import CardError, read_card
from inertial.layouts.catalogue import find
from inertial.layouts.layout import GeometryError
from inertial.toml_file import parsed
from sessions.report.verdict import SpecError, load_spec

TEXT = "# für die Prüfung\n[dashboard]\nport = 8123\n"


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "cp1252"])
def test_a_configuration_is_read_in_any_encoding(tmp_path, encoding):
    path = tmp_path / "gyrofree.toml"
    path.write_bytes(TEXT.encode(encoding))
    assert load(path).dashboard.port == 8123


def test_what_is_no_toml_is_said_in_a_sentence(tmp_path):
    path = tmp_path / "gyrofree.toml"
    path.write_bytes(bytes(range(256)))
    with pytest.raises(ConfigError, match="not TOML"):
        load(path)


DEEP = {
    "array": "a = " + "[" * 5000,
    "table": "x = " + "{a = " * 5000,
    "key": "a." * 100_000 + "b = 1",
    "section": "[" + "a." * 100_000 + "b]",
    "quoted": '"a".' * 100_000 + "b = 1",
}


@pytest.mark.parametrize("text", DEEP.values(), ids=DEEP.keys())
def test_what_nests_deeper_than_people_write_is_said_in_a_sentence(tmp_path, text):
    path = tmp_path / "settings.toml"
    path.write_text(text)
    with pytest.raises(ConfigError, match="not TOML"):
        load(path)
    for read, error in ((find, GeometryError), (read_card, CardError), (load_spec, SpecError)):
        with pytest.raises(error):
            read(str(path) if read is find else path, *([0.05] if read is find else []))


def test_numbers_with_points_are_no_deep_key():
    assert (
        parsed(f"a = [{', '.join(['1.5'] * 500)}]\nb = '1.2.3.4'\nc.d.e = 1\n")["c"]["d"]["e"] == 1
    )


def test_a_deep_users_file_is_named(tmp_path):
    path = tmp_path / "users.json"
    path.write_text("[" * 100_000)
    with pytest.raises(UsersError, match="no users file"):
        load_users(path)
