"""gyrofree.toml: what is wrong is named with file, line, section and the nearest key."""

import pytest

from gyrofree.config import ConfigError, load


def write(tmp_path, text):
    path = tmp_path / "gyrofree.toml"
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("[bus]\nprefx = 'a'\n", ["gyrofree.toml:2", "[bus]", "'prefx'", "did you mean 'prefix'"]),
        ("[buss]\n", ["'buss'", "did you mean 'bus'"]),
        ("[bus]\n\nprefix = 'A B'\n", [":3", "[bus] prefix = 'A B'", "want a-z"]),
        ("[bus]\nlease_ms = -5\n", [":2", "lease_ms = -5", "greater than or equal to 200"]),
        ("[dashboard]\nport = 'http'\n", [":2", "[dashboard] port = 'http'", "valid integer"]),
        ("[bus\n", ["not TOML"]),
        (
            "[[gateway.devices]]\nname = 'cube'\nport = '/dev/x'\n"
            "[[gateway.devices]]\nname = 'b'\nport = '/y'\nbaudd = 1\n",
            [":7", "gateway.devices", "'baudd'", "did you mean 'baud'"],
        ),
    ],
)
def test_faults_are_named(tmp_path, text, wanted):
    with pytest.raises(ConfigError) as caught:
        load(write(tmp_path, text))
    for part in wanted:
        assert part in str(caught.value)


def test_a_missing_file_says_how_to_name_another(tmp_path):
    with pytest.raises(ConfigError, match="--config FILE"):
        load(tmp_path / "absent.toml")


def test_all_faults_are_named_at_once(tmp_path):
    with pytest.raises(ConfigError) as caught:
        load(write(tmp_path, "[bus]\nx = 1\ny = 2\n"))
    assert len(str(caught.value).splitlines()) == 2


def test_an_empty_file_is_all_defaults(tmp_path):
    settings = load(write(tmp_path, ""))
    assert settings.bus.prefix == "gyrofree"
    assert settings.bus.router.startswith("tcp/127.0.0.1")


def test_the_shipped_file_is_valid(request):
    assert load(request.config.rootpath / "gyrofree.toml")
