"""`gyrofree demo` and `gyrofree play`: everything at once, behind one URL."""

import threading
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from gyrofree.commands import board as boards
from gyrofree.commands.options import Config, Fault, Speed, UnitsAsNamed, Verbose, faults_of
from gyrofree.commands.parser import output_folder, output_link
from gyrofree.running.process import EXIT_CONFIG as CONFIG
from gyrofree.running.process import fail, run_service


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
        Path,
        typer.Option(
            callback=output_folder(), help="Where journal, recordings and users are kept."
        ),
    ] = Path("var/demo"),
    record: Annotated[bool, typer.Option(help="Record from the start.")] = True,
    by_hand: Annotated[
        bool,
        typer.Option(
            "--by-hand",
            help="The table is not driven: in a test a simulated person turns it, and slips once.",
        ),
    ] = False,
    office: Annotated[
        bool,
        typer.Option(
            "--office",
            help=(
                "Also an office that watches over a slow line, with a page of its own at the next"
                " port; SIGUSR1 pulls the cable."
            ),
        ),
    ] = False,
    profile: Annotated[
        str | None,
        typer.Option(
            help="Motion of the table, as of `gyrofree simulate`: published, wobble, fast, still,"
            " or a CSV or TOML file of your own."
        ),
    ] = None,
    fault: Fault = None,
) -> None:
    """Start router, gateway, estimator, recorder, dashboard and a board, and print one URL.

    The board is simulated, but it speaks the real wire through a pseudo-terminal. Ctrl-C ends
    everything.
    """
    from gyrofree.demo import bench as demonstration

    if profile is not None and source != "table":
        raise fail(f"--profile is of the table, not of --source {source}", CONFIG)
    if source == "table":
        board, device, layout = _table(profile, by_hand, fault), "cube", "cube"
    elif source in demonstration.SIMULATED:
        board, device, layout = demonstration.SIMULATED[source]
    elif source == "emulated":
        boards.check()
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
    plan = replace(plan, table=source == "table" and not by_hand)
    plan = replace(plan, estimator=demonstration.ESTIMATOR.get(source, ""))
    if office:
        from gyrofree.demo import office as both

        return both.run(plan)
    demonstration.run(plan)


def _table(profile: str | None, by_hand: bool, fault: list[str] | None) -> list[str]:
    """Words of the simulated table's command. What is wrong is said here, not in its log."""
    from sessions.procedure.profile_file import profile_of

    faults_of(fault)
    words = ["simulate", *(["--slips=1"] * by_hand)]
    if profile is not None:
        try:
            profile_of(profile)
        except (ValueError, OSError) as error:
            raise fail(error, CONFIG) from None
        file = Path(profile).suffix
        words.append(f"--profile={Path(profile).absolute() if file else profile}")
    return [*words, *(f"--fault={one}" for one in fault or ())]


def _check_log(path: Path, gnss: Path | None = None, as_named: bool = False) -> str:
    """Kind of log ("imu" or "cube"); a log that cannot be played ends the command with its
    reason.
    """
    from gyrofree.running.play import kind_of
    from logs.sheet import LogError

    try:
        return kind_of(path, gnss, as_named)
    except (LogError, OSError) as error:
        raise fail(error, CONFIG) from None


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
            callback=output_link(),
            help="Only be a board, reachable under this path; no other service is started.",
        ),
    ] = None,
    port: Annotated[int, typer.Option(min=1, max=65535, help="Port of the dashboard.")] = 8080,
    bus_port: Annotated[
        int, typer.Option(min=1, max=65535, help="Port of the Zenoh router.")
    ] = 7447,
    folder: Annotated[
        Path,
        typer.Option(
            callback=output_folder(), help="Where journal, recordings and users are kept."
        ),
    ] = Path("var/play"),
    units_as_named: UnitsAsNamed = False,
    config: Config = None,
    verbose: Verbose = False,
) -> None:
    """Play a log of real sensors through the wire, the gateway and everything behind it.

    The columns are described in docs/logs.md. Like `gyrofree demo`, this prints one URL; with
    --link it is only the board. Without --loop it ends with the log, and says what was recorded.
    """
    kind = _check_log(log, gnss, units_as_named)
    if link is not None:

        def body(stop: threading.Event) -> None:
            from gyrofree.running import play as player

            player.run(player.Options(log, gnss, speed, loop, link, units_as_named), stop)

        return run_service(body, verbose)
    from gyrofree.demo import bench as demonstration

    board = ["play", f"--speed={speed}"] + (["--loop"] if loop else [])
    board += [f"--gnss={gnss.absolute()}"] if gnss else []
    board += ["--units-as-named"] if units_as_named else []
    board += ["--", str(log.absolute())]
    demonstration.run(
        demonstration.Plan(
            folder.absolute(),
            board,
            "cube" if kind == "cube" else "log",
            kind,
            port,
            bus_port,
            time_scale=speed,
            once=not loop,
            command="play",
        )
    )
