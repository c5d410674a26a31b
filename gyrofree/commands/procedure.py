"""`gyrofree procedure`: tests as procedures, listed, checked, run and compared."""

import json
import time
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Column, Table

from gyrofree.commands.options import (
    AsJson,
    Config,
    file_of,
    say,
    settings_of,
    show_table,
)
from gyrofree.commands.parser import Commands, output_file, output_folder
from gyrofree.running.process import EXIT_CONFIG, EXIT_FAILED, fail
from sessions.procedure import library
from sessions.procedure.model import DEG, Plan

app = Commands(
    no_args_is_help=True,
    rich_markup_mode=None,
    help="Tests as procedures: list, show, check, run, compare. docs/procedures.md",
)

Device = Annotated[str, typer.Option(help="Device on the table.")]
Name = Annotated[str, typer.Argument(help="A procedure; `gyrofree procedure list` shows them.")]


def _plan(name: str, config: Path | None) -> Plan:
    try:
        return library.find(name, settings_of(config).procedures.folder)
    except library.ProcedureError as error:
        raise fail(error, EXIT_CONFIG) from None


@app.command("list")
def list_procedures(as_json: AsJson = False, config: Config = None) -> None:
    """Every procedure that can be run: shipped ones, and those of [procedures] folder."""
    folder = settings_of(config).procedures.folder
    rows, faults = [], []
    for name in library.names(folder):
        try:
            plan = library.find(name, folder)
        except library.ProcedureError as error:
            faults.append(str(error))
            continue
        procedure = plan.procedure
        rows.append(
            {
                "name": name,
                "title": procedure.title,
                "standard": procedure.standard,
                "steps": len(plan.steps),
                "seconds": plan.least_seconds,
                "limits": len(procedure.limits),
                "sha256": plan.sha256,
            }
        )
    if as_json:
        say(json.dumps(rows, indent=2))
    else:
        table = Table(Column("name", no_wrap=True), "steps", "at least", "limits", "title")
        for row in rows:
            length = f"{row['seconds']:.0f} s"
            table.add_row(row["name"], str(row["steps"]), length, str(row["limits"]), row["title"])
        show_table(table)
    if faults:
        raise fail("\n".join(faults), EXIT_CONFIG)


@app.command()
def show(name: Name, config: Config = None) -> None:
    """What a procedure does, step by step, and its limits."""
    _show(_plan(name, config))


@app.command()
def check(
    file: Annotated[Path, typer.Argument(help="TOML file of a procedure.")],
) -> None:
    """Look at a procedure of your own: one line per fault, with its place; else its steps."""
    try:
        plan = library.read(file)
    except library.ProcedureError as error:
        raise fail(error, EXIT_CONFIG) from None
    _show(plan)
    say("nothing wrong with it")


def _show(plan: Plan) -> None:
    procedure = plan.procedure
    say(f"{plan.name}: {procedure.title}")
    for label, text in (("after", procedure.standard), ("unit", procedure.unit)):
        if text:
            say(f"{label}: {text}")
    say(f"sha256 {plan.sha256}, at least {plan.least_seconds:.0f} s")
    table = Table("step", "name", "kind", "rate, deg/s", "ramp, s", "dwell, s", "limits")
    for number, step in enumerate(plan.steps, 1):
        turned = step.kind == "rate"
        rate = f"{step.target / DEG:+.4g} ± {step.tolerance / DEG:.3g}" if turned else ""
        limits = ", ".join(f"{name} {_range(limit)}" for name, limit in step.limits)
        dwell = f"{step.dwell_s:g}" if step.dwell_s else ""
        ramp = f"{step.ramp_s:g}" if turned else ""
        table.add_row(str(number), step.name, step.kind, rate, ramp, dwell, limits)
    show_table(table)
    for name, limit in procedure.limits.items():
        say(f"limit on {name}: {_range(limit)}")


def _range(limit) -> str:
    if limit.min is not None and limit.max is not None:
        return f"{limit.min:g} to {limit.max:g}"
    return f"at least {limit.min:g}" if limit.min is not None else f"at most {limit.max:g}"


@app.command()
def run(
    name: Name,
    device: Device = "cube",
    unit: Annotated[str, typer.Option(help="Serial number of the unit to be tested.")] = "",
    operator: Annotated[str, typer.Option(help="Who runs it; default the user's name.")] = "",
    own_session: Annotated[
        bool, typer.Option("--own-session/--any-session", help="Record in a session of its own.")
    ] = True,
    out: Annotated[
        Path | None,
        typer.Option(
            callback=output_folder(), help="Folder for the report; default ./report-<session>."
        ),
    ] = None,
    config: Config = None,
) -> None:
    """Run a procedure here, step by step, and make its report at the end.

    The service `gyrofree procedures` does it; another terminal or page may give orders too. Ctrl-C
    stops the table and ends the run. Exit code 1 when a limit is broken or the run did not end.
    """
    from gyrofree.running import procedure as runner

    settings = settings_of(config)
    _plan(name, config)
    wanted = runner.Wanted(name, device, unit, operator or runner.user(), own_session)
    try:
        status = runner.run(settings.bus, wanted)
    except runner.RunError as error:
        raise fail(error, EXIT_FAILED) from None
    if status.state != status.STATE_DONE:
        raise fail(f"the run did not get to its end: {status.message}", EXIT_FAILED)
    if not status.session:
        say("it was not recorded, so there is no report")
        return
    time.sleep(1.0)  # the recording's last chunk is on its way to the disk
    _report(file_of(settings, status.session), device, out)


def _report(path: Path, device: str, out: Path | None) -> None:
    from sessions.recording.manifest import name_of
    from sessions.report.build import build
    from sessions.report.verdict import load_spec

    try:
        made = build(path, load_spec(None), device)
        for file in made.write(out or Path(f"report-{name_of(path)}")):
            say(file)
    except (ValueError, OSError) as error:
        raise fail(error, EXIT_FAILED) from None
    say(f"verdict: {made.verdict}")
    if made.verdict == "fail":
        raise typer.Exit(EXIT_FAILED)


def _order(action: str, device: str, config: Path | None, text: str = "") -> None:
    from gyrofree.running import procedure as runner

    try:
        say(runner.order(settings_of(config).bus, action, device, text))
    except runner.RunError as error:
        raise fail(error, EXIT_FAILED) from None


@app.command("next")
def next_step(
    text: Annotated[str, typer.Argument(help="What was read, as a temperature.")] = "",
    device: Device = "cube",
    config: Config = None,
) -> None:
    """An open step is done; or a step that failed is left out."""
    _order("NEXT", device, config, text)


@app.command()
def repeat(device: Device = "cube", config: Config = None) -> None:
    """Begin the present step anew."""
    _order("REPEAT", device, config)


@app.command()
def abort(device: Device = "cube", config: Config = None) -> None:
    """End the run; a driven table goes to rest by its ramp."""
    _order("ABORT", device, config)


@app.command()
def stop(device: Device = "cube", config: Config = None) -> None:
    """EMERGENCY STOP: the driven table stops at once, the run ends."""
    _order("STOP", device, config)


@app.command()
def compare(
    sessions: Annotated[
        list[str], typer.Argument(help="Ids of sessions, or paths of MCAP files: one for a unit.")
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            callback=output_file(),
            help="Write the sheet to this CSV file too.",
        ),
    ] = None,
    as_json: AsJson = False,
    config: Config = None,
) -> None:
    """One sheet for a batch of units: figures with two standard errors, and who is unlike the
    others.
    """
    from sessions.procedure import sheet

    settings = settings_of(config)
    try:
        made = sheet.made([(name, file_of(settings, name)) for name in sessions])
        if out is not None:
            sheet.write(made, out)
    except (ValueError, OSError) as error:
        raise fail(error, EXIT_CONFIG) from None
    if as_json:
        say(json.dumps(sheet.as_json(made), indent=2))
        return
    show_table(sheet.table(made))
    for remark in sheet.remarks(made):
        say(remark)
