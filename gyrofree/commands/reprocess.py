"""`gyrofree reprocess`: every session of a folder through the estimators again."""

import functools
import json
from pathlib import Path
from typing import Annotated

import typer

from gyrofree.commands.options import AsJson, Config, say, settings_of
from gyrofree.commands.parser import output_file
from gyrofree.commands.run import progress_bar
from gyrofree.running.process import EXIT_CONFIG, fail
from sessions.recording.manifest import SessionError


def reprocess(
    folder: Annotated[
        Path | None, typer.Argument(help="Folder of sessions; default the configured one.")
    ] = None,
    out: Annotated[
        Path,
        typer.Option(
            callback=output_file(makes=True),
            help="Parquet table, one row per session, boot and estimator.",
        ),
    ] = Path("reprocessed.parquet"),
    estimators: Annotated[
        str, typer.Option(help="Rate estimators, separated by commas; default as configured.")
    ] = "",
    jobs: Annotated[int, typer.Option(min=0, max=1024, help="Processes; 0: one per core.")] = 0,
    scheduler: Annotated[
        str, typer.Option(help="Address of a Dask scheduler, as tcp://10.0.0.1:8786.")
    ] = "",
    as_json: AsJson = False,
    config: Config = None,
) -> None:
    """Run every session of a folder through the estimators again and tabulate how well they did.

    On one machine in parallel, or on a Dask cluster by the same command. DuckDB and pandas read the
    table.
    """
    from gyrofree.running.reprocess import score_session
    from sessions.library.catalogue import Catalogue
    from sessions.replay.reprocess import SchedulerError, run_all, write_table

    settings = settings_of(config)
    root = (folder or Path(settings.recorder.root)).absolute()
    rate = [one.strip() for one in estimators.split(",") if one.strip()] or settings.estimator.rate
    chosen = settings.estimator.model_copy(update={"rate": rate})
    try:
        paths = [
            info.path
            for info in Catalogue(root).list()
            if info.path is not None and info.state != "open"
        ]
        if not paths:
            raise fail(f"{root}: no closed or recovered session there", EXIT_CONFIG)
        rows = []
        with progress_bar() as progress:
            for count, more in enumerate(
                run_all(paths, functools.partial(score_session, chosen), jobs, scheduler), 1
            ):
                rows += more
                progress(count / len(paths), f"{count} of {len(paths)} sessions")
        write_table(out, rows)
    except (SchedulerError, SessionError, OSError) as error:
        raise fail(error, EXIT_CONFIG) from None
    bad = sum(bool(row.get("problem")) for row in rows)
    if as_json:
        say(json.dumps(rows, indent=2))
    else:
        say(f"{out}: {len(rows)} rows of {len(paths)} sessions, {bad} with a problem")
