"""`gyrofree replay`: recordings listed, sent through the bus again, or checked against the
estimators.
"""

import datetime
import json
import threading
from dataclasses import asdict, dataclass
from pathlib import Path

from rich.console import Console
from rich.table import Table

from gyrofree.commands.options import show_table
from gyrofree.config import Settings
from sessions.library.catalogue import Catalogue


def find(settings: Settings, session: str) -> Path:
    """MCAP file of an id or path; raises LookupError that says what there is."""
    if Path(session).is_file():
        return Path(session)
    catalogue = Catalogue(Path(settings.recorder.root))
    try:
        return catalogue.path(session)
    except (LookupError, ValueError):
        ids = ", ".join(info.id for info in catalogue.list()[:5]) or "none"
        raise LookupError(
            f"no recording {session!r} in {settings.recorder.root}; newest there: {ids}"
        ) from None


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
            info.id,
            ", ".join(info.devices),
            f"{start:%Y-%m-%d %H:%M:%S}",
            f"{info.seconds:.1f} s",
            info.state,
            str(info.messages),
            str(info.lost),
            f"{info.bytes / 1e6:.2f} MB",
        )
    show_table(table)


def check(settings: Settings, path: Path, as_json: bool) -> int:
    """Run the estimators over the recorded samples; exit code 0 when every estimate is the recorded
    one.
    """
    from estimator.pipeline import Pipeline
    from sessions.replay.reproduce import reproduce

    with Console(stderr=True).status(
        f"running the estimators over {path.stat().st_size / 1e6:.1f} MB of recording"
    ):
        result = reproduce(path, Pipeline(settings.estimator))
    if as_json:
        print(json.dumps(result.as_dict(), indent=2))
    else:
        table = Table("key", "equal", "different", "missing", "first difference")
        for key, row in result.as_dict()["keys"].items():
            table.add_row(
                key,
                *(str(row[name]) for name in ("equal", "different", "missing", "first_difference")),
            )
        show_table(table)
        if not result.identical:
            reason = "an estimator began before the recording, or an input is missing"
            print(f"Estimates differ where {reason}: docs/recordings.md")
    return 0 if result.identical else 1


@dataclass(frozen=True)
class Options:
    """How a recording is played."""

    speed: float = 1.0
    at_s: float = 0.0  # begin at this second of it
    paused: bool = False
    stay: bool = False  # wait at the end for orders
    rate: tuple[str, ...] = ()  # rate estimators instead of the configured ones
    overlay: bool = False  # publish the recorded estimates beside the new ones


def run(settings: Settings, path: Path, options: Options, stop: threading.Event) -> None:
    """Play a recording on the bus and obey the orders on <prefix>/replay/control."""
    from estimator.pipeline import Pipeline
    from messages.bus import orders
    from messages.bus.session import Publishers, open_client
    from messages.contract.topics import REPLAY
    from sessions.replay.playback import Playback
    from sessions.replay.replay import DRAIN_S, Outlet

    estimator = settings.estimator
    if options.rate:
        estimator = estimator.model_copy(update={"rate": list(options.rate)})
    Pipeline(estimator)  # names that do not exist are refused now
    with open_client(settings.bus, stop) as session:
        outlet, publishers = (
            Outlet(session, settings.bus.prefix),
            Publishers(session, settings.bus.prefix),
        )
        playback = Playback(
            path,
            outlet.put,
            lambda: Pipeline(estimator),
            speed=options.speed,
            at_s=options.at_s,
            paused=options.paused,
            show_recorded=options.overlay,
        )
        control = orders.take(
            session,
            settings.bus.prefix,
            orders.REPLAY,
            lambda order: playback.order(order.command, order.answer),
        )
        try:
            playback.run(
                stop, lambda status: publishers.put(REPLAY, REPLAY.name, status), options.stay
            )
            stop.wait(DRAIN_S)
        finally:
            control.undeclare()
