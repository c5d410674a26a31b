"""Alarms: hysteresis and states for any sequence of values, gaps, orders and restarts."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dashboard.alarms.book import Book, NoSuchAlarm
from dashboard.alarms.judge import Answer, Bounds, Judge
from dashboard.alarms.machine import Cause, Now, State
from dashboard.alarms.notices import EACH_S, Teller
from dashboard.alarms.settings import LimitSettings
from dashboard.alarms.state_file import load, save

ABOVE, BAND = 10.0, 2.0
VALUES = st.lists(
    st.one_of(st.floats(0.0, 20.0), st.sampled_from([ABOVE, ABOVE - BAND, math.nan, math.inf])),
    min_size=1,
    max_size=60,
)


def naive(t, y, bounds):
    """The rule of a limit said once more, sample by sample, without a shortcut."""
    answers, active, since, last = [], False, None, -math.inf
    for at, value in zip(t, y, strict=True):
        if at - last > bounds.gap_s:
            since = None
        last = at
        if not math.isfinite(value):
            since = None
            answers.append(Answer.UNKNOWN)
            continue
        turns = value <= bounds.above - bounds.dead_band if active else value > bounds.above
        since = (at if since is None else since) if turns else None
        wait = bounds.off_delay_s if active else bounds.on_delay_s
        if turns and at - since >= wait:
            active, since = not active, None
        answers.append(Answer.BEYOND if active else Answer.OK)
    return answers


def answers_of(judge, t, y, cuts):
    """The answer after every piece, and all turns."""
    turns, ends = [], []
    for k in range(len(cuts) - 1):
        piece = slice(cuts[k], cuts[k + 1])
        turns += judge.take(t[piece], y[piece])
        ends.append(judge.answer)
    return turns, ends


@settings(max_examples=150, deadline=None)
@given(
    VALUES,
    st.lists(st.sampled_from([0.1, 0.3, 5.0]), min_size=60, max_size=60),
    st.sampled_from([0.0, 0.25, 1.0]),
    st.sampled_from([0.0, 0.25, 1.0]),
    st.data(),
)
def test_a_limit_is_judged_the_same_however_its_samples_come(values, steps, on, off, data):
    y, t = np.array(values), np.cumsum(steps)[: len(values)]
    bounds = Bounds(above=ABOVE, dead_band=BAND, on_delay_s=on, off_delay_s=off)
    wanted = naive(t, y, bounds)
    cuts = sorted(data.draw(st.sets(st.integers(1, len(y)), max_size=8)) | {0, len(y)})
    turns, ends = answers_of(Judge(bounds), t, y, cuts)
    assert ends == [wanted[cut - 1] for cut in cuts[1:]]
    # no turn is lost and none invented: they are the changes of the answer, at their moments
    said = [Answer.UNKNOWN, *wanted]
    changes = [(t[k], said[k + 1]) for k in range(len(wanted)) if said[k + 1] is not said[k]]
    assert [(turn.t, turn.answer) for turn in turns] == changes


@settings(max_examples=100, deadline=None)
@given(st.lists(st.floats(ABOVE - BAND + 1e-9, ABOVE), min_size=2, max_size=80), st.booleans())
def test_inside_the_dead_band_the_answer_never_changes(values, began):
    judge = Judge(Bounds(above=ABOVE, dead_band=BAND))
    judge.take(np.array([0.0]), np.array([ABOVE + 1.0 if began else 0.0]))
    before = judge.answer
    assert judge.take(0.1 * np.arange(1, len(values) + 1), np.array(values)) == []
    assert judge.answer is before


def test_what_was_beyond_is_not_over_because_nothing_is_known():
    judge = Judge(Bounds(above=ABOVE))
    judge.take(np.array([0.0]), np.array([11.0]))
    assert [turn.answer for turn in judge.forget()] == [Answer.UNKNOWN] and judge.active
    assert [turn.answer for turn in judge.take(np.array([9.0]), np.array([12.0]))] == [
        Answer.BEYOND
    ]


def test_a_delay_is_not_counted_across_a_gap():
    judge = Judge(Bounds(above=ABOVE, on_delay_s=2.0, gap_s=1.0))
    judge.take(np.array([0.0, 0.5]), np.array([11.0, 11.0]))
    judge.take(np.array([30.0, 30.5]), np.array([11.0, 11.0]))
    assert judge.answer is Answer.OK
    judge.take(np.array([31.0, 32.0]), np.array([11.0, 11.0]))
    assert judge.answer is Answer.BEYOND


def test_a_limit_that_could_never_end_is_refused():
    with pytest.raises(ValueError, match="dead band"):
        LimitSettings(name="x", field="omega_z", above=1.0, below=-1.0, dead_band=1.0)
    with pytest.raises(ValueError, match="above, below or both"):
        LimitSettings(name="x", field="omega_z")
    with pytest.raises(ValueError):
        LimitSettings(name="x", field="omega_z", above=math.nan)


# --- states

CAUSE = Cause("axis", "axis a21 stuck", "reads the same again and again", "warning", "health")
ACTS = st.sampled_from(
    ["found", "found", "gone", "gone", "unknown", "acknowledge", "shelve", "unshelve", "wait"]
    + ["restart"]
)


class Model:
    """What a person would say of one alarm: three facts, and the rules in words."""

    def __init__(self):
        self.there = self.owed = False
        self.shelf = 0.0
        self.raised = 0

    @property
    def state(self):
        if self.shelf:
            return State.SHELVED
        if self.there:
            return State.UNACKNOWLEDGED if self.owed else State.ACKNOWLEDGED
        return State.RETURNED if self.owed else State.NORMAL

    def pass_(self, now):
        if self.shelf and now >= self.shelf:
            self.shelf = 0.0
            self.owed = self.owed or self.there

    def do(self, act, now):
        if act == "found" and not self.there:
            self.there = self.owed = True
            self.raised += 1
        elif act == "gone":
            self.there = False
        elif act == "acknowledge" and self.raised:
            self.owed = False
        elif act == "shelve" and self.raised:
            self.shelf = now + 30.0
        elif act == "unshelve" and self.shelf:
            self.shelf, self.owed = 0.0, self.owed or self.there


def do(book, act, now, path):
    try:
        match act:
            case "found":
                book.found("cube", "axis-a21", CAUSE, now)
            case "gone":
                book.gone("cube", "axis-a21", now)
            case "unknown":
                book.unknown("cube", "axis-a21")
            case "acknowledge":
                book.acknowledge("cube", "axis-a21", "anna", "seen", now)
            case "shelve":
                book.shelve("cube", "axis-a21", "anna", "known", 30.0, now)
            case "unshelve":
                book.unshelve("cube", "axis-a21", "anna", now)
            case "restart":
                save(path, book, [], {})
                again, _, _, trouble = load(path)
                assert not trouble
                return again
    except NoSuchAlarm:
        pass
    return book


@settings(max_examples=80, deadline=None)
@given(st.lists(st.tuples(ACTS, st.sampled_from([0.0, 1.0, 20.0])), max_size=40))
def test_no_alarm_is_lost_or_invented(tmp_path_factory, acts):
    """Against a model of three facts: state after every act, and every beginning in the history."""
    path = tmp_path_factory.mktemp("state") / "alarms.json"
    book, model, s = Book(), Model(), 1000.0
    for act, passes in acts:
        s += passes
        now = Now(s, int(s * 1e9))
        book.tick(now)
        model.pass_(s)
        model.do(act, s)
        book = do(book, act, now, path)
        point = book.points.get(("cube", "axis-a21"))
        if act == "restart" and model.shelf and abs(model.shelf - s) < 1.0:
            return  # the time between writing and reading decides: both are right
        assert (State.NORMAL if point is None else point.state) is model.state
        assert point is None or point.active == model.there
        assert (point is not None) or not model.raised
    raised = [event for event in book.history if event.what == "raised"]
    assert len(raised) == model.raised


def test_a_damaged_state_is_put_aside_and_said(tmp_path):
    path = tmp_path / "alarms.json"
    path.write_text('{"format": 1, "points": [{"id"')
    book, limits, _, trouble = load(path)
    assert not book.points and not limits and "cannot be read" in trouble
    assert (tmp_path / "alarms.json.damaged").exists()


def test_of_several_the_first_is_marked_and_one_that_comes_and_goes_chatters():
    book = Book()
    book.found("cube", "link", CAUSE, Now(0.0, 1))
    book.found("cube", "axis-a21", CAUSE, Now(1.0, 2))
    assert book.points["cube", "link"].first_out
    assert not book.points["cube", "axis-a21"].first_out
    for k in range(4):
        book.gone("cube", "axis-a21", Now(2.0 + 4 * k, 3))
        book.found("cube", "axis-a21", CAUSE, Now(4.0 + 4 * k, 4))
    assert book.points["cube", "axis-a21"].chattering
    assert book.points["cube", "axis-a21"].times == 5


@settings(max_examples=50, deadline=None)
@given(st.lists(st.floats(0.1, 40.0), min_size=1, max_size=60))
def test_a_flood_is_one_notice_of_an_alarm_in_a_minute_and_none_is_forgotten(pauses):
    book, said, s = Book(), [], 0.0
    teller = Teller(lambda notice: said.append((s, notice)))
    for pause in pauses:
        s += pause
        now = Now(s, int(s * 1e9) + 1)
        book.tell = lambda point, now=now: teller.tell(point, now)
        book.found("cube", "x", CAUSE, now)
        book.gone("cube", "x", now)
        teller.tick(book.points, now)
    s += EACH_S
    teller.tick(book.points, Now(s, int(s * 1e9)))
    times = [at for at, _ in said]
    assert all(b - a >= EACH_S for a, b in zip(times, times[1:], strict=False))
    assert sum(notice.more for _, notice in said) + len(said) >= len(pauses)
