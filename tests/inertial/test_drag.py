"""A GNSS position that walks off slowly: found by the receiver's own velocity, said, and believed
less. E-132, E-133.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

from inertial.navigation import batch
from inertial.navigation.batch import run_filters
from inertial.navigation.drag import DragSettings, DragWatch
from inertial.navigation.fix import RTK_FIXED, Fix
from inertial.navigation.navigation import NAVIGATORS
from inertial.simulation.drive import simulate
from logs.drive_log import read_fixes

METRE = 1.0 / 6.37e6  # rad of latitude
BEGIN = 100.0  # s, of every drag


@pytest.fixture(scope="module")
def town():
    return simulate(3, "B", seconds=240.0)


def walked_off(fixes: list[Fix], speed: float) -> list[Fix]:
    """The position moved north at `speed` m/s from BEGIN on; the velocity is as it was."""
    return [replace(f, latitude=f.latitude + METRE * speed * max(0.0, f.t - BEGIN)) for f in fixes]


def alarms(fixes: list[Fix]) -> list[float]:
    """Times at which an alarm begins."""
    watch, found, before = DragWatch(), [], False
    for fix in fixes:
        watch.take(fix)
        if watch.dragging and not before:
            found.append(fix.t)
        before = watch.dragging
    return found


@pytest.mark.parametrize(("speed", "within"), [(0.3, 90.0), (0.5, 50.0), (1.0, 60.0)])
def test_a_drag_is_found_and_measured(town, speed: float, within: float) -> None:
    fixes = walked_off(town.fixes, speed)
    found = alarms(fixes)
    assert len(found) == 1 and 0.0 < found[0] - BEGIN < within
    watch = DragWatch()
    for fix in fixes:
        given = watch.take(fix)
    assert watch.drag[0] == pytest.approx(speed, abs=0.15) and abs(watch.drag[1]) < 0.15
    assert given.drag == pytest.approx(float(np.linalg.norm(watch.drag)))
    assert given.sigma_p[0] > speed * (fixes[-1].t - BEGIN) * 0.6


def test_honest_receivers_raise_no_alarm(town) -> None:
    assert alarms(town.fixes) == []
    for seed in (1, 2):
        assert alarms(simulate(seed, "B", seconds=300.0).fixes) == []


def test_the_real_drive_raises_no_alarm_and_a_drag_in_it_does(data_dir) -> None:
    fixes = read_fixes(data_dir / "car_drive" / "gnss.csv")[0][::4]
    assert alarms(fixes) == []
    began = fixes[0].t
    dragged = [
        replace(f, latitude=f.latitude + METRE * 0.2 * max(0.0, f.t - began - 200.0)) for f in fixes
    ]
    found = alarms(dragged)
    assert len(found) == 1 and 0.0 < found[0] - began - 200.0 < 60.0


def _still(n: int, sigma: float = 0.5) -> list[Fix]:
    """A receiver that stands, with white errors of half a sigma."""
    noise = np.random.default_rng(1).normal(size=(n, 3)) * 0.5 * sigma
    return [
        Fix(
            float(k),
            float(k),
            0.7 + METRE * e[0],
            0.1 + METRE * e[1],
            100.0 + e[2],
            RTK_FIXED,
            np.full(3, sigma),
            np.zeros(3),
            np.full(3, 0.1),
            key=k,
        )
        for k, e in enumerate(noise)
    ]


def test_a_jump_is_no_drag_and_one_gross_fix_is_passed_over() -> None:
    fixes = _still(200)
    jump = [replace(f, latitude=f.latitude + METRE * 40.0 * (f.t >= 100.0)) for f in fixes]
    gross = [replace(f, latitude=f.latitude + METRE * 40.0 * (f.t == 100.0)) for f in fixes]
    wrong = [replace(f, v_n=np.array([30.0, 0.0, 0.0])) if f.t == 100.0 else f for f in fixes]
    assert alarms(jump) == [] and alarms(gross) == [] and alarms(wrong) == []


def test_the_alarm_ends_when_the_drag_does() -> None:
    fixes = _still(600)
    there = [
        replace(f, latitude=f.latitude + METRE * np.clip(f.t - 100.0, 0.0, 100.0)) for f in fixes
    ]
    watch, dragging = DragWatch(), []
    for fix in there:
        watch.take(fix)
        dragging.append(watch.dragging)
    assert any(dragging[100:150]) and not any(dragging[:100]) and not dragging[-1]


def test_what_teaches_nothing_passes() -> None:
    watch, fixes = DragWatch(DragSettings(longest_gap=5.0)), _still(40)
    assert np.array_equal(watch.drag, np.zeros(3)) and watch.statistic == 0.0
    silent = replace(fixes[0], v_n=None)
    assert watch.take(silent) is silent and watch.take(replace(fixes[0], withheld=True)).drag == 0.0
    for fix in (fixes[0], fixes[1], fixes[0], fixes[1]):  # late ones, twice
        assert watch.take(fix) is fix
    before = watch.drag
    watch.take(fixes[30])  # after a gap it begins anew
    assert np.any(before != 0.0) and not np.any(watch.drag)


def test_a_filter_is_led_astray_less_far(town, monkeypatch: pytest.MonkeyPatch) -> None:
    fixes = walked_off(town.fixes, 0.5)
    watched = run_filters(town.imu, fixes, ["huber-nhc"])["huber-nhc"]
    monkeypatch.setattr(batch.DragWatch, "take", lambda self, fix: fix)
    blind = run_filters(town.imu, fixes, ["huber-nhc"])["huber-nhc"]

    def end(run) -> float:
        row = town.row_of(run.t[-1])
        north = (run.x["latitude"][-1] - town.truth.latitude[row]) / METRE
        east = (
            (run.x["longitude"][-1] - town.truth.longitude[row])
            / METRE
            * math.cos(run.x["latitude"][-1])
        )
        return math.hypot(north, east)

    assert end(blind) > 10.0 and end(watched) < 0.6 * end(blind)


def test_live_says_so_in_the_innovation_and_is_the_batch(town) -> None:
    fixes, live = walked_off(town.fixes, 1.0), NAVIGATORS["kf"]()
    waiting, said = list(reversed(fixes)), []
    for row in town.imu[: 100 * 150]:
        while waiting and waiting[-1].arrival <= row[0]:
            live.fix(waiting.pop())
        said += [c for c in live.imu(row[0], row[1:4], row[4:7]) if len(c.values)]
    assert live.counts["dragged"] >= 10
    assert said[-1].accepted and "walks off its own velocity at 1." in said[-1].reason
    run = run_filters(town.imu, fixes, ["kf"])["kf"]
    assert np.array_equal(said[-1].values, run.innovation[len(said) - 1, :6])
