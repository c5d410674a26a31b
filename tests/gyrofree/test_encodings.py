"""gyrofree.toml as editors of several countries write it."""

import pytest

from gyrofree.config import ConfigError, load

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
