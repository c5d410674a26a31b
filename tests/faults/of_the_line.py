"""Faults of the line and of the board at its other end."""

import time

from faults.account import Account
from faults.bench import Bench
from faults.board import PERIOD_S, garbage
from faults.scenario import Alarmed, Certified, Line, Loss, Scenario, Status

OUT_S = 2.0  # unplugged, or silent
MEGABYTE = 1 << 20
JUST = round(OUT_S / PERIOD_S)


def unplug(bench: Bench) -> None:
    """The port goes, and comes again as another one."""
    bench.board.cable.unplug()
    time.sleep(OUT_S)
    bench.board.cable.plug()


def babble(bench: Bench) -> None:
    """A megabyte of noise between two frames, and the frames behind it."""
    bench.board.cable.babble(garbage(MEGABYTE))


def half_a_frame(bench: Bench) -> None:
    """Of one frame the first half; then nothing for a while."""
    bench.board.cable.cut_a_frame()
    time.sleep(2 * PERIOD_S)
    bench.board.cable.mute(True)
    time.sleep(OUT_S)
    bench.board.cable.mute(False)


def reset(bench: Bench) -> None:
    """Off and on again."""
    bench.board.off()
    bench.board.boot()


def said(counted: Account) -> bool:
    return 0 < counted.missing == counted.said_missing


MISSING = Certified("`missing_samples` of the certificate", said)

LINE = (
    Scenario(
        "board unplugged for 2 s",
        "its pseudo-terminal is closed and another one takes its name after 2 s",
        unplug,
        Loss("what the board says meanwhile", (JUST // 2, 3 * JUST), complete=False),
        (Alarmed("link"), Line("open", r"/board: open"), MISSING),
        quick=True,
    ),
    Scenario(
        "1 MB of garbage",
        "random bytes between two frames, as fast as the line takes them",
        babble,
        said=(
            Status("`bad_bytes` of the link", "links", lambda link: link.bad_bytes > MEGABYTE // 2),
        ),
        quick=True,
    ),
    Scenario(
        "half a frame, then silence",
        "the second half of one frame is not sent, then nothing for 2 s",
        half_a_frame,
        Loss("that frame and what the board says meanwhile", (JUST // 2, 3 * JUST), complete=False),
        (Status("`bad_chunks` of the link", "links", lambda link: link.bad_chunks > 0), MISSING),
    ),
    Scenario(
        "board reset",
        "switched off and on in mid-session",
        reset,
        Loss(boots=2),
        (Status("`reboots` of the link", "links", lambda link: link.reboots > 0),),
        quick=True,
    ),
)
