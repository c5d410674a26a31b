"""`gyrofree sessions compare`: up to four recordings over one another on one axis of time."""

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

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
from gyrofree.commands.parser import output_file
from gyrofree.commands.run import progress_bar
from gyrofree.running.process import EXIT_CONFIG, fail

if TYPE_CHECKING:
    from sessions.library.compare import Comparison


def compare(
    sessions: Annotated[
        list[str],
        typer.Argument(
            help="Two to four sessions: ids, or paths of MCAP files. The first stays where it is."
        ),
    ],
    align: Annotated[
        str,
        typer.Option(
            help=(
                "How the others are moved: auto, clock (one run of one gateway), tacho, rate"
                " (correlation of the "
                "tachometer, or of |omega|), start (not at all)."
            )
        ),
    ] = "auto",
    offset: Annotated[
        list[str] | None,
        typer.Option(
            help=(
                "ID=S: this session's time + S is the first one's; instead of finding it. May be"
                " repeated."
            )
        ),
    ] = None,
    estimator: Annotated[
        str, typer.Option(help="Whose rate stands for a session; default the first by name.")
    ] = "",
    plot: Annotated[
        Path | None,
        typer.Option(
            callback=output_file(".png"),
            help="Draw all of it to this PNG file.",
        ),
    ] = None,
    as_json: AsJson = False,
    config: Config = None,
) -> None:
    """Lay sessions over one another: offsets, how sure they are, and the RMS difference of every
    component.

    Works for sessions of different length and with gaps, and for a session beside its own
    re-estimation (`gyrofree rerun`). Quality `ambiguous` means that another offset fits as well, as
    with repeated motion: then give --offset.
    """
    from sessions.library.compare import CompareError, as_dict
    from sessions.library.compare import compare as lay_over
    from sessions.library.curves_build import ensure

    settings = settings_of(config)
    paths = [file_of(settings, session) for session in sessions]
    try:
        if not 2 <= len(paths) <= 4:
            raise CompareError(
                f"{len(paths)} session{'' if len(paths) == 1 else 's'}: want two to four"
            )
        with progress_bar() as progress:
            found = []
            for k, path in enumerate(paths):
                found.append(
                    ensure(
                        path,
                        lambda done, k=k, path=path: progress(
                            (k + done) / len(paths), f"reading {path.parent.name}"
                        ),
                    )
                )
        result = lay_over(found, align, offsets_of(offset or []), estimator)
        if plot is not None:
            from sessions.library.compare_figure import draw

            draw(result, plot)
    except (ValueError, OSError) as error:
        raise fail(error, EXIT_CONFIG) from None
    if as_json:
        say(json.dumps(as_dict(result), indent=2))
    else:
        show(result)


def offsets_of(texts: list[str]) -> dict[str, float]:
    """`ID=S` -> {ID: s}; raises ValueError."""
    found = {}
    for text in texts:
        session, _, seconds = text.rpartition("=")
        try:
            found[session] = float(seconds)
        except ValueError:
            session = ""
        if not session or not math.isfinite(found.get(session, 0.0)):
            raise ValueError(f"--offset {text!r}: want ID=SECONDS, like 20260131-120000=-2.5")
    return found


def show(result: "Comparison") -> None:
    """For people: °/s."""
    _show_offsets(result)
    _show_differences(result)
    if result.tracks:
        _show_tracks(result)
    for one in result.sessions:
        for text in one.curves.said:
            say(f"note: {one.curves.session}: {text}")


def _show_offsets(result: "Comparison") -> None:
    table = Table(
        Column("session", no_wrap=True),
        "offset, s",
        "by",
        "quality",
        "r",
        "in common",
        "other offset",
    )
    for one in result.sessions:
        shift = one.shift
        rival = "-"
        if shift is not None and shift.rival_s is not None:
            rival = f"{shift.rival_s:.2f} s, r {shift.rival_correlation:.3f}"
        table.add_row(
            one.curves.session,
            f"{one.offset_s:+.4f}",
            one.by,
            one.quality,
            f"{shift.correlation:.4f}" if shift else "-",
            f"{shift.overlap_s:.1f} s" if shift else "-",
            rival,
        )
    show_table(table)


def _show_differences(result: "Comparison") -> None:
    table = Table(
        Column("session", no_wrap=True),
        "line",
        "against",
        "x, °/s",
        "y, °/s",
        "z, °/s",
        "over",
        title="RMS difference",
    )
    for d in result.differences:
        cells = (f"{math.degrees(d.rms[name]):.4g}" if name in d.rms else "-" for name in "xyz")
        table.add_row(d.session, d.line, d.against, *cells, f"{d.seconds:.1f} s")
    show_table(table)


def _show_tracks(result: "Comparison") -> None:
    table = Table(
        Column("session", no_wrap=True),
        "track",
        "north, m",
        "east, m",
        "down, m",
        "over",
        title="RMS difference of tracks",
    )
    for t in result.tracks:
        table.add_row(
            t.session,
            t.track,
            *("–" if part is None else f"{part:.4g}" for part in t.rms_ned_m),
            f"{t.seconds:.1f} s",
        )
    show_table(table)
