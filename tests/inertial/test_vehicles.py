"""The default navigator in vehicles that are no car: never much worse than the plain filter, and
its sigmas hold.
"""

from dataclasses import replace

import numpy as np
import pytest

from inertial.navigation.alignment import UNTESTED
from inertial.navigation.batch import FilterRun, run_filters
from inertial.navigation.filters import DEFAULT, FILTERS
from inertial.navigation.navigation import NAVIGATORS, NavigatorConfig
from inertial.navigation.smoother import smooth_drive
from inertial.navigation.solution import WHEELS, Wheels
from inertial.navigation.standstill import AlignmentSettings
from inertial.simulation.drive import SimulatedDrive
from inertial.simulation.ride_score import Errors, errors_of
from inertial.simulation.vehicles import RIDES, travel

PLAIN = "kf"
ALOFT = "lift"  # goes nowhere: its heading nobody can know
WAYS = [ride for ride in RIDES if ride != ALOFT]
WORSE = 1.2  # of the default against the plain filter, at most
CARS = ("car", "city", "car, 10 Hz", "car, sigmas a third", "car, no velocity for 80 s")
NO_CARS = ("aircraft", "rolling body", "helicopter", "boat", "walker", "ship", "glider")


def run_both(drive: SimulatedDrive) -> dict[str, FilterRun]:
    return run_filters(drive.imu, drive.fixes, [DEFAULT, PLAIN])


@pytest.fixture(scope="module")
def rides() -> dict[str, tuple[SimulatedDrive, dict[str, FilterRun]]]:
    drives = {name: travel(name, 2) for name in RIDES}
    return {name: (drive, run_both(drive)) for name, drive in drives.items()}


def errors(rides, ride: str, name: str) -> Errors:
    drive, runs = rides[ride]
    return errors_of(runs[name], drive)


@pytest.mark.parametrize("ride", WAYS)
def test_the_default_is_never_much_worse_than_the_plain_filter(rides, ride: str) -> None:
    default, plain = (errors(rides, ride, name) for name in (DEFAULT, PLAIN))
    assert default.position_m <= WORSE * plain.position_m
    assert default.heading_deg <= WORSE * plain.heading_deg
    assert default.tilt_deg <= WORSE * plain.tilt_deg


@pytest.mark.parametrize("ride", WAYS)
def test_good_fixes_are_not_refused_and_sigmas_hold(rides, ride: str) -> None:
    default = errors(rides, ride, DEFAULT)
    assert default.refused < 0.03
    assert default.nees_position < 2.5 and default.nees_velocity < 2.0
    assert default.nees_tilt < 3.5 and default.nees_heading < 4.0
    assert default.beyond <= 0.001


def test_what_goes_nowhere_is_not_given_a_heading(rides) -> None:
    for run in rides[ALOFT][1].values():
        assert not np.isfinite(run.began) and "drive faster" in run.text


@pytest.mark.parametrize("ride", CARS)
def test_a_car_s_wheels_are_believed_and_stay_so(rides, ride: str) -> None:
    _, runs = rides[ride]
    assert [wheels for _, wheels in runs[DEFAULT].wheels] == [Wheels.BELIEVED]


@pytest.mark.parametrize("ride", NO_CARS)
def test_what_is_no_car_has_no_wheels(rides, ride: str) -> None:
    run = rides[ride][1][DEFAULT]
    assert run.rows["wheels"][-1] in (Wheels.CONTRADICTED, Wheels.ON_TRIAL)
    believed = run.rows["wheels"] == Wheels.BELIEVED
    assert believed.mean() < 0.15


def test_an_outage_in_a_city_is_bridged_by_the_wheels(rides) -> None:
    assert errors(rides, "city", DEFAULT).position_m < 0.3 * errors(rides, "city", PLAIN).position_m


def test_the_smoother_uses_wheels_only_where_they_were_believed() -> None:
    drive = travel("aircraft", 1)
    smooth = smooth_drive(drive.imu, drive.fixes)
    trusting = replace(
        FILTERS["huber-nhc"], constraints=replace(FILTERS["huber-nhc"].constraints, tried=False)
    )
    led_astray = run_filters(drive.imu, drive.fixes, {"trusting": trusting})["trusting"]
    assert smooth is not None
    assert errors_of(smooth, drive).position_m < 5.0 < errors_of(led_astray, drive).position_m


def test_live_is_the_batch_and_says_what_it_believes(caplog: pytest.LogCaptureFixture) -> None:
    drive = travel("car", 1, 120.0)
    live, waiting = NAVIGATORS[DEFAULT](), list(reversed(drive.fixes))
    said = []
    caplog.set_level("INFO")
    for row in drive.imu:
        while waiting and waiting[-1].arrival <= row[0]:
            live.fix(waiting.pop())
        said += [c for c in live.imu(row[0], row[1:4], row[4:7]) if len(c.values)]
    batch = run_both(drive)[DEFAULT]
    assert np.array_equal(said[-1].values, batch.innovation[len(said) - 1, :6])
    assert live.wheels == Wheels.BELIEVED and WHEELS[Wheels.BELIEVED] in live.solution().alignment
    assert WHEELS[Wheels.BELIEVED] in caplog.text
    assert [c for c in said if WHEELS[Wheels.BELIEVED] in c.reason]


def test_belief_ends_where_a_car_begins_to_slide(rides) -> None:
    _, runs = rides["car on ice"]
    (began, first), (ended, second), *_ = runs[DEFAULT].wheels
    assert (first, second) == (Wheels.BELIEVED, Wheels.CONTRADICTED)
    assert began < 100.0 < 150.0 < ended < 200.0


@pytest.mark.parametrize("ride", ["car, unit across", "backing car", "drone"])
def test_a_course_that_is_no_heading_is_not_taken_for_one(rides, ride: str) -> None:
    drive, runs = rides[ride]
    assert "no car's" in runs[PLAIN].text
    assert abs(errors(rides, ride, PLAIN).heading_deg) < 6.0


def test_a_walker_starts_from_what_is_felt(rides) -> None:
    _, runs = rides["walker"]
    assert runs[DEFAULT].began < 45.0 and "felt" in runs[DEFAULT].text


def test_a_course_across_the_nose_is_told_by_what_is_felt(rides) -> None:
    """It turns steadily, nose outward: as a car that leans it would fit with a wrong gyro bias."""
    drive, runs = rides["merry-go-round"]
    assert "no car's" in runs[PLAIN].text
    assert abs(errors(rides, "merry-go-round", PLAIN).heading_deg) < 6.0


def test_a_ferry_that_sets_sail_is_no_standstill_and_no_spoilt_sensor(rides) -> None:
    drive, runs = rides["car on a ferry"]
    run = runs[DEFAULT]
    sailing = run.t > 155.0
    assert np.sqrt(run.P[sailing, 2, 2]).max() < np.radians(6.0)  # its biases were not doubted
    at = [drive.row_of(t) for t in run.t[sailing]]
    assert np.abs(run.x["v_n"][sailing] - drive.truth.v_n[at]).max() < 0.6


def test_a_receiver_without_velocities_is_aligned_by_the_way_between_its_positions(rides) -> None:
    _, runs = rides["car, positions only"]
    assert runs[DEFAULT].began < 40.0


def test_the_speed_of_the_course_is_a_setting() -> None:
    drive = travel("car", 1, 90.0)
    slow = AlignmentSettings(course_speed=2.0)
    runs = [
        run_filters(drive.imu, drive.fixes, ["kf"], NavigatorConfig(alignment=a))["kf"].began
        for a in (slow, AlignmentSettings())
    ]
    assert runs[0] <= runs[1] < 30.0


def test_who_never_moves_is_told_how_far_it_is() -> None:
    drive = travel("car", 1, 90.0)
    rows = drive.imu[:, 0] < 19.0
    run = run_filters(drive.imu[rows], [f for f in drive.fixes if f.t < 19.0], ["kf"])["kf"]
    assert not np.isfinite(run.began)
    assert "level" in run.text and "4 m/s" in run.text
    assert UNTESTED > 1.0
