"""Faults between two places: of the link, and of who copies recordings over it."""

import itertools
import time
from dataclasses import replace

from support.far_link import FAR

from faults.far import LINE, FarBench
from faults.scenario import Alarmed, Line, Loss, Scenario

CUT_S = 10.0
BAD_S = 20.0  # that a link is lossy or slow
FLAPS, OFF_S, ON_S = 6, 1.0, 1.5
OFF_POWER_S = 5.0
FULL_S = 5.0
BALLAST = 5_000_000  # bytes; 5 s of the good link
NUMBERS = itertools.count(1)

SILENT = Line("recordings are not copied: the site's home does not answer")
OUT_OF_REACH = Alarmed("place-office")


def cut(bench: FarBench, seconds: float) -> None:
    """Nothing passes for so long."""
    bench.link.cut()
    time.sleep(seconds)
    bench.link.mend()


def flap(bench: FarBench) -> None:
    """It comes and goes."""
    for _ in range(FLAPS):
        cut(bench, OFF_S)
        time.sleep(ON_S)


def worse(bench: FarBench, **changes) -> None:
    """The link is another one for a while."""
    bench.link.line = replace(LINE, **changes)
    time.sleep(BAD_S)
    bench.link.line = LINE


class Copying:
    """A fault in the midst of a copy, which has to be equal in the end."""

    def __init__(self, fault) -> None:
        self._fault, self._session = fault, ""

    def act(self, bench: FarBench) -> None:
        """Have something copied, and do it."""
        self._session = bench.ballast(next(NUMBERS), BALLAST)
        bench.until(lambda: bench.begun(self._session), "copy on its way")
        assert not bench.equal(self._session), "the copy was quicker than the fault"
        self._fault(bench)

    def well(self, bench: FarBench) -> bool:
        """Is the copy there, and equal?"""
        return bench.equal(self._session)


def copying(name: str, fault: str, act, lost: Loss = Loss(), said=(), **more) -> Scenario:
    """A scenario in the midst of a copy."""
    made = Copying(act)
    what = f"{fault}, while a recording of {BALLAST / 1e6:g} MB is copied"
    return Scenario(name, what, made.act, lost, said, well=made.well, on="far", **more)


def full(bench: FarBench) -> None:
    """The office's disk, to the last byte for a while."""
    bench.sessions.fill()
    time.sleep(FULL_S)
    bench.sessions.free()


def no_room(bench: FarBench) -> str:
    """Why no disk can be filled here."""
    return "" if bench.sessions.small else "no small disk can be mounted here: not root"


def spoil(bench: FarBench) -> None:
    """A byte of what is there already is another one, and the copier is killed."""
    part = max(bench.sessions.path.glob("*/recording.mcap.part"), key=lambda p: p.stat().st_mtime)
    with part.open("r+b") as stream:
        stream.seek(1000)
        byte = stream.read(1)
        stream.seek(1000)
        stream.write(bytes([byte[0] ^ 0x40]))
    bench.kill("office", "site")


# Back within a second or two: whether its alarm comes first goes by the machine.
RESTARTED = Line("site ended by signal SIGKILL: starting it again")

LINK = (
    Scenario(
        "link between the places cut for 10 s",
        "nothing passes in either way",
        lambda bench: cut(bench, CUT_S),
        said=(OUT_OF_REACH, SILENT),
        on="far",
    ),
    Scenario(
        "link that comes and goes",
        f"{FLAPS} times {OFF_S:g} s away and {ON_S:g} s there",
        flap,
        on="far",
    ),
    Scenario(
        "link that loses packets",
        f"5 % of them each way, for {BAD_S:g} s",
        lambda bench: worse(bench, loss=0.05),
        on="far",
    ),
    Scenario(
        "link with a long way",
        f"200 ms there and back, for {BAD_S:g} s",
        lambda bench: worse(bench, delay_s=0.1),
        on="far",
    ),
    Scenario(
        "link that is long and loses much",
        f"20 % of packets each way and 200 ms there and back, for {BAD_S:g} s",
        lambda bench: worse(bench, delay_s=0.1, loss=0.2),
        on="far",
    ),
    Scenario(
        "link that is slow, lossy and long",
        f"1 Mbit/s, 5 % of packets lost, 200 ms, for {BAD_S:g} s",
        lambda bench: worse(bench, rate=FAR.rate, delay_s=FAR.delay_s, loss=FAR.loss),
        on="far",
    ),
    Scenario(
        "router of the office killed",
        "`kill -9`; `gyrofree up` starts it again",
        lambda bench: bench.kill("office", "router"),
        said=(Line("router ended by signal SIGKILL: starting it again"),),
        on="far",
    ),
    Scenario(
        "router of the lab killed",
        "`kill -9`; `gyrofree up` starts it again",
        lambda bench: bench.kill("lab", "router"),
        said=(Line("router ended by signal SIGKILL: starting it again"),),
        on="far",
    ),
    copying(
        "link cut during a copy",
        f"nothing passes for {CUT_S:g} s",
        lambda bench: cut(bench, CUT_S),
        said=(OUT_OF_REACH, SILENT),
    ),
    copying(
        "who serves copies killed",
        "`kill -9` of the lab's `site serve`",
        lambda bench: bench.kill("lab", "site"),
        said=(RESTARTED,),
    ),
    copying(
        "who copies killed",
        "`kill -9` of the office's `site serve`",
        lambda bench: bench.kill("office", "site"),
        said=(RESTARTED,),
    ),
    copying(
        "half a copy spoilt",
        "a bit of what is on the office's disk is turned and its `site serve` killed",
        spoil,
        said=(RESTARTED,),
    ),
    copying(
        "disk of the office full",
        f"to the last byte for {FULL_S:g} s",
        full,
        said=(
            Line(
                "recordings are not copied: ... No space left on device",
                "not copied: .*No space left",
            ),
        ),
        needs=no_room,
    ),
    copying(
        "office without power",
        f"`kill -9` of all its processes, which are started after {OFF_POWER_S:g} s",
        lambda bench: bench.power("office", OFF_POWER_S),
        said=(OUT_OF_REACH,),
    ),
)
