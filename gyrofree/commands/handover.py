"""`gyrofree export`, `report`, `import`, `rerun`: sessions handed on, judged, made again."""

import json
import math
import sys
from pathlib import Path
from typing import Annotated

import typer

from gyrofree.commands.options import (
    AsJson,
    Config,
    SessionOrFile,
    UnitsAsNamed,
    catalogue_of,
    file_of,
    say,
    session_name,
    settings_of,
)
from gyrofree.commands.parser import output_folder
from gyrofree.commands.run import progress_bar
from gyrofree.running.process import EXIT_CONFIG, EXIT_FAILED, fail
from messages.contract.topics import TopicError, check_name
from sessions.library.annotations import give_title
from sessions.recording.manifest import SessionError, name_of, slug


def export(
    session: SessionOrFile,
    form: Annotated[
        str, typer.Option("--format", "-f", help="csv, parquet, mat, kml, gpx or mcap.")
    ] = "csv",
    out: Annotated[
        Path,
        typer.Option(
            callback=output_folder(),
            help="Folder for the files; made when absent.",
        ),
    ] = Path("export"),
    topics: Annotated[
        str, typer.Option(help="Only these topics, separated by commas, as accel,rate.")
    ] = "",
    start: Annotated[
        float, typer.Option("--from", min=0, max=1e9, help="s from the session's start.")
    ] = 0.0,
    end: Annotated[
        float | None,
        typer.Option("--to", min=0, max=1e9, help="s from the session's start; default its end."),
    ] = None,
    as_json: AsJson = False,
    config: Config = None,
) -> None:
    """Write a session in another program's format. Column names carry the units, all SI; big
    sessions stream.
    """
    from sessions.export.export import ExportError
    from sessions.export.export import export as write
    from sessions.export.table import Selection

    path = file_of(settings_of(config), session)
    wanted = frozenset(name.strip() for name in topics.split(",") if name.strip())
    try:
        with progress_bar() as progress:
            files = write(
                path,
                form,
                out,
                Selection(wanted, start, math.inf if end is None else end),
                progress,
            )
    except ExportError as error:
        raise fail(error, EXIT_CONFIG) from None
    except OSError as error:
        raise fail(error) from None
    say(
        json.dumps([str(file) for file in files], indent=2)
        if as_json
        else "\n".join(map(str, files))
    )


def report(
    session: SessionOrFile,
    out: Annotated[
        Path | None,
        typer.Option(
            callback=output_folder(),
            help="Folder for HTML, PDF and JSON; default ./report-<session>.",
        ),
    ] = None,
    spec: Annotated[
        Path | None, typer.Option(help="Limits in TOML; default the ones that come with gyrofree.")
    ] = None,
    device: Annotated[str, typer.Option(help="Device; default the one with most samples.")] = "",
    boot: Annotated[
        int | None,
        typer.Option(
            min=0, max=2**32 - 1, help="Boot counter of the board; default the longest run."
        ),
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the report as JSON, write no files.")
    ] = False,
    config: Config = None,
) -> None:
    """The test report of a session: HTML, PDF and JSON. The same recording gives the same bytes.

    Exit code 1 when a limit of the specification is broken.
    """
    from sessions.report.build import build
    from sessions.report.verdict import load_spec

    path = file_of(settings_of(config), session)
    try:
        with progress_bar() as progress:
            made = build(path, load_spec(spec), device, boot, progress)
        if as_json:
            say(made.json, end="")
        else:
            for file in made.write(out or Path(f"report-{name_of(path)}")):
                say(file)
            say(f"verdict: {made.verdict}")
    except (ValueError, OSError) as error:
        raise fail(error, EXIT_CONFIG) from None
    if made.verdict == "fail":
        raise typer.Exit(EXIT_FAILED)


def import_log(
    log: Annotated[
        Path, typer.Argument(help="CSV file, or a folder with imu.csv and gnss.csv; docs/logs.md.")
    ],
    gnss: Annotated[
        Path | None, typer.Option(help="CSV of GNSS epochs beside a single CSV of samples.")
    ] = None,
    tacho: Annotated[Path | None, typer.Option(help="CSV of a cube's t_s, tacho_rad_s.")] = None,
    device: Annotated[str, typer.Option(help="Device name for the samples.")] = "log",
    name: Annotated[
        str, typer.Option(help="Added to the session's id.", callback=session_name)
    ] = "import",
    start: Annotated[
        str,
        typer.Option(help="When it was recorded, UTC, as 2026-11-29T10:00:00; a log has no date."),
    ] = "",
    units_as_named: UnitsAsNamed = False,
    as_json: AsJson = False,
    config: Config = None,
) -> None:
    """Make a session of a log: its samples, and the estimates of the configured estimators on
    them.
    """
    from gyrofree.running import importer
    from logs.board_log import read_board_log
    from logs.sheet import LogError

    settings = settings_of(config)
    try:
        check_name(device)
        start_s = importer.start_of(start)
        source = read_board_log(log, gnss, units_as_named, tacho=tacho)
        for note in source.notes:
            say(f"note: {note}", file=sys.stderr)
        rows = importer.rows_of(source, settings.bus.prefix, device, start_s)
        folder, axes = _estimated(
            settings,
            rows,
            f"{importer.stamp(source, start_s)}-{slug(name) or 'import'}",
            f"made of {log.name}",
            settings.recorder.root,
        )
        give_title(folder, name)
        for text in axes:
            say(text, file=sys.stderr)
    except (LogError, TopicError, SessionError, OSError) as error:
        raise fail(error, EXIT_CONFIG) from None
    say(json.dumps({"session": folder.name}) if as_json else folder.name)


def _estimated(settings, rows, session: str, note: str, root: Path) -> tuple[Path, list[str]]:
    """A session of the rows with the estimates on them; what is said of the axes at its end."""
    import tempfile

    from estimator.pipeline import Pipeline
    from gyrofree.running.axes_said import axes_said, keeping_axes
    from sessions.replay.rerun import estimates_again, write_session

    configuration = settings.model_dump(mode="json")
    with tempfile.TemporaryDirectory() as scratch, progress_bar() as progress:
        inputs = write_session(Path(scratch), session, rows, note, configuration)
        again = estimates_again(
            inputs / "recording.mcap", Pipeline(settings.estimator), "", progress
        )
        last: dict[str, bytes] = {}
        folder = write_session(Path(root), session, keeping_axes(again, last), note, configuration)
        return folder, [axes_said(payload) for payload in last.values()]


def rerun(
    session: SessionOrFile,
    estimators: Annotated[
        str, typer.Option(help="Rate estimators to run, separated by commas.")
    ] = "",
    navigators: Annotated[
        str, typer.Option(help="Navigation filters to run, separated by commas.")
    ] = "",
    name: Annotated[
        str,
        typer.Option(
            help="Added to the new session's id and the new estimators' names.",
            callback=session_name,
        ),
    ] = "new",
    beside: Annotated[
        bool, typer.Option("--beside/--instead", help="Keep the old estimates beside.")
    ] = True,
    changed: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            help="KEY=VALUE of [estimator] for this run, as layout.half_side_m=0.0493; repeatable.",
        ),
    ] = None,
    library_only: Annotated[
        bool, typer.Option(help="Files in --set by name, of the folders for cards and axis maps.")
    ] = False,
    as_json: AsJson = False,
    config: Config = None,
) -> None:
    """Run a session's inputs through other estimators or another configuration, as a new session.

    The new estimates stand beside the old ones under their own names, so that live view, report and
    export compare them on one time axis.
    """
    from estimator.choice import UnknownEstimator
    from estimator.pipeline import Pipeline
    from gyrofree.running.rerun_settings import from_library, with_changes
    from sessions.replay.rerun import Damage, estimates_again, note_damage, rerun_id, write_session

    settings = settings_of(config)
    path, short = file_of(settings, session), slug(name, 24) or "new"
    chosen = {"rate": estimators, "navigators": navigators}
    changes = {
        key: [one.strip() for one in text.split(",")] for key, text in chosen.items() if text
    }
    try:
        estimator = with_changes(settings.estimator.model_copy(update=changes), changed or [])
        estimator = from_library(settings.estimator, estimator) if library_only else estimator
        settings = settings.model_copy(update={"estimator": estimator})
        pipeline = Pipeline(estimator)
        with progress_bar() as progress:
            damage = Damage()
            rows = estimates_again(path, pipeline, short if beside else "", progress, damage)
            what = ", ".join([*sum(changes.values(), []), *(changed or [])]) or "this configuration"
            note = f"{path.parent.name} again: {what}"
            folder = write_session(
                catalogue_of(settings).root,
                rerun_id(path, short),
                rows,
                note,
                settings.model_dump(mode="json"),
            )
        give_title(folder, name)
        note_damage(folder, damage)
    except (UnknownEstimator, SessionError, ValueError, OSError) as error:
        raise fail(error, EXIT_CONFIG) from None
    say(json.dumps({"session": folder.name}) if as_json else folder.name)
