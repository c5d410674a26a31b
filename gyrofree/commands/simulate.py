"""`gyrofree simulate`: a simulated board, or a run of it as a log."""

import logging
import threading
from pathlib import Path
from typing import Annotated

import typer

from gyrofree.commands.options import (
    LARGEST_SEED,
    Config,
    Fault,
    Verbose,
    faults_of,
    say,
    settings_of,
)
from gyrofree.commands.parser import output_file, output_link
from gyrofree.running.process import EXIT_CONFIG as CONFIG
from gyrofree.running.process import fail, run_service

log = logging.getLogger(__name__)


def simulate(
    link: Annotated[
        Path | None,
        typer.Option(
            callback=output_link(), help="Make the pseudo-terminal reachable under this path."
        ),
    ] = None,
    tcp: Annotated[
        int | None,
        typer.Option(
            min=1, max=65535, help="Listen on this TCP port of the loopback instead of a pty."
        ),
    ] = None,
    profile: Annotated[
        str,
        typer.Option(
            help=(
                "Motion of the table: published (or cw-ccw), wobble, fast, still; or a CSV or TOML"
                " file of your own, see docs/procedures.md."
            )
        ),
    ] = "published",
    seed: Annotated[
        int, typer.Option(min=0, max=LARGEST_SEED, help="Seed of biases, scale errors and noise.")
    ] = 1,
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
    table_link: Annotated[
        Path | None,
        typer.Option(
            callback=output_link(),
            help="Offer the table's text protocol on a pseudo-terminal under this path.",
        ),
    ] = None,
    table_tcp: Annotated[
        int | None, typer.Option(min=1, max=65535, help="The same on a TCP port of the loopback.")
    ] = None,
    slips: Annotated[
        int,
        typer.Option(
            min=0, max=100, help="How often the person lets go who turns a table without a drive."
        ),
    ] = 0,
    csv: Annotated[
        Path | None,
        typer.Option(
            callback=output_file(),
            help="Be no board: write one run with its truth to this CSV, for `gyrofree run`.",
        ),
    ] = None,
    layout: Annotated[
        str, typer.Option(help="With --csv: name of a layout, or its TOML file.")
    ] = "cube",
    half_side: Annotated[
        float, typer.Option(min=0.001, max=10.0, help="With --csv: centre to face, m.")
    ] = 0.05,
    rate: Annotated[
        float,
        typer.Option(
            min=1.0,
            max=1000.0,
            help="Samples a second of the cube on its table; above 100 a frame has several.",
        ),
    ] = 100.0,
    config: Config = None,
    verbose: Verbose = False,
) -> None:
    """Be a cube on a rotating table: a board on a pseudo-terminal that speaks the real wire.

    Attach a gateway to the printed port. The true motion goes to the bus as its own topic, marked
    simulated.
    """
    settings = settings_of(config)
    from sessions.procedure.profile_file import profile_of

    faults = faults_of(fault)
    try:
        motion = profile_of(profile)
        if csv is not None:
            from gyrofree.running import simulate_csv

            for text in fault or ():
                say(f"fault {text}: not in the CSV, which is of a sound cube")
            count = simulate_csv.write(csv, motion, seed, layout, half_side, rate)
            say(f"{csv}: {count} samples")
            return
        if rate != 100.0 and (arm or tilt):
            raise ValueError("--rate is for the cube on its table, not for --arm or --tilt")
    except (ValueError, OSError) as error:
        raise fail(error, CONFIG) from None

    def body(stop: threading.Event) -> None:
        from gyrofree.running import simulate as simulator
        from gyrofree.running import simulate_hand
        from inertial.simulation.faults import when

        for one, text in zip(faults, fault or (), strict=True):
            log.warning("fault %s %s", text, when(one, motion.seconds))
        options = simulator.Options(
            link=link,
            tcp=tcp,
            profile=motion,
            seed=seed,
            device=device,
            once=once,
            faults=faults,
            arm_m=arm or 0.0,
            table_link=table_link,
            table_tcp=table_tcp,
            slips=slips,
            rate_hz=rate,
        )
        bus = settings.bus.acting_as("simulator")
        (simulate_hand if tilt else simulator).run(options, bus, stop)

    run_service(body, verbose)
