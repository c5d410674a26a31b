"""Fixtures shared by all rooms."""

import os
import socket
from pathlib import Path

import pytest
from hypothesis import settings
from support.browser import chromium  # noqa: F401  a fixture

settings.register_profile("untimed", deadline=None)  # a busy machine is no fault
settings.register_profile("few", deadline=None, max_examples=15)  # for a core ten times as slow
settings.load_profile(os.environ.get("GYROFREE_EXAMPLES", "untimed"))

ROOT = Path(__file__).resolve().parent.parent
# Whole installations in real time, each busy with a core: one after the other, or all are late.
INSTALLATIONS = (
    "test_procedures",
    "test_by_hand",
    "test_up",
    "test_faults",
    "test_wall_clock",
    "test_alarms",
    "test_demo_office",
    "test_wheel",
    "test_play",
    "test_alarm_places",
    "test_operations",
)
# Of the others those that take the longest come first: else one worker ends them alone.
LONGEST = (
    "test_files",
    "test_broken_files",
    "test_mcap_damage",
    "test_cli_sessions",
    "test_setup",
    "test_service",
)


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """To import all tests takes a fifth of a minute: those of a browser are found by their text."""
    if config.option.markexpr != "browser" or not collection_path.name.startswith("test_"):
        return None
    if collection_path.is_dir():
        return None
    return True if "mark.browser" not in collection_path.read_text(encoding="utf-8") else None


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The order in which `pytest --dist loadfile --no-loadscope-reorder` hands files out."""
    place = {name: number for number, name in enumerate((*INSTALLATIONS, *LONGEST))}
    items.sort(key=lambda item: place.get(item.path.stem, len(place)))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: object) -> object | None:
    """`--dist loadfile`: the installations are as one file, for one worker."""
    if config.option.dist != "loadfile":
        return None
    from xdist.scheduler import LoadFileScheduling

    class Scheduling(LoadFileScheduling):
        def _split_scope(self, nodeid: str) -> str:
            file = super()._split_scope(nodeid)
            return "installations" if Path(file).stem in INSTALLATIONS else file

    return Scheduling(config, log)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int:
    """`-n auto`: two more than there are cores, since many tests wait for processes of theirs."""
    return len(os.sched_getaffinity(0)) + 2


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """The folder with real logs: $GYROFREE_DATA, else shared/data beside the checkout."""
    for candidate in (os.environ.get("GYROFREE_DATA"), ROOT.parent / "shared" / "data"):
        if candidate and Path(candidate).is_dir():
            return Path(candidate)
    if os.environ.get("CI"):
        pytest.fail(
            "no real logs, and CI skips nothing: set GYROFREE_DATA or put shared/ beside the"
            " checkout"
        )
    pytest.skip(
        "real logs not found: set GYROFREE_DATA to the folder that holds car_drive/ and receivers/"
    )


@pytest.fixture
def free_port() -> int:
    """A TCP port of the loopback that was free a moment ago."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]
