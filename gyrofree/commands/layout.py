"""`gyrofree layout`: what an arrangement of accelerometer axes can see, several beside each other,
a better one.
"""

import json
import math
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from gyrofree.commands.layout_tables import (
    axes_table,
    figures_table,
    matrix_table,
    price,
    unknowns_table,
)
from gyrofree.commands.options import LARGEST_SEED, AsJson, console_of, say, show_table
from gyrofree.commands.parser import Commands, output_file
from gyrofree.running.process import EXIT_CONFIG, fail
from inertial.whole_file import whole
from messages.text import reason

WIDTH = 150  # characters of tables where nobody looks at a terminal

app = Commands(
    no_args_is_help=True,
    rich_markup_mode=None,
    help=(
        "Accelerometer layouts: show one, compare several, search for a better one"
        " (docs/layouts.md)."
    ),
)

Where = Annotated[
    str,
    typer.Argument(
        help="Built-in name (cube, chen-6, nine, edges-12, stars-12, array-24) or FILE.toml."
    ),
]
HalfSide = Annotated[
    float | None,
    typer.Option(
        min=0.001, max=10.0, help="Half the side of a built-in layout, m; default its file's."
    ),
]
Turn = Annotated[
    float,
    typer.Option(min=0.0, max=5000.0, help="Turn about z for the predicted rate noise, deg/s."),
]
Hertz = Annotated[float, typer.Option(min=1.0, max=10000.0, help="Samples per second.")]
Plot = Annotated[
    Path | None,
    typer.Option(
        callback=output_file(".png"),
        help="Draw it into this PNG file.",
    ),
]


def _quality(name: str, half_side: float | None, turn: float, hertz: float) -> Any:
    import numpy as np

    from inertial.layouts import catalogue, quality
    from inertial.layouts.layout import GeometryError

    try:
        layout = catalogue.find(name, half_side)
    except GeometryError as error:
        raise fail(error, EXIT_CONFIG) from None
    return quality.analyse(layout, np.array([0.0, 0.0, math.radians(turn)]), 1.0 / hertz)


@app.command()
def show(
    layout: Where,
    half_side: HalfSide = None,
    turn: Turn = 180.0,
    hertz: Hertz = 100.0,
    plot: Plot = None,
    as_json: AsJson = False,
) -> None:
    """Everything about one layout: axes, J and S, kappa, GDOP, feedback, what is observable,
    predicted noise.
    """
    q = _quality(layout, half_side, turn, hertz)
    if plot is not None:
        _draw([q], plot)
    if as_json:
        return say(json.dumps(q.as_json(), indent=2))
    console = console_of(WIDTH)
    console.print(f"{q.layout.name}  {q.layout.text}", highlight=False)
    console.print(axes_table(q.layout))
    console.print(figures_table([q]))
    console.print(unknowns_table(q))
    console.print("singular values: " + "  ".join(f"{v:.3f}" for v in q.singular), highlight=False)
    if q.mixtures:
        console.print("seen only together: " + ", ".join(q.mixtures), highlight=False)
    if math.isfinite(q.gdop):
        console.print(
            matrix_table(
                "S: w' and p from the axes, columns are axes",
                q.layout.S,
                ("w'x", "w'y", "w'z", "px", "py", "pz"),
            )
        )
        console.print(
            matrix_table("J: rows are axes, columns w' and p", q.layout.J, q.layout.axis_names)
        )


@app.command()
def compare(
    layouts: Annotated[
        list[str] | None, typer.Argument(help="Names or files; default all built-in ones.")
    ] = None,
    half_side: HalfSide = 0.05,
    turn: Turn = 180.0,
    hertz: Hertz = 100.0,
    plot: Plot = None,
    as_json: AsJson = False,
) -> None:
    """Layouts side by side, in one table."""
    from inertial.layouts.catalogue import LAYOUTS

    found = [_quality(name, half_side, turn, hertz) for name in layouts or LAYOUTS]
    if plot is not None:
        _draw(found, plot)
    if as_json:
        return say(json.dumps([q.as_json() for q in found], indent=2))
    show_table(figures_table(found), WIDTH)


@app.command()
def optimise(
    axes: Annotated[int, typer.Option(min=6, max=64, help="Number of axes.")] = 12,
    half_side: Annotated[
        float, typer.Option(min=0.001, max=10.0, help="Axes sit in a cube of this half side, m.")
    ] = 0.05,
    box: Annotated[str, typer.Option(help="Instead: half sides of a box, 'x,y,z' in m.")] = "",
    sphere: Annotated[
        float | None, typer.Option(min=0.001, max=10.0, help="Instead: radius of a sphere, m.")
    ] = None,
    points: Annotated[
        str, typer.Option(help="Instead: only at these points, 'x,y,z; x,y,z; ...' in m, in turn.")
    ] = "",
    triads: Annotated[
        bool, typer.Option(help="Triaxial sensors along the body axes instead of single axes.")
    ] = False,
    rank: Annotated[
        int,
        typer.Option(
            min=6, max=12, help="Unknowns of the field that must be seen; 12: the products too."
        ),
    ] = 6,
    no_feedback: Annotated[
        bool, typer.Option(help="S q = 0: least squares must not need the rate.")
    ] = False,
    starts: Annotated[int, typer.Option(min=1, max=1000, help="Random starts.")] = 16,
    seed: Annotated[
        int,
        typer.Option(
            min=0, max=LARGEST_SEED, help="Seed of the starts: the same seed finds the same layout."
        ),
    ] = 1,
    sensor: Annotated[str, typer.Option(help="Sensor model, for the predicted noise.")] = "adxl345",
    out: Annotated[
        Path | None,
        typer.Option(
            callback=output_file(),
            help="Write the layout found to this TOML file.",
        ),
    ] = None,
    turn: Turn = 180.0,
    hertz: Hertz = 100.0,
    plot: Plot = None,
    as_json: AsJson = False,
) -> None:
    """Search for the layout of smallest GDOP in a region, and show its price beside the published
    cube.
    """
    import numpy as np

    from inertial.layouts import catalogue, quality, search
    from inertial.layouts.catalogue import CUBE
    from inertial.layouts.layout import GeometryError

    region = _region(half_side, box, sphere, points)
    wish = search.Wish(axes, triads, rank, no_feedback, region, starts, seed, sensor)
    try:
        with _bar() as (bar, task):
            found = search.search(
                wish, lambda done, what: bar.update(task, completed=done, description=what)
            )
    except GeometryError as error:
        raise fail(error) from None
    rate = np.array([0.0, 0.0, math.radians(turn)])
    q = quality.analyse(found.layout, rate, 1.0 / hertz)
    cube = quality.analyse(CUBE(region.scale_m), rate, 1.0 / hertz)
    if out is not None:
        _write(out, catalogue.as_toml(found.layout))
    if plot is not None:
        _draw([q], plot)
    if as_json:
        extra = {
            "starts": found.starts,
            "agreeing": found.agreeing,
            "gdops": found.gdops,
            "lower_bound": found.bound,
        }
        return say(
            json.dumps({"search": extra, "found": q.as_json(), "cube": cube.as_json()}, indent=2)
        )
    console = console_of(WIDTH)
    console.print(axes_table(found.layout))
    console.print(figures_table([q, cube]))
    console.print(
        f"{found.agreeing} of {found.starts} starts ended within 0.1 % of this GDOP; "
        f"none can be below {found.bound:.4f}.",
        highlight=False,
    )
    console.print(f"price: {price(q)}", highlight=False)
    if out is not None:
        console.print(
            f'written to {out}; use it with  [estimator.layout]  file = "{out}"',
            highlight=False,
            markup=False,
        )


def _region(half_side: float, box: str, sphere: float | None, points: str) -> Any:
    from inertial.layouts.search import Region

    if sum((bool(box), sphere is not None, bool(points))) > 1:
        raise fail("--box, --sphere and --points exclude each other", EXIT_CONFIG)
    if points:
        return Region(
            points_m=tuple(_three("--points", part) for part in points.split(";") if part.strip())
        )
    if box:
        return Region(half_sides_m=_three("--box", box))
    return Region(radius_m=sphere) if sphere is not None else Region(half_sides_m=(half_side,) * 3)


def _three(option: str, text: str) -> tuple[float, float, float]:
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        raise fail(
            f"{option} {text.strip()!r}: want three numbers 'x,y,z' in m", EXIT_CONFIG
        ) from None
    if not all(map(math.isfinite, (x, y, z))):
        raise fail(f"{option} {text.strip()!r}: want finite numbers", EXIT_CONFIG)
    return x, y, z


class _bar:
    """A progress bar on standard error."""

    def __enter__(self) -> tuple[Progress, Any]:
        self._bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            TimeElapsedColumn(),
            console=Console(stderr=True),
            transient=True,
        )
        self._bar.start()
        return self._bar, self._bar.add_task("searching", total=1.0)

    def __exit__(self, *_: object) -> None:
        self._bar.stop()


def _write(path: Path, text: str) -> None:
    try:
        with whole(path) as draft:
            draft.write_text(text, encoding="utf-8")
    except OSError as error:
        raise fail(f"{reason(error)}; name another file with --out") from None


def _draw(found: list[Any], path: Path) -> None:
    from inertial.layouts.draw import draw

    try:
        draw(found, path)
    except (OSError, ValueError) as error:
        raise fail(f"{reason(error)}; name another PNG file with --plot") from None
