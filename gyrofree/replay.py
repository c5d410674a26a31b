"""`gyrofree replay`: recordings listed, sent through the bus again, or checked against the estimators."""

import datetime
import json
import sys
import threading
from dataclasses import asdict
from pathlib import Path

from rich.console import Console
from rich.table import Table

from gyrofree.config import Settings
from sessions.catalogue import Catalogue


def find(settings: Settings, session: str) -> Path:
    """MCAP file of an id or path; raises LookupError that says what there is."""
    if Path(session).is_file():
        return Path(session)
    catalogue = Catalogue(Path(settings.recorder.root))
    try:
        return catalogue.path(session)
    except (LookupError, ValueError):
        ids = ", ".join(info.id for info in catalogue.list()[:5]) or "none"
        raise LookupError(f"no recording {session!r} in {settings.recorder.root}; newest there: {ids}") from None


def show_list(settings: Settings, as_json: bool) -> None:
    """The catalogue on standard output."""
    infos = Catalogue(Path(settings.recorder.root)).list()
    if as_json:
        print(json.dumps([asdict(info) for info in infos], indent=2, default=str))
        return
    table = Table("id", "devices", "start (UTC)", "length", "state", "messages", "lost", "size")
    for info in infos:
        start = datetime.datetime.fromtimestamp(info.start_utc_ns / 1e9, datetime.UTC)
        table.add_row(
            info.id, ", ".join(info.devices), f"{start:%Y-%m-%d %H:%M:%S}", f"{info.seconds:.1f} s", info.state,
            str(info.messages), str(info.lost), f"{info.bytes / 1e6:.2f} MB",
        )  # fmt: skip
    Console(file=sys.stdout).print(table)


def check(settings: Settings, path: Path, as_json: bool) -> int:
    """Run the estimators over the recorded samples; exit code 0 when every estimate is the recorded one."""
    from estimator.service import Pipeline
    from sessions.reproduce import reproduce

    with Console(stderr=True).status(f"running the estimators over {path.stat().st_size / 1e6:.1f} MB of recording"):
        result = reproduce(path, Pipeline(settings.estimator))
    if as_json:
        print(json.dumps(result.as_dict(), indent=2))
    else:
        table = Table("key", "equal", "different", "missing", "first difference")
        for key, row in result.as_dict()["keys"].items():
            table.add_row(key, *(str(row[name]) for name in ("equal", "different", "missing", "first_difference")))
        Console(file=sys.stdout).print(table)
        if not result.identical:
            reason = "an estimator began before the recording, or an input is missing"
            print(f"Estimates differ where {reason}: docs/recordings.md")
    return 0 if result.identical else 1


def run(settings: Settings, path: Path, speed: float, stop: threading.Event) -> None:
    """Publish the recorded inputs at `speed` times real time."""
    from sessions import replay

    replay.run(path, settings.bus, stop, speed=speed)
