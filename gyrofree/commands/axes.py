"""`gyrofree calibrate axes`: which input of a board is which axis, with which sign, from a log of
three turns.
"""

import datetime
import json
import math
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from gyrofree.commands.options import AsJson, say, show_table
from gyrofree.commands.parser import output_file
from gyrofree.running.process import EXIT_CONFIG, EXIT_FAILED, fail
from inertial.constants import GRAVITY

DEG = 180.0 / math.pi


def axes(
    log: Annotated[
        Path,
        typer.Argument(
            help="CSV of the three turns: t_s and six SI columns, or a converter's inputs."
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            callback=output_file(makes=True),
            help="Write the axis map to this TOML file.",
        ),
    ] = None,
    device: Annotated[str, typer.Option(help="Name of the device the map is for.")] = "board",
    volt_per_count: Annotated[
        float, typer.Option(min=1e-12, max=1e3, help="Converter: V per count.")
    ] = 3.3 / 4095,
    zero_g_v: Annotated[
        float, typer.Option(min=-1e3, max=1e3, help="Converter: V of an accelerometer at 0 g.")
    ] = 1.65,
    accel_v_per_g: Annotated[
        float, typer.Option(min=-1e3, max=1e3, help="Converter: V per g.")
    ] = 0.4785,
    gyro_v_per_dps: Annotated[
        float, typer.Option(min=-1e3, max=1e3, help="Converter: V per deg/s.")
    ] = 0.002,
    as_json: AsJson = False,
) -> None:
    """Find axes and signs of an accelerometer and gyroscope board from a log of movements by hand.

    Let the board rest level for three seconds; tip its nose up by a quarter turn and let it rest;
    level again; its right side down, rest; level; then turn it to the right, flat on the table, and
    let it rest. The dashboard's page Wiring guides through the same live. Name the map in
    [estimator.axis_maps] to use it.
    """
    from inertial.attitude.axis_map import AxisMap, Figures, write_map
    from logs.axes_log import detect
    from logs.sheet import LogError

    figures = Figures(zero_g_v, accel_v_per_g / GRAVITY, 0.0, math.degrees(gyro_v_per_dps))
    try:
        found = detect(log, figures, volt_per_count)
        if found.map is None:
            heard = (
                "; ".join(f"{t:.1f} s: {text}" for t, text in found.said) or "no movement was seen"
            )
            raise fail(
                f"{log}: not every axis is found; it ended waiting for: {found.instruction}"
                f" ({heard})",
                EXIT_FAILED,
            )
        date = datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
        named: AxisMap = found.map.named(device, date)
        if out is not None:
            write_map(named, out)
    except (LogError, OSError) as error:
        raise fail(error, EXIT_CONFIG) from None
    if as_json:
        say(json.dumps(_result(named, found, out), indent=2))
        return
    _print(named, found, out)


def _result(m: Any, found: Any, out: Path | None) -> dict[str, Any]:
    from inertial.attitude.axis_map import as_dict

    turns = [
        {
            "about": t.about,
            "by_gyro_rad": t.by_rate,
            "by_accelerometer_rad": None if t.about == "z" else t.by_force,
        }
        for t in found.turns
    ]
    said = [{"t_s": t, "text": text} for t, text in found.said]
    return {
        **as_dict(m),
        "turns": turns,
        "said": said,
        "gateway_toml": m.gateway_toml(),
        "map": str(out or ""),
    }


def _print(m: Any, found: Any, out: Path | None) -> None:
    from inertial.attitude.axis_map import ABSENT, AXES

    table = Table("axis of the body", "is", "sign")
    for k, name in enumerate(AXES):
        absent = m.column[k] == ABSENT
        table.add_row(
            name,
            "no input" if absent else m.inputs[m.column[k]],
            "" if absent else f"{'-+'[m.sign[k] > 0]}",
        )
    show_table(table, 100)
    for turn in found.turns:
        other = "" if turn.about == "z" else f", by accelerometer {turn.by_force * DEG:.1f}°"
        say(f"turn about {turn.about}: by gyro {turn.by_rate * DEG:.1f}°{other}")
    for t, text in found.said:
        if text != "found":
            say(f"! {t:.1f} s: {text}")
    if m.source == "adc":
        say(f"\nas [gateway.devices.analogue]:\n{m.gateway_toml()}")
    if out is not None:
        say(f"written to {out}")
