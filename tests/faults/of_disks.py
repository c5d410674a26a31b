"""Faults of disks and of the clock."""

import shutil
import time

from faults.bench import Bench
from faults.disk import Device, Disk
from faults.scenario import Alarmed, Line, Loss, Scenario, Status

FULL_S = 3.0
SLOW_S = 2.0  # of each fsync
HANG_S = 4.0
HOUR_S = 3600.0
STEP_S = 2.5  # that a clock is left as it was set


def no_room(bench: Bench) -> str:
    """Why no disk can be filled here."""
    return "" if bench.sessions.small else "no small disk can be mounted here: not root"


def full(disk: Disk) -> None:
    """To the last byte for a while."""
    disk.fill()
    time.sleep(FULL_S)
    disk.free()


def read_only(disk: Device) -> None:
    """The kernel finds an error on it; a person unmounts, checks and mounts it again."""
    disk.fail()
    time.sleep(FULL_S)
    disk.replace()


def hangs(disk: Device) -> None:
    """Who writes on it waits."""
    disk.hang(True)
    time.sleep(HANG_S)
    disk.hang(False)


def deleted(bench: Bench) -> None:
    """Somebody tidies up."""
    shutil.rmtree(bench.sessions.path / bench.watch.newest("status").session)
    bench.hear("recorder")


def slow(bench: Bench) -> None:
    """Each fsync takes seconds, until that is said."""
    bench.sync.set(SLOW_S)
    time.sleep(3 * SLOW_S)
    bench.hear("link-said", "recorder")
    bench.sync.set(0.0)


def clock(bench: Bench, seconds: float) -> None:
    """The wall clock is set, and set right again."""
    bench.wall.set(seconds)
    time.sleep(STEP_S)
    bench.wall.set(0.0)


def steps(state) -> bool:
    return state.clock_steps > 0


READ_ONLY = Status(
    "`message` of the recorder", "states", lambda state: "Read-only" in state.message
)
DISKS = (
    Scenario(
        "disk of the recordings full",
        "to the last byte for 3 s, in mid-session",
        lambda bench: full(bench.sessions),
        said=(
            Alarmed("recorder"),
            Status("`message` of the recorder", "states", lambda state: "full" in state.message),
        ),
        quick=True,
        needs=no_room,
    ),
    Scenario(
        "disk of the journals full",
        "of gateway and estimator, to the last byte for 3 s",
        lambda bench: full(bench.journals),
        said=(Alarmed("link-said"),),
        needs=no_room,
    ),
    Scenario(
        "slow disk",
        "each `fsync` takes 2 s longer, for 6 s and until that is said",
        slow,
        said=(
            Alarmed("link-said"),
            Alarmed("recorder"),
            Status("`message` of the recorder", "states", lambda state: "slow" in state.message),
        ),
    ),
    Scenario(
        "disk of the recordings read-only",
        f"the kernel finds an error on it; unmounted, checked and mounted again after {FULL_S:g} s",
        lambda bench: read_only(bench.sessions),
        said=(Alarmed("recorder"), READ_ONLY, Line("its disk was mounted anew: beginning anew")),
        on="device",
    ),
    Scenario(
        "disk of the journals read-only",
        f"the kernel finds an error on it; unmounted, checked and mounted again after {FULL_S:g} s",
        lambda bench: read_only(bench.journals),
        said=(Alarmed("link-said"), Line("data are shown but NOT KEPT"), Line("writable again")),
        on="device",
    ),
    Scenario(
        "disk of the recordings hangs",
        f"who writes waits, for {HANG_S:g} s",
        lambda bench: hangs(bench.sessions),
        on="device",
    ),
    Scenario(
        "disk of the journals hangs",
        f"who writes waits, for {HANG_S:g} s",
        lambda bench: hangs(bench.journals),
        Loss("what the line's buffer does not hold meanwhile", (0, 300), complete=None),
        (Alarmed("link"), Status("`stops` of the link", "links", lambda link: link.stops > 0)),
        on="device",
    ),
    Scenario(
        "recording deleted",
        "`rm -r` of its folder while it is written",
        deleted,
        Loss("what it held; another recording goes on", gone=1),
        (Alarmed("recorder"), Line("was deleted or moved: what it held is not here any more")),
    ),
    Scenario(
        "clock set back by an hour",
        "the wall clock of all processes, and right again after 2.5 s",
        lambda bench: clock(bench, -HOUR_S),
        said=(
            Alarmed("clock"),
            Status("`clock_steps` of the recorder", "states", steps),
        ),
    ),
    Scenario(
        "clock set forward by an hour",
        "the wall clock of all processes, and right again after 2.5 s",
        lambda bench: clock(bench, HOUR_S),
        said=(
            Alarmed("clock"),
            Status("`clock_steps` of the recorder", "states", steps),
        ),
    ),
)
