"""`gyrofree calibrate`: biases, scales, directions and positions of a board's axes, kept on a
card.
"""

import csv
import datetime
import json
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.table import Table

from gyrofree.commands.axes import axes
from gyrofree.commands.options import LARGEST_SEED, AsJson, say, show_table
from gyrofree.commands.parser import Commands, output_file, output_folder
from gyrofree.commands.run import progress_bar
from gyrofree.running.process import EXIT_CONFIG, fail
from inertial.constants import MILLI_G
from inertial.whole_file import whole

app = Commands(
    no_args_is_help=True,
    rich_markup_mode=None,
    help=(
        "Calibrate accelerometer axes from standing poses and table steps; find the axes of a tilt"
        " board.\n\nplan says which poses to take, fit makes a card of the logs, show prints it,"
        " apply corrects a log with it; axes finds out which input of an accelerometer and"
        " gyroscope board is which axis."
    ),
)
app.command()(axes)

LayoutName = Annotated[str, typer.Option("--layout", help="Name of a layout, or its TOML file.")]
HalfSide = Annotated[
    float, typer.Option(min=0.001, max=10.0, help="Built-in layouts: centre to face, m.")
]
Lsb = Annotated[
    float | None, typer.Option(min=1e-6, max=1e6, help="Logs in counts: mg per count; default 3.9.")
]
DEG = 180.0 / np.pi


def _layout(name: str, half_side: float) -> Any:
    from inertial.layouts.catalogue import find

    return find(name, half_side)


@app.command()
def plan(
    poses: Annotated[int, typer.Option(min=6, max=24, help="How many poses.")] = 14,
    layout: LayoutName = "cube",
    half_side: HalfSide = 0.05,
    seconds: Annotated[
        float, typer.Option(min=0.5, max=3600.0, help="How long each stands still, s.")
    ] = 4.0,
    rate: Annotated[float, typer.Option(min=1.0, max=10000.0, help="Samples per second.")] = 100.0,
    as_json: AsJson = False,
) -> None:
    """Say which poses to take, in order, and how well they would determine each axis."""
    from inertial.calibration import poses as p

    try:
        shape = _layout(layout, half_side)
        up = p.plan(poses)
        fit = p.predicted(shape, up, max(1, round(seconds * rate)), float(np.max(shape.noise)))
    except (ValueError, OSError) as error:
        raise fail(error, EXIT_CONFIG) from None
    promised = {
        "bias_sigma_mps2": float(fit.bias_sigma.max()),
        "scale_sigma": float(fit.scale_sigma.max()),
        "misalignment_sigma_rad": float(fit.misalignment_sigma.max()),
    }
    listed = [{"up_b": v.tolist(), "text": p.describe(v)} for v in up]
    if as_json:
        say(json.dumps({"layout": shape.name, "poses": listed, "predicted": promised}, indent=2))
        return
    table = Table("pose", "do this", "up in body axes")
    for number, one in enumerate(listed, 1):
        table.add_row(str(number), one["text"], " ".join(f"{v:+.2f}" for v in one["up_b"]))
    show_table(table)
    say(
        f"each {seconds:g} s still, worst axis then: bias"
        f" ±{promised['bias_sigma_mps2'] / MILLI_G:.2f} mg,"
        f" scale ±{promised['scale_sigma'] * 100:.3f} %, direction"
        f" ±{promised['misalignment_sigma_rad'] * DEG:.3f}°"
    )


@app.command()
def fit(
    logs: Annotated[
        list[Path],
        typer.Argument(help="CSV logs: tumbles, and runs on the table with tacho_rad_s."),
    ],
    out: Annotated[
        Path,
        typer.Option(
            callback=output_file(makes=True),
            help="The card, a TOML file.",
        ),
    ] = Path("card.toml"),
    layout: LayoutName = "cube",
    half_side: HalfSide = 0.05,
    lsb_mg: Lsb = None,
    device: Annotated[str, typer.Option(help="Name of the device the card is for.")] = "cube",
    uid: Annotated[str, typer.Option(help="Unique id of its board, as it says in HELLO.")] = "",
    as_json: AsJson = False,
) -> None:
    """Make a calibration file: one least squares over all poses and table steps, with
    uncertainties.
    """
    from inertial.calibration.card import as_dict, write_card
    from logs.calibrate import advice, calibrate

    date = datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    try:
        with progress_bar() as progress:
            made = calibrate(
                logs,
                _layout(layout, half_side),
                device=device,
                date=date,
                uid=uid,
                lsb_mg=lsb_mg,
                progress=progress,
            )
        write_card(made.card, out)
    except (ValueError, OSError) as error:
        raise fail(error, EXIT_CONFIG) from None
    said = advice(made)
    if as_json:
        say(json.dumps({**as_dict(made.card), "card": str(out), "advice": said}, indent=2))
        return
    _print(made.card)
    for line in said:
        say(f"! {line}")
    say(f"written to {out}")


@app.command()
def show(
    card: Annotated[Path, typer.Argument(help="A calibration file.")], as_json: AsJson = False
) -> None:
    """Print a card: what is known of every axis, and how well."""
    from inertial.calibration.card import as_dict, read_card

    try:
        found = read_card(card)
    except (ValueError, OSError) as error:
        raise fail(error, EXIT_CONFIG) from None
    if as_json:
        say(json.dumps(as_dict(found), indent=2))
    else:
        _print(found)


def _print(card: Any) -> None:
    from inertial.calibration.card import sigmas

    sigma = sigmas(card)
    say(
        f"card {card.id}: {card.device}{' ' + card.uid if card.uid else ''}, layout"
        f" {card.layout_name}, {card.date}\n{card.poses} poses, {card.steps} table runs; residual"
        f" {card.residual_rms / MILLI_G:.2f} mg, chi-square per degree {card.chi2:.2f}"
    )
    table = Table("axis", "bias, mg", "scale, %", "off by, °", "position, mm", "residual, mg")
    for i, name in enumerate(card.names):
        place = " ".join(
            f"{card.position_b[i, k] * 1e3:+.3f}"
            + (f"±{sigma['position'][i, k] * 1e3:.3f}" if seen else "(nominal)")
            for k, seen in enumerate(card.observed[i, 4:])
        )
        table.add_row(
            name,
            f"{card.bias[i] / MILLI_G:+.2f} ±{sigma['bias'][i] / MILLI_G:.2f}",
            f"{(card.scale[i] - 1.0) * 100:+.3f} ±{sigma['scale'][i] * 100:.3f}",
            f"±{sigma['misalignment'][i] * DEG:.3f}",
            place,
            f"{card.residual[i] / MILLI_G:.2f}",
        )
    show_table(table)


@app.command("apply")
def apply_card(
    log: Annotated[Path, typer.Argument(help="CSV log of the same axes.")],
    card: Annotated[Path, typer.Argument(help="The calibration file.")],
    out: Annotated[
        Path,
        typer.Option(
            callback=output_file(), help="CSV with a.._mps2 columns, biases and scales taken out."
        ),
    ],
    layout: LayoutName = "cube",
    half_side: HalfSide = 0.05,
    lsb_mg: Lsb = None,
    layout_out: Annotated[
        Path | None,
        typer.Option(
            callback=output_file(),
            help="Also write the calibrated directions and positions as a layout file.",
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Correct a log: readings without bias and scale error, along the card's directions at its
    positions.

    To use a card on the live path name it as `calibration` in [estimator]; `gyrofree run --card`
    applies it by itself.
    """
    from inertial.calibration.card import read_card
    from inertial.layouts.catalogue import as_toml
    from logs.cube_log import read_log

    try:
        shape, found = _layout(layout, half_side), read_card(card)
        data = read_log(log, shape.axis_names, lsb_mg)
        calibrated = found.layout(shape)
        values = found.correct(data.f_axis * np.array(shape.gain))
        with whole(out) as new, new.open("w", newline="", encoding="utf-8") as file:
            _write(file, data, values, found.id)
        if layout_out is not None:
            with whole(layout_out) as draft:
                draft.write_text(as_toml(calibrated), encoding="utf-8")
    except (ValueError, OSError) as error:
        raise fail(error, EXIT_CONFIG) from None
    result = {
        "card": found.id,
        "out": str(out),
        "samples": len(values),
        "layout": str(layout_out or ""),
    }
    say(
        json.dumps(result, indent=2)
        if as_json
        else f"{out}: {len(values)} samples corrected by card {found.id}"
    )


def _write(file: Any, data: Any, values: np.ndarray, card: str) -> None:
    from logs.cube_log import TACHO, TRUE_ATTITUDE, TRUE_RATE

    columns = [("t_s", data.t_s[:, None])]
    columns += [(",".join(f"{name}_mps2" for name in data.names), values)]
    for names, extra in (
        ((TACHO,), data.tacho),
        (TRUE_RATE, data.omega_b),
        (TRUE_ATTITUDE, data.q_nb),
    ):
        if extra is not None:
            columns.append((",".join(names), np.reshape(extra, (len(values), -1))))
    file.write(
        f"# corrected by calibration file {card}\n" + ",".join(head for head, _ in columns) + "\n"
    )
    writer = csv.writer(file, lineterminator="\n")
    writer.writerows(
        [f"{value:.7f}" for value in row]
        for row in np.hstack([block for _, block in columns]).tolist()
    )


@app.command("simulate")
def simulate(
    out: Annotated[
        Path,
        typer.Option(
            callback=output_folder(),
            help="Folder for poses.csv, steps-1.csv ..., run.csv and truth.json.",
        ),
    ],
    seed: Annotated[int, typer.Option(min=0, max=LARGEST_SEED, help="Which imperfect device.")] = 1,
    poses: Annotated[int, typer.Option(min=6, max=24, help="Poses of the tumble.")] = 14,
    layout: LayoutName = "cube",
    half_side: HalfSide = 0.05,
) -> None:
    """Write logs of a simulated imperfect device, to try the commands with: its truth lies beside
    them.
    """
    from logs.imperfect_logs import write

    try:
        with progress_bar() as progress:
            files = write(out, _layout(layout, half_side), seed, poses, progress)
    except (ValueError, OSError) as error:
        raise fail(error, EXIT_CONFIG) from None
    for path in files:
        say(path)
