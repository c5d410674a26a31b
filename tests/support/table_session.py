"""One recorded table run for the tests of sessions, reports and pages: simulated, imported,
estimated, written once.
"""

import functools
import tempfile
from pathlib import Path

from estimator.pipeline import Pipeline
from estimator.settings import EstimatorSettings
from gyrofree.running.importer import rows_of
from gyrofree.running.simulate_csv import write
from logs.board_log import read_board_log
from sessions.replay.rerun import estimates_again, write_session

SESSION = "20240101-000000-table"
CONFIGURATION: dict[str, object] = {"estimator": {"layout": {"half_side_m": 0.05}}}


@functools.cache
def table_root() -> Path:
    """A folder with one closed session, SESSION: 30 s of the published test, device `cube`. Not to
    be changed.
    """
    root = Path(tempfile.mkdtemp(prefix="gyrofree-test-"))
    log = root / "log.csv"
    write(log, "published", 3, "cube", 0.05)
    inputs = write_session(
        root / "inputs",
        SESSION,
        rows_of(read_board_log(log), "gyrofree", "cube"),
        "",
        CONFIGURATION,
    )
    again = estimates_again(inputs / "recording.mcap", Pipeline(EstimatorSettings(navigators=[])))
    write_session(root / "sessions", SESSION, again, "simulated table", CONFIGURATION)
    return root / "sessions"


def table_recording() -> Path:
    """Its MCAP file."""
    return table_root() / SESSION / "recording.mcap"
