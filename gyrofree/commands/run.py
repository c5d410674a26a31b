"""`gyrofree run` and `gyrofree reproduce`: logs on disk through the estimators, without a bus."""

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from gyrofree.commands.options import LARGEST_SEED, AsJson, UnitsAsNamed, say
from gyrofree.commands.parser import PICTURES, Commands, output_file, output_folder
from gyrofree.commands.run_tables import kind_of, known, show
from gyrofree.running.process import EXIT_CONFIG, EXIT_FAILED, fail

Report = Callable[[float, str], None]

app = Commands(
    no_args_is_help=True, rich_markup_mode=None, help="Make the published figures and tables again."
)

Plot = Annotated[
    Path | None,
    typer.Option(
        callback=output_file(*PICTURES),
        help="Draw the result to this PNG file.",
    ),
]
Filters = Annotated[str, typer.Option(help="Names, separated by commas; default all of the kind.")]


@contextmanager
def progress_bar() -> Iterator[Report]:
    """A bar on stderr where there is a terminal; gives progress(done 0..1, what)."""
    console = Console(stderr=True)
    columns = TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn()
    with Progress(
        *columns, console=console, transient=True, disable=not console.is_terminal
    ) as bar:
        task = bar.add_task("reading", total=1.0)
        yield lambda done, what: bar.update(task, completed=done, description=what)


def run(
    log: Annotated[
        Path,
        typer.Argument(
            help="A cube's CSV, a folder with imu.csv and gnss.csv, or an attitude log."
        ),
    ],
    attitude: Annotated[
        bool, typer.Option("--attitude", help="Estimate and score attitude only.")
    ] = False,
    layout: Annotated[
        str, typer.Option(help="Cube logs: name of a layout, or its TOML file.")
    ] = "cube",
    half_side: Annotated[
        float, typer.Option(min=0.001, max=10.0, help="Cube logs: centre to face, m.")
    ] = 0.05,
    lsb_mg: Annotated[
        float | None, typer.Option(min=1e-6, max=1e6, help="Cube logs in counts: mg per count.")
    ] = None,
    card: Annotated[Path | None, typer.Option(help="Cube logs: calibration file to apply.")] = None,
    tacho_aid: Annotated[
        bool,
        typer.Option(
            "--tacho-aid", help="Cube logs: correct by the log's tachometer; not scored against it."
        ),
    ] = False,
    resolve: Annotated[
        bool,
        typer.Option(
            "--resolve",
            help="Cube logs that begin while turning: correct what was before the sign was known.",
        ),
    ] = False,
    estimators: Filters = "",
    filters: Filters = "",
    imu: Annotated[
        str, typer.Option(help="Drives: file of inertial samples, in the folder or a path.")
    ] = "imu.csv",
    gnss: Annotated[str, typer.Option(help="Drives: file of GNSS epochs.")] = "gnss.csv",
    every: Annotated[
        int,
        typer.Option(
            min=1, max=1_000_000, help="Drives: give 1 of so many fixes, score on the others."
        ),
    ] = 1,
    outages: Annotated[
        str,
        typer.Option(
            help="Drives: starts and length of outages, s from the first fix, as 120,200:30."
        ),
    ] = "",
    truth: Annotated[
        Path | None, typer.Option(help="Drives: CSV of the true attitude and position.")
    ] = None,
    align_speed: Annotated[
        float,
        typer.Option(min=0.5, max=100.0, help="Drives: m/s above which the course is the heading."),
    ] = 4.0,
    align_standstill: Annotated[
        float, typer.Option(min=1.0, max=600.0, help="Drives: s of rest that level the unit.")
    ] = 10.0,
    units_as_named: UnitsAsNamed = False,
    plot: Plot = None,
    out: Annotated[
        Path | None,
        typer.Option(
            callback=output_file(".csv", ".parquet"),
            help="Write what every estimator said along the log to this .csv or .parquet file.",
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Run a log through the estimators and score them: a cube's, a drive's or an attitude log's.

    A cube's log has t_s and a11_counts ... a43_counts (or a11_mps2 ...), optionally tacho_rad_s and
    truth; a drive is a folder with inertial samples and GNSS epochs; an attitude log (--attitude)
    has specific force, rate and true quaternion. docs/logs.md describes the columns. Prints one
    table, or one JSON object with --json.
    """
    names = [name.strip() for name in (estimators or filters).split(",") if name.strip()] or None
    try:
        with progress_bar() as progress:
            if attitude:
                from logs.attitude import run_attitude

                result = run_attitude(
                    log,
                    filters=names,
                    plot=plot,
                    out=out,
                    units_as_named=units_as_named,
                    progress=progress,
                )
            elif log.is_dir():
                from inertial.navigation.standstill import AlignmentSettings
                from logs.drive import run_drive

                result = run_drive(
                    log,
                    imu=imu,
                    gnss=gnss,
                    every=every,
                    outages=parse_outages(outages),
                    filters=names,
                    truth=truth,
                    units_as_named=units_as_named,
                    alignment=AlignmentSettings(
                        standstill=align_standstill, course_speed=align_speed
                    ),
                    plot=plot,
                    out=out,
                    progress=progress,
                )
            else:
                from logs.cube import run_cube

                result = run_cube(
                    log,
                    layout=layout,
                    half_side_m=half_side,
                    lsb_mg=lsb_mg,
                    card=card,
                    estimators=names,
                    tacho_aid=tacho_aid,
                    resolve=resolve,
                    units_as_named=units_as_named,
                    plot=plot,
                    out=out,
                    progress=progress,
                )
    except (ValueError, OSError) as error:
        raise fail(error, EXIT_CONFIG) from None
    show(result, as_json)
    if not any(known(row) for row in result[kind_of(result)].values()):
        raise fail("no result: the notes above say why", EXIT_FAILED)


def parse_outages(text: str) -> list[tuple[float, float]]:
    """`120,200:30` -> [(120, 30), (200, 30)], s; raises ValueError with the form that is wanted."""
    if not text:
        return []
    starts, _, length = text.partition(":")
    try:
        found = [(float(start), float(length)) for start in starts.split(",")]
    except ValueError:
        found = []
    if not found or any(not start >= 0 or not 0 < seconds < 1e6 for start, seconds in found):
        raise ValueError(
            f"--outages {text!r}: want starts and one length in s, like 120,200,280:30"
        )
    return found


Out = Annotated[
    Path,
    typer.Option(
        callback=output_folder(),
        help="Folder for pictures, tables and index.html; made when absent.",
    ),
]


@app.command("gyro-free")
def gyro_free(
    out: Out = Path("var/reproduce/gyro-free"),
    session: Annotated[
        Path | None, typer.Option(help="CSV of a recorded run; default: a simulated one.")
    ] = None,
    seed: Annotated[
        int, typer.Option(min=0, max=LARGEST_SEED, help="Seed of the simulated run.")
    ] = 1,
    as_json: AsJson = False,
) -> None:
    """Every figure and table of the gyro-free cube's published table test, each beside ours."""
    from logs.reproduce.gyro_free import reproduce

    _reproduce(
        lambda progress: reproduce(out, session=session, seed=seed, progress=progress), out, as_json
    )


@app.command("in-motion")
def in_motion(
    out: Out = Path("var/reproduce/in-motion"),
    data: Annotated[
        Path | None, typer.Option(help="Folder with imu.csv and gnss.csv of a real drive.")
    ] = None,
    seeds: Annotated[
        int, typer.Option(min=1, max=1000, help="Simulated drives per condition.")
    ] = 3,
    as_json: AsJson = False,
) -> None:
    """Tables and horizon figures of the in-motion alignment, from simulated drives and a real
    one.
    """
    from logs.reproduce.in_motion_comparison import reproduce

    _reproduce(
        lambda progress: reproduce(out, data=data, seeds=seeds, progress=progress), out, as_json
    )


def _reproduce(work: Callable[[Report], dict[str, Any]], out: Path, as_json: bool) -> None:
    try:
        with progress_bar() as progress:
            result = work(progress)
    except (ValueError, OSError) as error:
        raise fail(error, EXIT_CONFIG) from None
    if as_json:
        say(json.dumps(result, indent=2))
    else:
        say(f"written to {out}; open {out / 'index.html'}")
