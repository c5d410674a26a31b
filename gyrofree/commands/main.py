"""The command line. Every command takes its parameters here and does its work in another module."""

import importlib.metadata
import json
import logging
import threading
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from gyrofree.commands import (
    board as cli_board,
)
from gyrofree.commands import (
    calibrate as cli_calibrate,
)
from gyrofree.commands import (
    handover as cli_handover,
)
from gyrofree.commands import (
    layout as cli_layout,
)
from gyrofree.commands import (
    run as cli_run,
)
from gyrofree.commands import (
    sessions as cli_sessions,
)
from gyrofree.commands import (
    users as cli_users,
)
from gyrofree.commands.options import (
    AsJson,
    Config,
    Fault,
    Speed,
    UnitsAsNamed,
    Verbose,
    faults_of,
    settings_of,
    show_table,
)
from gyrofree.commands.replay import replay
from gyrofree.config import ConfigError
from gyrofree.running.process import EXIT_CONFIG as CONFIG
from gyrofree.running.process import EXIT_FAILED, command, fail, run_service

log = logging.getLogger(__name__)

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    help=(
        "Bench and remote eye for inertial units without gyroscopes.\n\n"
        "`gyrofree demo` shows everything on one page; the other commands are its parts."
    ),
)

app.add_typer(cli_users.app, name="users")
app.add_typer(cli_layout.app, name="layout")
app.add_typer(cli_sessions.app, name="sessions")
cli_handover.mount(app)
app.add_typer(cli_calibrate.app, name="calibrate")
app.add_typer(cli_run.app, name="reproduce")
app.command()(cli_run.run)
app.command()(cli_board.board)


def _show_version(wanted: bool) -> None:
    if wanted:
        print(f"gyrofree {importlib.metadata.version('gyrofree')}")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool,
        typer.Option("--version", help="Print the version.", callback=_show_version, is_eager=True),
    ] = False,
) -> None:
    pass


@app.command()
def demo(
    source: Annotated[
        str,
        typer.Option(
            help=(
                "'table': the simulated rotating table. 'emulated': the same table, sensed by the"
                " firmware image in "
                "an emulator. 'arm': the cube at the end of a turning arm, navigating. 'tilt': an"
                " analogue tilt board in a "
                "hand, its wiring unknown. 'drive': the log in --data, played."
            )
        ),
    ] = "table",
    data: Annotated[
        Path | None, typer.Option(help="Folder with imu.csv and gnss.csv, for --source drive.")
    ] = None,
    speed: Speed = 1.0,
    port: Annotated[int, typer.Option(min=1, max=65535, help="Port of the dashboard.")] = 8080,
    bus_port: Annotated[
        int, typer.Option(min=1, max=65535, help="Port of the Zenoh router.")
    ] = 7447,
    folder: Annotated[
        Path, typer.Option(help="Where journal, recordings and users are kept.")
    ] = Path("var/demo"),
    record: Annotated[bool, typer.Option(help="Record from the start.")] = True,
    fault: Fault = None,
) -> None:
    """Start router, gateway, estimator, recorder, dashboard and a board, and print one URL.

    The board is simulated, but it speaks the real wire through a pseudo-terminal. Ctrl-C ends
    everything.
    """
    from gyrofree.running import demo as demonstration

    if source == "table":
        faults_of(fault)  # a wrong one is said here, not in the board's log
        board, device, layout = (
            ["simulate", *(w for f in fault or () for w in ("--fault", f))],
            "cube",
            "cube",
        )
    elif source in demonstration.SIMULATED:
        board, device, layout = demonstration.SIMULATED[source]
    elif source == "emulated":
        cli_board.check()
        board, device, layout = ["board", "--emulate", "--speed", str(speed)], "cube", "cube"
    elif source == "drive":
        if data is None:
            raise fail("--source drive wants --data FOLDER with imu.csv and gnss.csv", CONFIG)
        _check_log(data)
        board, device, layout = ["play", str(data), "--speed", str(speed), "--loop"], "car", "imu"
    else:
        raise fail(
            f"--source {source!r}: want 'table', 'emulated', 'arm', 'tilt' or 'drive'", CONFIG
        )
    scale = speed if source in ("emulated", "drive") else 1.0
    plan = demonstration.Plan(
        folder.absolute(), board, device, layout, port, bus_port, record=record, time_scale=scale
    )
    demonstration.run(replace(plan, estimator=demonstration.ESTIMATOR.get(source, "")))


def _check_log(path: Path, gnss: Path | None = None, as_named: bool = False) -> str:
    """Kind of log ("imu" or "cube"); a log that cannot be played ends the command with its
    reason.
    """
    from gyrofree.running.play import kind_of
    from logs.sheet import LogError

    try:
        return kind_of(path, gnss, as_named)
    except (LogError, OSError) as error:
        raise fail(str(error)) from None


@app.command()
def router(config: Config = None, verbose: Verbose = False) -> None:
    """Route the bus: the Zenoh session that all others connect to."""
    settings = settings_of(config)

    def body(stop: threading.Event) -> None:
        from messages.bus.session import open_router

        with open_router(settings.bus):
            log.info("router listens on %s", ", ".join(settings.bus.listen))
            stop.wait()

    run_service(body, verbose)


@app.command()
def gateway(config: Config = None, verbose: Verbose = False) -> None:
    """Read the boards of [[gateway.devices]], journal every byte, publish samples."""
    settings = settings_of(config)

    from gateway import service
    from gateway.ports.keeper import Keeper
    from gyrofree.running.guardian import guard, leave_when_alone

    def body(stop: threading.Event, keeper: Keeper) -> None:
        leave_when_alone(stop)
        service.run(settings.gateway, settings.bus, stop, keeper)

    guard(lambda keeper: run_service(lambda stop: body(stop, keeper), verbose))


@app.command()
def estimator(config: Config = None, verbose: Verbose = False) -> None:
    """Turn the samples on the bus into rate, attitude and navigation, several estimators side by
    side.
    """
    settings = settings_of(config)

    def body(stop: threading.Event) -> None:
        from estimator import service
        from estimator.choice import UnknownEstimator

        try:
            service.run(settings.estimator, settings.bus, stop)
        except UnknownEstimator as error:
            raise ConfigError(str(error)) from None

    run_service(body, verbose)


@app.command()
def record(config: Config = None, verbose: Verbose = False) -> None:
    """Write everything on the bus to MCAP files, when told to from the dashboard or from the
    start.
    """
    settings = settings_of(config)

    def body(stop: threading.Event) -> None:
        from sessions.recording import recorder

        recorder.run(settings.recorder, settings.bus, stop, settings.model_dump(mode="json"))

    run_service(body, verbose)


@app.command()
def dashboard(config: Config = None, verbose: Verbose = False) -> None:
    """Serve the web page with scene, charts, recordings and sign-in."""
    settings = settings_of(config)

    def body(stop: threading.Event) -> None:
        from dashboard import service
        from dashboard.web.control import ProcessReplay
        from dashboard.web.jobs import Jobs

        options = ["--config", str(config)] if config else []
        replayer = command("replay", "--stay", *options)
        jobs = Jobs(command(), options)
        service.run(
            settings.dashboard, settings.bus, stop, replay=ProcessReplay(replayer), jobs=jobs
        )

    run_service(body, verbose)


@app.command()
def simulate(
    link: Annotated[
        Path | None, typer.Option(help="Make the pseudo-terminal reachable under this path.")
    ] = None,
    tcp: Annotated[
        int | None, typer.Option(help="Listen on this TCP port of the loopback instead of a pty.")
    ] = None,
    profile: Annotated[
        str, typer.Option(help="Motion of the table: published (or cw-ccw), wobble, fast, still.")
    ] = "published",
    seed: Annotated[int, typer.Option(help="Seed of biases, scale errors and noise.")] = 1,
    device: Annotated[
        str, typer.Option(help="Device name under which the truth is published.")
    ] = "cube",
    once: Annotated[bool, typer.Option(help="End after one run of the profile.")] = False,
    arm: Annotated[
        float | None,
        typer.Option(
            min=0.5,
            max=20.0,
            help=(
                "The cube rides at the end of an arm of this length, m, with a receiver; instead of"
                " --profile."
            ),
        ),
    ] = None,
    tilt: Annotated[
        bool,
        typer.Option(
            "--tilt",
            help="Be an analogue tilt board in a hand instead; it follows a guided detection.",
        ),
    ] = False,
    fault: Fault = None,
    csv: Annotated[
        Path | None,
        typer.Option(
            help="Be no board: write one run with its truth to this CSV, for `gyrofree run`."
        ),
    ] = None,
    layout: Annotated[
        str, typer.Option(help="With --csv: name of a layout, or its TOML file.")
    ] = "cube",
    half_side: Annotated[float, typer.Option(help="With --csv: centre to face, m.")] = 0.05,
    config: Config = None,
    verbose: Verbose = False,
) -> None:
    """Be a cube on a rotating table: a board on a pseudo-terminal that speaks the real wire.

    Attach a gateway to the printed port. The true motion goes to the bus as its own topic, marked
    simulated.
    """
    settings = settings_of(config)
    from inertial.simulation.profiles import named

    faults = faults_of(fault)
    try:
        profile_name = named(profile).name
        if csv is not None:
            from gyrofree.running import simulate_csv

            print(f"{csv}: {simulate_csv.write(csv, profile, seed, layout, half_side)} samples")
            return
    except (ValueError, OSError) as error:
        raise fail(str(error), CONFIG) from None

    def body(stop: threading.Event) -> None:
        from gyrofree.running import simulate as simulator
        from gyrofree.running import simulate_hand

        options = simulator.Options(link, tcp, profile_name, seed, device, once, faults, arm or 0.0)
        (simulate_hand if tilt else simulator).run(options, settings.bus, stop)

    run_service(body, verbose)


@app.command()
def play(
    log: Annotated[Path, typer.Argument(help="CSV file, or a folder with imu.csv and gnss.csv.")],
    gnss: Annotated[
        Path | None, typer.Option(help="CSV of GNSS epochs beside a single CSV of samples.")
    ] = None,
    speed: Speed = 1.0,
    loop: Annotated[bool, typer.Option(help="Start over at the end.")] = False,
    link: Annotated[
        Path | None,
        typer.Option(
            help="Only be a board, reachable under this path; no other service is started."
        ),
    ] = None,
    port: Annotated[int, typer.Option(min=1, max=65535, help="Port of the dashboard.")] = 8080,
    bus_port: Annotated[
        int, typer.Option(min=1, max=65535, help="Port of the Zenoh router.")
    ] = 7447,
    folder: Annotated[
        Path, typer.Option(help="Where journal, recordings and users are kept.")
    ] = Path("var/play"),
    units_as_named: UnitsAsNamed = False,
    config: Config = None,
    verbose: Verbose = False,
) -> None:
    """Play a log of real sensors through the wire, the gateway and everything behind it.

    The columns are described in docs/logs.md. Like `gyrofree demo`, this prints one URL; with
    --link it is only the board.
    """
    kind = _check_log(log, gnss, units_as_named)
    if link is not None:

        def body(stop: threading.Event) -> None:
            from gyrofree.running import play as player

            player.run(player.Options(log, gnss, speed, loop, link, units_as_named), stop)

        return run_service(body, verbose)
    from gyrofree.running import demo as demonstration

    board = ["play", str(log.absolute()), "--speed", str(speed)] + (["--loop"] if loop else [])
    board += ["--gnss", str(gnss.absolute())] if gnss else []
    board += ["--units-as-named"] if units_as_named else []
    demonstration.run(
        demonstration.Plan(
            folder.absolute(),
            board,
            "cube" if kind == "cube" else "log",
            kind,
            port,
            bus_port,
            time_scale=speed,
        )
    )


app.command()(replay)


@app.command()
def doctor(
    health: Annotated[
        str,
        typer.Option(help="Only ask this running service for a sign of life: router, gateway, ..."),
    ] = "",
    as_json: AsJson = False,
    config: Config = None,
) -> None:
    """Check ports, permissions, clock, disk and versions, and say what to do."""
    from gyrofree.running import doctor as examination

    settings = settings_of(config)
    services = ("router", *examination.SIGN_OF_LIFE, "dashboard")
    if health and health not in services:
        raise fail(f"--health {health!r}: want one of {', '.join(services)}", CONFIG)
    findings = [examination.health(health, settings)] if health else examination.examine(settings)
    if as_json:
        print(json.dumps(examination.as_json(findings), indent=2))
    else:
        table = Table("check", "state", "found", "what to do")
        colour = {"ok": "green", "warn": "yellow", "fail": "bold red"}
        for finding in findings:
            state = f"[{colour[finding.state]}]{finding.state}[/]"
            table.add_row(finding.check, state, finding.found, finding.remedy)
        show_table(table)
    if any(finding.state == "fail" for finding in findings):
        raise typer.Exit(EXIT_FAILED)


def main() -> None:
    """Entry point of `gyrofree`."""
    app()
