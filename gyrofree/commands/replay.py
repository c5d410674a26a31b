"""`gyrofree replay`: recordings listed, played, or checked against the estimators."""

import datetime
import json
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from gyrofree.commands.options import (
    AsJson,
    Config,
    Speed,
    Verbose,
    catalogue_of,
    nothing_in,
    say,
    settings_of,
    show_table,
)
from gyrofree.config import Settings
from gyrofree.running.process import EXIT_CONFIG as CONFIG
from gyrofree.running.process import fail, run_service


def replay(
    session: Annotated[
        str, typer.Argument(help="Id of a recording (`--list` shows them) or path of an MCAP file.")
    ] = "",
    speed: Speed = 1.0,
    check: Annotated[
        bool, typer.Option(help="Do not publish: run the estimators on it and compare bit for bit.")
    ] = False,
    at: Annotated[
        float, typer.Option(min=0.0, max=1e9, help="Begin at this second of the recording.")
    ] = 0.0,
    paused: Annotated[
        bool, typer.Option(help="Begin with a pause; the dashboard's timeline goes on.")
    ] = False,
    stay: Annotated[
        bool, typer.Option(help="Wait at the end for orders of the dashboard's timeline.")
    ] = False,
    rate: Annotated[
        list[str] | None,
        typer.Option(help="A rate estimator instead of the configured ones; may be repeated."),
    ] = None,
    overlay: Annotated[
        bool, typer.Option(help="Show the recorded estimates beside the new ones.")
    ] = False,
    listing: Annotated[bool, typer.Option("--list", help="List the recordings.")] = False,
    as_json: AsJson = False,
    config: Config = None,
    verbose: Verbose = False,
) -> None:
    """Send a recording through the bus again, or prove that it reproduces its estimates."""
    settings = settings_of(config)
    from gyrofree.running import replay as player

    if listing or not session:
        return show_list(settings, as_json)
    try:
        path = player.find(settings, session)
    except LookupError as error:
        raise fail(error) from None
    if check:
        raise typer.Exit(compare_estimates(settings, path, as_json))
    from estimator.choice import UnknownEstimator

    options = player.Options(speed, at, paused, stay, tuple(rate or ()), overlay)
    try:
        run_service(lambda stop: player.run(settings, path, options, stop), verbose)
    except UnknownEstimator as error:
        raise fail(error, CONFIG) from None
    except (ValueError, player.ReplayError) as error:
        raise fail(error) from None


def show_list(settings: Settings, as_json: bool) -> None:
    """The catalogue on standard output."""
    infos = catalogue_of(settings).list()
    if as_json:
        say(json.dumps([asdict(info) for info in infos], indent=2, default=str))
        return
    if not infos:
        say(nothing_in(catalogue_of(settings).root))
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


def other_core(path: Path) -> str:
    """A sentence when a recording was made by another version of the estimators' core."""
    from inertial import core
    from sessions.recording.manifest import SessionError, read_manifest

    try:
        made_by = read_manifest(path.parent).versions.get("core", "unknown")
    except (SessionError, OSError):
        return ""
    if made_by == core.VERSION:
        return ""
    return f"Recorded by core {made_by}, run again by core {core.VERSION}: the last bits may differ"


def compare_estimates(settings: Settings, path: Path, as_json: bool) -> int:
    """Run the estimators over the recorded samples; exit code 0 when every estimate is the recorded
    one.
    """
    from estimator.pipeline import Pipeline
    from sessions.replay.reproduce import reproduce

    with Console(stderr=True).status(
        f"running the estimators over {path.stat().st_size / 1e6:.1f} MB of recording"
    ):
        result = reproduce(path, Pipeline(settings.estimator))
    other = other_core(path)
    if as_json:
        say(json.dumps(result.as_dict(), indent=2))
    else:
        table = Table("key", "equal", "different", "missing", "first difference")
        for key, row in result.as_dict()["keys"].items():
            table.add_row(
                key,
                *(str(row[name]) for name in ("equal", "different", "missing", "first_difference")),
            )
        show_table(table)
        say(*filter(None, (f"recording: {result.damage}", result.others, other)), sep="\n")
        if not result.identical:
            reason = "an estimator began before the recording, or an input is missing"
            say(f"Estimates differ where {reason}: docs/recordings.md")
    return 0 if result.identical else 1
