"""Faults in the middle of a run: what was measured with one does not count, the reason is kept, the
table stands where it lasts, and a run that ends as done was measured in one boot, recorded whole.
"""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import Phase, example, given, settings
from hypothesis import strategies as st
from support.procedures import start

from inertial.constants import MILLI_G
from inertial.layouts.catalogue import CUBE
from messages.contract import gyrofree_pb2 as pb
from messages.contract.checks import check
from sessions.procedure import conductor as conductors
from sessions.procedure import recorded
from sessions.procedure.conductor import Conductor
from sessions.procedure.model import DEG
from sessions.procedure.run import DONE, HELD, Journal, unfinished
from sessions.procedure.seen import Axes, Pulse, Samples, TableSays, Turned
from sessions.procedure.status import status_of

PERIOD, BATCH = 0.01, 10
LAYOUT = CUBE(0.05)
SESSION = "20260101-000000-x"
PLAN = """
title = "Turn"
repeats = 3
settle_s = 0.3
[[steps]]
kind = "still"
seconds = 1.0
[[steps]]
kind = "rate"
rate_dps = 90
ramp_s = 0.1
dwell_s = 2.0
tolerance_dps = 3
"""


class Turntable:
    """A table that obeys at once, and says what it was told."""

    name, limit = "a table", 20.0

    def __init__(self) -> None:
        self.omega, self.stops, self.stands = 0.0, 0, False

    def set_rate(self, omega: float, acceleration: float | None = None) -> None:
        self.omega = omega

    def rate(self) -> float:
        return self.omega

    def stop(self) -> None:
        self.omega, self.stops = 0.0, self.stops + 1

    def take(self) -> None:
        pass

    release = abandon = give_up = take


class Clock:
    """The monotonic one of the conductor and its parts; it goes with the board's."""

    def __init__(self, monkeypatch) -> None:
        self.now = 1000.0
        for module in (conductors, recorded):
            monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: self.now))


class Bench:
    """A run on a driven table, its board and its recorder; `seconds` lets time go on."""

    def __init__(self, folder: Path, monkeypatch, own: bool = True) -> None:
        self.clock, self.table = Clock(monkeypatch), Turntable()
        journal = Journal.begin(folder, start(toml=PLAN, own_session=own))
        journal.add("session", id=SESSION, was_recording=False)
        self.notes: list[str] = []
        self.records: list[bool] = []
        self.draw, self.epoch, self.t, self.angle = np.random.default_rng(1), 1, 0.0, 0.0
        self.tacho, self.shaking, self.unfit, self.samples = True, 0.0, "", True
        self.silence = ""
        self.recorder = pb.RecorderStatus(recording=True, session=SESSION)
        self.recorder.header.run, self.speaks = 7, True
        self.begin(journal)

    def begin(self, journal: Journal) -> None:
        self.one = Conductor(journal, self.table, self._say, self._record, lambda: self.silence)
        self.one.begin()

    def _say(self, text: str, *_) -> None:
        self.notes.append(text)

    def _record(self, on: bool) -> str:
        self.records.append(on)
        return ""

    def reboot(self) -> None:
        self.epoch, self.t = self.epoch + 1, 0.0

    def seconds(self, seconds: float) -> None:
        for _ in range(round(seconds / PERIOD / BATCH)):
            self.batch()

    def batch(self) -> None:
        """What BATCH samples' time brings."""
        omega = self.table.omega
        t = np.round(self.t + PERIOD * np.arange(1, BATCH + 1), 6)
        self.t, self.clock.now = float(t[-1]), self.clock.now + PERIOD * BATCH
        for at in t:
            self.angle += abs(omega) * PERIOD
            if self.angle >= DEG and self.tacho:
                self.angle = 0.0
                self.one.take(Pulse(self.epoch, float(at), omega, True))
        if self.samples:
            self._samples(t, omega)
        if self.speaks and round(self.clock.now * 10) % 10 == 0:
            self.one.recorded.take(pb.RecorderStatus.FromString(self.recorder.SerializeToString()))
        self.one.tick()

    def _samples(self, t: np.ndarray, omega: float) -> None:
        n, flags = len(t), np.ones(len(t), dtype=bool)
        rest = 9.80665 * LAYOUT.theta_b @ np.array([0.0, 0.0, 1.0])
        noise = self.draw.normal(size=(n, 12)) * (4.0 + self.shaking) * MILLI_G
        rates, still = np.full(n, omega), flags if omega == 0.0 else ~flags
        turned = Turned(
            self.epoch, "products-ekf", t, rates, 0.01 * flags, flags & ~still, still, False
        )
        self.one.take(turned)
        said = ((3, self.unfit),) if self.unfit else ()
        self.one.take(Axes(self.epoch, float(t[-1]), said, LAYOUT.theta_b))
        utc_ns = 10**18 + self.epoch * 10**13 + round(t[0] * 1e9)
        self.one.take(Samples(self.epoch, t, rest + noise, utc_ns))

    def until(self, wanted, seconds: float = 60.0) -> None:
        end = self.clock.now + seconds
        while not wanted():
            assert self.clock.now < end, (status_of(self.one), self.notes)
            self.batch()

    def into_dwell(self) -> None:
        """Half way into the dwell of the turning step."""
        self.until(lambda: self.one.run.at == 1 and self.one.watch.progress > 0.4)

    def trouble(self, k: int = 1) -> str:
        return " | ".join(self.one.run.steps[k].trouble)

    def ends(self) -> None:
        """The run goes to its end, is sound, and its messages may be sent."""
        self.until(lambda: self.one.run.closed)
        assert self.one.run.state == DONE and not check(status_of(self.one))
        assert len({step.window["epoch"] for step in self.one.run.steps}) == 1
        assert self.table.omega == 0.0 and self.records[-1] is False


@pytest.fixture
def bench(tmp_path, monkeypatch):
    return Bench(tmp_path, monkeypatch)


def test_a_recorder_that_began_a_new_life_spoils_a_dwell_and_is_followed(bench):
    bench.into_dwell()
    bench.recorder.header.run, bench.recorder.continues = 8, SESSION
    bench.recorder.session = "20260101-000010-x"
    bench.ends()
    run = bench.one.run
    assert run.steps[1].spoilt == 1 and run.steps[1].attempts == 2 and not run.steps[0].spoilt
    assert "recorder was cut off" in bench.trouble() and run.session == "20260101-000010-x"
    assert "recorder was cut off" in status_of(bench.one).steps[1].trouble[0]


FAULTS = {  # of the recorder: what it says, and what is said of it
    "full": ({"message": "no space left"}, "no space left"),
    "ended": ({"recording": False}, "was ended"),
    "another": ({"session": "20260101-000020-y"}, "session 20260101-000020-y was begun"),
    "silent": ({}, "has said nothing"),
}


@pytest.mark.parametrize("kind", FAULTS)
def test_where_nothing_is_recorded_the_table_stands_and_a_person_is_asked(bench, kind):
    bench.into_dwell()
    said, why = FAULTS[kind]
    before = bench.recorder.SerializeToString()
    for name, value in said.items():
        setattr(bench.recorder, name, value)
    bench.speaks = bool(said)
    if not bench.speaks:
        bench.one.recorded._heard -= 10.0  # the dwell is short
    bench.until(lambda: bench.one.run.state == HELD, 20.0)
    assert why in bench.trouble() and why in status_of(bench.one).message
    assert bench.table.omega == 0.0 and bench.one.run.steps[1].spoilt >= 1
    problem = bench.one.repeat("anna")
    if kind == "full":  # what waits in memory is not thrown away for a new recording
        assert "no space left" in problem and not bench.records
    else:
        assert not problem and bench.records == [True] * (kind != "silent")
    bench.recorder.ParseFromString(before)
    bench.speaks = True
    bench.seconds(1.5)
    bench.one.repeat("anna")
    bench.ends()


def test_samples_that_do_not_come_stop_the_table_and_the_reason_is_the_true_one(bench):
    bench.into_dwell()
    bench.samples, bench.silence = False, "the router is gone"
    bench.until(lambda: bench.one.run.state == HELD, 20.0)
    assert "no samples for 5 s: the router is gone" in bench.trouble()
    assert bench.table.omega == 0.0
    bench.samples = True
    assert not bench.one.repeat("anna")
    bench.ends()


def test_a_board_that_restarts_is_measured_anew_from_the_first_step(bench):
    bench.into_dwell()
    bench.reboot()
    bench.ends()
    assert "board has restarted" in bench.trouble() and "before the board" in bench.trouble(0)
    assert [step.attempts for step in bench.one.run.steps] == [2, 2]


def test_a_board_that_restarts_again_and_again_is_given_to_a_person(bench):
    for _ in range(4):
        bench.into_dwell()
        bench.reboot()
        bench.seconds(1.0)
    bench.until(lambda: bench.one.run.state == HELD)
    assert bench.table.omega == 0.0 and "board has restarted" in bench.one.run.message
    assert not bench.one.repeat("anna") and bench.one.run.at == 0
    bench.ends()


def test_a_tachometer_that_falls_silent_is_not_a_table_that_stands(bench):
    bench.into_dwell()
    bench.tacho = False
    bench.until(lambda: bench.one.run.steps[1].spoilt)
    assert "the tachometer is silent, the table says +90.0" in bench.trouble()
    bench.until(lambda: bench.one.run.state == HELD, 200.0)
    assert "tachometer is silent" in bench.one.run.message and bench.table.omega == 0.0


def test_a_standstill_is_not_taken_from_a_silent_tachometer_against_the_table(
    tmp_path, monkeypatch
):
    bench = Bench(tmp_path, monkeypatch)
    bench.into_dwell()
    bench.tacho = False
    watch = bench.one.watch.then(bench.one.run.plan.steps[0], 0.3, 1.0)
    for _ in range(100):
        bench.batch()
        watch.take(TableSays(bench.table.omega))
        assert watch.progress == 0.0
        bench.table.omega = 90.0 * DEG


def test_strong_vibration_and_an_unfit_axis_are_said(bench):
    bench.into_dwell()
    bench.shaking = 300.0
    bench.until(lambda: bench.one.run.steps[1].spoilt)
    bench.shaking = 0.0
    bench.into_dwell()
    bench.unfit = "axis a21 is stuck"
    bench.until(lambda: bench.one.run.steps[1].spoilt == 2)
    bench.unfit = ""
    bench.ends()
    assert "too much vibration" in bench.trouble() and "a21 is stuck" in bench.trouble()


def test_an_axis_that_is_named_soon_after_a_dwell_spoils_it(bench):
    bench.until(lambda: bench.one.run.at == 1)
    bench.unfit = "axis a21 is stuck"
    bench.seconds(0.5)
    assert bench.one.run.at == 0 and "a21 is stuck" in bench.trouble(0)
    bench.unfit = ""
    bench.ends()


def test_a_killed_service_says_what_it_spoilt_and_does_not_turn_for_ever(bench, tmp_path):
    for life in range(4):
        bench.into_dwell()
        bench.begin(unfinished(tmp_path)["cube"])
        assert bench.one.run.steps[1].spoilt == life + 1
    assert "procedures service was cut off" in bench.trouble()
    assert bench.one.run.state == HELD and bench.table.omega == 0.0


def test_the_end_waits_for_a_recorder_that_is_away(bench):
    bench.into_dwell()
    bench.until(lambda: bench.one.run.state == DONE)
    bench.speaks = False
    bench.one.recorded._heard = bench.clock.now - 10.0
    bench.seconds(8.0)
    assert not bench.one.run.closed and not bench.records
    bench.speaks = True
    bench.ends()


def test_a_recorder_that_does_not_come_back_is_said(bench):
    bench.into_dwell()
    bench.until(lambda: bench.one.run.state == DONE)
    bench.speaks = False
    bench.one.recorded._heard = bench.clock.now - 10.0
    bench.until(lambda: bench.one.run.closed, 100.0)
    assert "not in its recording" in status_of(bench.one).message


QUICK = (Phase.explicit, Phase.reuse, Phase.generate)
HAPPENS = st.lists(
    st.tuples(
        st.sampled_from(["", "reboot", "shake", "unfit", "recorder", "tacho", "dark", "service"]),
        st.sampled_from([0.3, 0.9, 1.7, 3.1]),
    ),
    min_size=1,
    max_size=5,
)


@settings(max_examples=30, deadline=None, phases=QUICK)
@given(HAPPENS)
@example([("", 1.7), ("unfit", 0.3), ("reboot", 0.9), ("reboot", 1.7), ("tacho", 0.9)])
def test_whatever_happens_a_run_that_is_done_was_measured_well(tmp_path_factory, happens):
    """No window of a step that counts touches a fault, and all are of one boot."""
    with pytest.MonkeyPatch.context() as patch:
        folder = tmp_path_factory.mktemp("any")
        bench = Bench(folder, patch)
        bad: list[tuple[int, float, float]] = []
        for what, seconds in happens:
            bench.seconds(seconds)
            begin, epoch = bench.t, bench.epoch
            _happen(bench, what, folder)
            bench.seconds(0.8)
            until, bench.shaking, bench.unfit = bench.t, 0.0, ""
            bench.tacho = bench.samples = True
            if what in ("shake", "unfit"):
                bad.append((epoch, begin + 0.2, until - 0.2))
        for _ in range(20):
            bench.seconds(3.0)
            if bench.one.run.state == HELD:
                assert bench.table.omega == 0.0
                bench.one.repeat("anna")
        bench.ends()
        for step in bench.one.run.steps:
            window = step.window["from_us"] * 1e-6, step.window["until_us"] * 1e-6
            for epoch, begin, until in bad:
                inside = max(begin, window[0]) < min(until, window[1])
                assert epoch != step.window["epoch"] or not inside, (window, begin, until)


def _happen(bench: Bench, what: str, folder: Path) -> None:
    match what:
        case "reboot":
            bench.reboot()
        case "shake":
            bench.shaking = 300.0
        case "unfit":
            bench.unfit = "axis a21 is stuck"
        case "recorder":
            bench.recorder.header.run += 1
            bench.recorder.continues = bench.recorder.session
            bench.recorder.session += "z"
        case "tacho":
            bench.tacho = False
        case "dark":
            bench.samples = False
        case "service" if not bench.one.run.closed:
            bench.begin(unfinished(folder)["cube"])
