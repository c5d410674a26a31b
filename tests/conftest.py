"""Fixtures shared by all rooms."""

import os
import socket
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent


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
