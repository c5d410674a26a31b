"""Two gateways of one name that were both heard while the link between them was cut: their times
never interleave, and one that merely follows another loses nothing.
"""

from hypothesis import assume, given
from hypothesis import strategies as st

from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import ACCEL
from messages.history.mending import Mender
from messages.history.mending_state import SPLIT_NS, Arrival, header_of

S, STEP = 10**9, 10**8
T0 = 1_700_000_000 * S


def payload(run: int, sequence: int) -> bytes:
    """Ten a second from the beginning of its run."""
    header = pb.Header(device="cube", run=run, sequence=sequence, utc_ns=run + sequence * STEP)
    return pb.AccelBatch(header=header).SerializeToString()


def heard(mender: Mender, run: int, sequence: int, late_ns: int = 0, set_ns: int = 0) -> list:
    """Live, with a delay; set_ns: what our own clock differs from theirs."""
    at_ns = run + sequence * STEP + late_ns + set_ns
    return mender.take(Arrival(ACCEL, "cube", "", payload(run, sequence), at_ns))


def told(mender: Mender, questions: list, run: int, last: int) -> list:
    """The publisher's answer: all that it has of a run."""
    items = [
        pb.HistoryItem(
            topic="accel", run=run, sequence=k, payload=payload(run, k), published_ns=run + k * STEP
        )
        for k in range(1, last + 1)
    ]
    return mender.answer(questions.pop(), pb.HistoryReply(items=items))


@given(
    first=st.integers(30, 80),
    before=st.integers(1, 28),
    after=st.integers(0, 20),
    hold=st.booleans(),
)
def test_the_time_that_was_heard_of_one_is_not_filled_with_the_other(first, before, after, hold):
    """The second began `before` steps after the first, which was heard `first` steps long."""
    assume(before != after)  # it would count on where the other ended
    other, questions, refused = T0 + before * STEP, [], []
    mender = Mender(questions.append, hold=hold, refuse=lambda *why: refused.append(why))
    got = [one for k in range(1, first + 1) for one in heard(mender, T0, k)]
    live = first - before + after + 1
    got += heard(mender, other, live)
    split = (first - before) * STEP > SPLIT_NS
    got += told(mender, questions, other, live - 1)
    times = [header_of(one).utc_ns for one in got if hold or not one.late]
    if split:
        assert times == sorted(times) and len(refused) == first - before - 1
        assert {why.kind for _, why, _ in refused} == {"twin"}
        late = [header_of(one).utc_ns for one in got if one.late]
        assert all(at >= T0 + first * STEP for at in late) and len(late) == after + 1
    else:
        assert not refused


@given(
    length=st.integers(1, 60),
    pause=st.integers(0, 30),
    missed=st.integers(0, 60),
    lates=st.tuples(st.integers(0, S), st.integers(0, S)),
    set_ns=st.integers(-(10**17), 10**17),
)
def test_one_that_follows_another_is_filled_in_whole(length, pause, missed, lates, set_ns):
    """Whatever was missed of it, however late the one and the other came, and by any clock."""
    assume(missed + 1 != length)  # likewise
    questions, refused = [], []
    mender = Mender(questions.append, refuse=lambda *why: refused.append(why))
    got = [one for k in range(1, length + 1) for one in heard(mender, T0, k, lates[0], set_ns)]
    run, live = T0 + (length + pause) * STEP, missed + 2
    got += heard(mender, run, live, lates[1], set_ns)
    got += told(mender, questions, run, live - 1)
    assert not refused
    assert [header_of(one).sequence for one in got] == [
        *range(1, length + 1),
        *range(1, live + 1),
    ]


def test_a_clock_that_was_set_back_makes_no_twin_of_a_gateway_that_began_anew():
    questions, refused = [], []
    mender = Mender(questions.append, refuse=lambda *why: refused.append(why))
    got = [one for k in range(1, 101) for one in heard(mender, T0, k)]
    run, hour = T0 - 3600 * S + 200 * STEP, 3600 * S  # run numbers may go back with the clock
    for k in range(1, 4):
        at_ns = run + hour + k * STEP
        got += mender.take(Arrival(ACCEL, "cube", "", payload(run, k), at_ns))
    assert not refused and len(got) == 103
