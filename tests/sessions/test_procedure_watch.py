"""The watch of a procedure: whatever the board does, a dwell that counts was what it says."""

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from inertial.constants import MILLI_G
from inertial.layouts.catalogue import CUBE
from sessions.procedure.model import DEG, FACES, Step
from sessions.procedure.seen import Axes, Line, Pulse, Samples
from sessions.procedure.watch import HOLE, State, Watch

PERIOD = 0.01
LAYOUT = CUBE(0.05)
STEP = Step("turn", "rate", 100.0 * DEG, 1.0, 2.0, 3.0 * DEG)


@dataclass(frozen=True)
class Piece:
    """Some time of a board's life."""

    seconds: float
    rate: float  # deg/s
    shaking: float = 0.0  # mg
    hole: float = 0.0  # s without samples before it
    reboot: bool = False
    unfit: bool = False


def life(pieces: list[Piece], seed: int = 1, up=(0.0, 0.0, 1.0)):
    """Samples (epoch, t, row) one by one, and what else is said, in the order of time."""
    draw, epoch, t, angle = np.random.default_rng(seed), 1, 0.0, 0.0
    for piece in pieces:
        t += piece.hole
        if piece.reboot:
            epoch, t = epoch + 1, 0.0
        said = ((3, "axis a21 is stuck"),) if piece.unfit else ()
        for k in range(round(piece.seconds / PERIOD)):
            t = round(t + PERIOD, 6)
            angle += piece.rate * PERIOD
            if abs(angle) >= 1.0:
                angle = 0.0
                yield Pulse(epoch, t, piece.rate * DEG, True)
            rest = 9.80665 * LAYOUT.theta_b @ np.asarray(up)
            noise = draw.normal(size=12) * (4.0 + piece.shaking) * MILLI_G
            utc_ns = 10**18 + epoch * 10**13 + round(t * 1e9)
            yield Samples(epoch, np.array([t]), (rest + noise)[None], utc_ns)
            if k % 10 == 0:
                yield Axes(epoch, t, said, LAYOUT.theta_b)


def batched(seen, size: int):
    """The same, samples joined into messages; all else is said before the message it falls in."""
    held: list[Samples] = []

    def joined():
        first = held[0]
        rows = np.concatenate([one.f_axis for one in held])
        made = Samples(first.epoch, np.concatenate([one.t for one in held]), rows, first.utc_ns)
        held.clear()
        return made

    for one in seen:
        if not isinstance(one, Samples):
            yield one
            continue
        new = bool(held) and (one.epoch != held[0].epoch or one.t[0] - held[-1].t[-1] > 0.011)
        if new or len(held) >= size:
            yield joined()
        held.append(one)
    if held:
        yield joined()


def watched(seen, step: Step = STEP, **options) -> Watch:
    watch = Watch(step, 0.5, 30.0 * MILLI_G, **options)
    for one in seen:
        watch.take(one)
    return watch


PIECES = st.lists(
    st.builds(
        Piece,
        seconds=st.sampled_from([0.3, 1.0, 2.0, 4.0]),
        rate=st.sampled_from([100.0, 101.5, 98.0, 100.0, 0.0, -100.0, 110.0, 60.0]),
        shaking=st.sampled_from([0.0, 0.0, 0.0, 100.0]),
        hole=st.sampled_from([0.0, 0.0, 0.0, 0.1, 0.6]),
        reboot=st.sampled_from([False, False, False, True]),
        unfit=st.sampled_from([False, False, False, True]),
    ),
    min_size=1,
    max_size=6,
)


def bad_stretches(pieces: list[Piece]):
    """(epoch, from, until) of everything that must not be inside a dwell that counts."""
    epoch, t = 1, 0.0
    for piece in pieces:
        if piece.hole > HOLE:
            yield epoch, t, t + piece.hole
        t += piece.hole
        if piece.reboot:
            epoch, t = epoch + 1, 0.0
        wrong = abs(piece.rate - 100.0) > 5.0 or piece.shaking or piece.unfit
        if wrong:
            yield epoch, t, t + piece.seconds
        t += piece.seconds


QUICK = (Phase.explicit, Phase.reuse, Phase.generate)  # a life is long to shrink


@settings(max_examples=60, deadline=None, phases=QUICK)
@given(PIECES)
def test_a_dwell_that_counts_was_what_the_step_wants(pieces):
    watch = watched(life(pieces))
    assert watch.over == (watch.state in (State.FULL, State.SPOILT))
    if watch.state is State.FULL:
        assert watch.until - watch.begin == pytest.approx(STEP.dwell_s)
        for epoch, begin, end in bad_stretches(pieces):
            # What begins less than a mean of pulses before the end is not in all of it yet.
            inside = min(end, watch.until - 0.35) - max(begin, watch.begin + 0.35)
            assert epoch != watch.epoch or inside <= 0.0, (pieces, watch.begin, watch.until)
    if watch.state is State.SPOILT:
        assert watch.reason


@settings(max_examples=25, deadline=None, phases=QUICK)
@given(PIECES, st.integers(2, 25))
def test_how_data_are_cut_into_messages_changes_nothing(pieces, size):
    one, many = watched(life(pieces)), watched(batched(life(pieces), size))
    # The last message of a shaken life may end between two looks.
    if one.over or many.over:
        assert (one.state, one.reason, one.begin, one.epoch) == (
            many.state,
            many.reason,
            many.begin,
            many.epoch,
        )


def test_the_way_of_a_good_step():
    watch, states = Watch(STEP, 0.5, 30.0 * MILLI_G), []
    pieces = [Piece(2.0, 0.0), Piece(1.0, 50.0), Piece(4.0, 100.0)]
    for one in life(pieces):
        watch.take(one)
        if not states or states[-1] is not watch.state:
            states.append(watch.state)
    assert states[-4:] == [State.RAMP, State.SETTLED, State.DWELL, State.FULL]
    assert watch.begin >= 3.5 and watch.utc_ns(watch.begin) == pytest.approx(
        10**18 + 10**13 + watch.begin * 1e9, abs=1000
    )


@pytest.mark.parametrize(
    ("last", "word"),
    [
        (Piece(1.0, 120.0), "wanted"),
        (Piece(1.0, 100.0, shaking=100.0), "vibration"),
        (Piece(1.0, 100.0, hole=0.6), "data lost"),
        (Piece(1.0, 100.0, reboot=True), "restarted"),
        (Piece(1.0, 100.0, unfit=True), "a21"),
    ],
)
def test_what_spoils_a_dwell_is_said(last, word):
    watch = watched(life([Piece(2.5, 100.0), last]))
    assert watch.state is State.SPOILT and word in watch.reason


def test_a_line_that_is_down_spoils_a_dwell_and_no_more():
    watch = watched(life([Piece(2.0, 100.0)]))
    assert watch.state is State.DWELL
    watch.take(Line(False, "cable out"))
    assert watch.state is State.SPOILT and "cable out" in watch.reason
    waiting = watched(life([Piece(2.0, 0.0)]))
    waiting.take(Line(False, "cable out"))
    assert waiting.state is State.WAITING


def test_the_wrong_way_round_is_said_so():
    watch = watched(life([Piece(2.0, -100.0)]))
    assert watch.state is State.RAMP and watch.reason.endswith("the other way round")


def test_a_driven_table_that_does_not_get_there_spoils_the_step():
    watch = watched(life([Piece(6.0, 50.0)]), patience_s=4.0)
    assert watch.state is State.SPOILT and "not there within 4 s" in watch.reason


def test_without_a_word_on_the_rate_nothing_begins():
    still = Step("still", "still", 0.0, 0.0, 1.0, 1.0 * DEG)
    watch = watched(life([Piece(3.0, 0.0)]), still)
    assert watch.state is State.WAITING and "not known" in watch.reason


def test_a_pose_is_told_by_gravity():
    step = Step("+x up", "pose", dwell_s=1.0, up_b=FACES["+x"])
    right = watched(life([Piece(3.0, 0.0)], up=(1.0, 0.0, 0.0)), step)
    wrong = watched(life([Piece(3.0, 0.0)], up=(0.0, 0.0, 1.0)), step)
    assert right.state is State.FULL
    assert wrong.state is State.WAITING and "90 deg off" in wrong.reason
