"""The data flow one way, and so do the imports."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
MAY_IMPORT = {
    "firmware_protocol": set(),
    "messages": set(),
    "emulator": {"firmware_protocol"},
    "gateway": {"firmware_protocol", "messages", "inertial"},
    "inertial": set(),
    "estimator": {"messages", "inertial"},
    "logs": {"messages", "inertial", "estimator"},
    "sessions": {"messages", "inertial", "estimator", "logs"},
    "dashboard": {"messages", "inertial", "estimator", "logs", "sessions"},
    "gyrofree": {
        "firmware_protocol",
        "emulator",
        "messages",
        "gateway",
        "inertial",
        "estimator",
        "logs",
        "sessions",
        "dashboard",
    },
}


def imported(path: Path) -> set[str]:
    found = set()
    for node in ast.walk(ast.parse(path.read_text(), str(path))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            found |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
    return found


def rooms(names: set[str]) -> set[str]:
    return {name.split(".")[0] for name in names} & MAY_IMPORT.keys()


@pytest.mark.parametrize("room", MAY_IMPORT)
def test_imports_follow_the_data(room):
    files = list((ROOT / room).rglob("*.py"))
    assert files, f"{room}/ holds no Python"
    for path in files:
        assert rooms(imported(path)) - {room} <= MAY_IMPORT[room], path


def test_no_service_shell_imports_another():
    for room in MAY_IMPORT.keys() - {"gyrofree"}:
        for path in (ROOT / room).rglob("*.py"):
            shells = {
                name
                for name in imported(path)
                if name.endswith(".service") and name.split(".")[0] != room
            }
            assert not shells, path


def test_no_file_grows_beyond_what_a_reader_can_hold():
    for room in MAY_IMPORT:
        for path in (ROOT / room).rglob("*.py"):
            if not path.stem.endswith("_pb2"):
                assert len(path.read_text().splitlines()) <= 330, path
