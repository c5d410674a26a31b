"""The offset of another machine's clock: within its bound, however lopsided the way is."""

from hypothesis import given
from hypothesis import strategies as st

from messages.offset import DRIFT, OLD_NS, WINDOW, Exchange, Offset

S = 10**9
ways = st.integers(0, 3 * S)
questions = st.lists(
    st.tuples(
        st.integers(1, 20 * S), ways, st.integers(0, S), ways, st.integers(-(10**18), 10**18)
    ),
    min_size=1,
    max_size=20,
)


def other(ours: int, ahead: int, drift_ppm: int) -> int:
    """Elapsed time of the other machine at one of ours."""
    return ahead + ours + ours * drift_ppm // 1_000_000


@given(ahead=st.integers(0, 10**17), drift=st.integers(-990, 990), asked=questions)
def test_the_truth_is_within_the_bound_however_lopsided_the_way(ahead, drift, asked):
    """Random ways there and back, drifting clocks, a wall clock that is set at every answer."""
    offset, now = Offset(), 0
    for pause, there, busy, back, wall in asked:
        t1 = now + pause
        t2, t3, t4 = t1 + there, t1 + there + busy, t1 + there + busy + back
        offset.take(Exchange(t1, other(t2, ahead, drift), other(t3, ahead, drift), t4, wall))
        now = t4
        best = offset.at(now)
        truth = other(now, ahead, drift) + wall - now
        assert abs(best.theta_ns - truth) <= best.bound_ns
    assert offset.refused == offset.anew == 0


@given(fast=st.integers(1, 10**8), slow=st.integers(1, 10**9))
def test_the_quick_answer_counts_and_not_the_newest(fast, slow):
    offset = Offset()
    offset.take(Exchange(0, 7 * S + fast, 7 * S + fast, 2 * fast))
    t1 = 2 * fast
    far = fast + 2 * slow + S
    offset.take(Exchange(t1, 7 * S + t1 + far, 7 * S + t1 + far, t1 + far))
    assert offset.at(t1 + far).bound_ns <= fast + DRIFT * (far + 2 * fast) + 3


def test_answers_that_no_pair_of_clocks_can_give_are_counted_and_say_nothing():
    offset = Offset()
    for impossible in (Exchange(5, 0, 0, 4), Exchange(0, 5, 4, 9), Exchange(0, 0, 1000, 50)):
        offset.take(impossible)
    assert offset.refused == 3 and offset.at(0) is None


def test_another_machine_that_answers_is_believed_at_once():
    offset = Offset()
    for k in range(WINDOW):
        offset.take(Exchange(k * S, 100 * S + k * S, 100 * S + k * S, k * S + 2000))
    t1 = WINDOW * S
    offset.take(Exchange(t1, 5 * S + t1, 5 * S + t1, t1 + 10**8))
    best = offset.at(t1 + 10**8)
    assert offset.anew == 1 and abs(best.theta_ns - 5 * S) <= best.bound_ns


def test_what_is_old_is_not_known_any_more():
    offset = Offset()
    assert offset.at(0) is None
    offset.take(Exchange(0, 0, 0, 1000))
    assert offset.at(OLD_NS + 1000) is not None and offset.at(OLD_NS + 1001) is None


def test_an_answer_that_comes_while_another_thread_asks_disturbs_nobody():
    offset = Offset()

    class Interrupting(Exchange):
        """While it is looked at, another answer comes: what a second thread does now and then."""

        @property
        def measured(self):
            offset._kept.append(Exchange(20, 20, 20, 20))
            return super().measured

    offset._kept.append(Interrupting(10, 10, 10, 10))
    assert offset.at(30).theta_ns == 0
