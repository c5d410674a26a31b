"""`gyrofree board`: the board that runs the real firmware image in an emulator."""

import json
import threading
from pathlib import Path
from typing import Annotated

import typer

from gyrofree.commands.options import LARGEST_SEED, AsJson, Config, Verbose, say, settings_of
from gyrofree.commands.parser import output_link
from gyrofree.running.process import EXIT_CONFIG, fail, run_service

FAULT_HELP = (
    "Let something go wrong, may stand several times: sensor-dead@12:sensor=3,"
    " sensor-stuck@12:sensor=3, sensor-good@20:sensor=3, uart-stall@20:s=1.5, brown-out@30,"
    " watchdog@30. Times are s since power."
)


def board(
    emulate: Annotated[
        bool, typer.Option("--emulate", help="Run the firmware image in the CPU emulator.")
    ] = False,
    image: Annotated[
        Path | None,
        typer.Option(help="Image from flash address 0; default: what `make firmware` builds."),
    ] = None,
    port_link: Annotated[
        Path | None,
        typer.Option(
            "--port-link",
            "--link",
            callback=output_link(),
            help="Make the pseudo-terminal reachable under this path.",
        ),
    ] = None,
    tcp: Annotated[
        int | None,
        typer.Option(
            min=1, max=65535, help="Listen on this TCP port of the loopback instead of a pty."
        ),
    ] = None,
    profile: Annotated[
        str, typer.Option(help="Motion of the table: published, wobble, fast or still.")
    ] = "published",
    seed: Annotated[
        int,
        typer.Option(
            min=0,
            max=LARGEST_SEED,
            help="Seed of biases, scale errors, noise and the sensors' clocks.",
        ),
    ] = 1,
    speed: Annotated[
        float, typer.Option(min=0.1, max=20.0, help="Emulated seconds per second.")
    ] = 1.0,
    clock_ppm: Annotated[
        float, typer.Option(min=-2000.0, max=2000.0, help="Error of the board's crystal.")
    ] = 0.0,
    fault: Annotated[list[str] | None, typer.Option(help=FAULT_HELP)] = None,
    device: Annotated[
        str, typer.Option(help="Device name under which the truth is published.")
    ] = "cube",
    load: Annotated[
        bool,
        typer.Option("--load", help="Only say how busy the image keeps the processor, and end."),
    ] = False,
    as_json: AsJson = False,
    config: Config = None,
    verbose: Verbose = False,
) -> None:
    """Be a board: the very firmware image that would be flashed, with models of the LPC1768 and
    four ADXL345 around it.

    Its sensors feel the simulated table. Attach a gateway to the printed port. The emulator is an
    extra: pip install --require-hashes -r requirements/board.txt
    """
    settings = settings_of(config)
    if not emulate:
        raise fail(
            "a real board needs no command: name its port in [[gateway.devices]]; for an emulated"
            " one add --emulate",
            EXIT_CONFIG,
        )
    options = _options(image, port_link, tcp, profile, seed, speed, clock_ppm, fault or [], device)
    if load:
        return _say_load(options.image, as_json)

    def body(stop: threading.Event) -> None:
        from emulator.engine import EmulationError, EmulatorMissing
        from gyrofree.running import emulated

        try:
            emulated.run(options, settings.bus, stop)
        except (EmulatorMissing, EmulationError) as error:
            raise fail(error) from None

    run_service(body, verbose)


def _options(image, link, tcp, profile, seed, speed, clock_ppm, faults, device):  # noqa: ANN001, ANN202
    """Checked options; ends the command with one line for what is wrong."""
    from emulator.world import FaultError, parse_fault
    from gyrofree.running.emulated import IMAGE, Options
    from inertial.simulation.profiles import PROFILES

    if profile not in PROFILES:
        raise fail(f"--profile {profile!r}: want one of {', '.join(PROFILES)}", EXIT_CONFIG)
    path = image or IMAGE
    if not path.is_file():
        remedy = (
            "name another with --image"
            if image
            else "build it with `make firmware`, or name one with --image"
        )
        raise fail(f"{path}: no firmware image there; {remedy}")
    try:
        parsed = [parse_fault(text) for text in faults]
    except FaultError as error:
        raise fail(error, EXIT_CONFIG) from None
    return Options(path, link, tcp, profile, seed, speed, clock_ppm, parsed, device)


def check() -> None:
    """End the command with one line when there is no image or no emulator."""
    from emulator.engine import EmulatorMissing, Engine
    from gyrofree.running.emulated import IMAGE

    if not IMAGE.is_file():
        raise fail(f"{IMAGE}: no firmware image there; build it with `make firmware`")
    try:
        Engine()
    except EmulatorMissing as error:
        raise fail(error) from None


def _say_load(image: Path, as_json: bool) -> None:
    from dataclasses import asdict

    from emulator.engine import EmulationError, EmulatorMissing
    from emulator.load import load

    try:
        found = asdict(load(image))
    except (EmulatorMissing, EmulationError) as error:
        raise fail(error) from None
    if as_json:
        say(json.dumps(found))
        return
    for name, value in found.items():
        say(f"{name:24} {value:.6g}")
