"""Alignment: standstill, what spoils it, and the start in motion on simulated drives and a real
one.
"""

import math

import numpy as np
import pytest

from inertial.navigation.alignment import Alignment, AlignmentSettings
from inertial.navigation.alignment_motion import MotionSettings, MotionWindow
from inertial.navigation.navigation import NAVIGATORS, Mode, NavigatorConfig
from inertial.rotation import euler_angles, rotation_vector, to_matrix
from inertial.simulation.drive import DEG, simulate
from logs.score import CAR_LEVER_ARM_B, COURSE_SPEED, Drive, read_drive

NAVIGATOR = next(iter(NAVIGATORS.values()))
BEGIN = (60.0, 120.0, 200.0)  # s into a drive: without its standstill


def start_within(drive, begin: float, settings: MotionSettings = MotionSettings()):
    """MotionStart of the drive cut at `begin` by the alignment's own rules, and the row of the
    truth it is for.
    """
    align = Alignment(AlignmentSettings(motion=settings))
    fixes = [f for f in drive.fixes if f.t >= begin + 0.5]
    for row in drive.imu[round(begin * 100) :]:
        align.imu(row[0], row[1:4], row[4:7])
        if fixes and fixes[0].t <= row[0]:
            fix = fixes.pop(0)
            align.fix(fix.t, fix.v_n, fix.sigma_v)
            if align.levelled:  # it stood for 10 s at a crossing
                return None, 0
            found = align.start(align.C, fix.v_n)
            if found is not None:
                return found, drive.row_of(fix.t)
    return None, 0


def errors(settings: MotionSettings = MotionSettings(), seeds: range = range(1, 6)) -> np.ndarray:
    """(n, 6): attitude error psi and its sigma, rad, of starts in motion."""
    out = []
    for seed in seeds:
        drive = simulate(seed, "B", seconds=240.0)
        for begin in BEGIN:
            start, row = start_within(drive, begin, settings)
            if start is not None:
                psi = rotation_vector(drive.truth.C_nb[row] @ start.C_nb.T)
                out.append([*psi, *np.sqrt(np.diag(start.P)[:3])])
    return np.array(out)


def test_a_start_in_motion_knows_its_attitude_and_how_well():
    e = errors()
    assert len(e) >= 10
    rms = np.degrees(np.sqrt(np.mean(e[:, :3] ** 2, axis=0)))
    assert rms[:2].max() < 3.0
    assert rms[2] < 5.0
    normalised = np.sqrt(np.mean((e[:, :3] / e[:, 3:]) ** 2, axis=0))
    assert (normalised[:2] > 0.3).all() and (normalised < 1.7).all()


def test_without_trust_in_the_course_the_manoeuvres_give_the_heading():
    """A board on a boat: no rule says that it goes where it points. Sigma must grow, and stay
    honest.
    """
    settings = MotionSettings(sigma_slip=math.inf, good_yaw=20.0 * DEG)
    e = errors(settings)
    assert len(e) >= 5
    assert np.abs(e[:, 2] / e[:, 5]).max() < 3.5
    assert np.median(e[:, 5]) > 2.0 * DEG


def test_a_sideways_board_is_refused_rather_than_believed():
    """Samples of another drive: nothing fits, and the text says so."""
    a, b = simulate(1, "B", seconds=120.0), simulate(2, "B", seconds=120.0)
    align = Alignment(AlignmentSettings())
    fixes = [f for f in b.fixes if f.t >= 40.0]
    texts = set()
    for row in a.imu[4000:9000]:
        align.imu(row[0], row[1:4], row[4:7])
        if fixes and fixes[0].t <= row[0]:
            fix = fixes.pop(0)
            align.fix(fix.t, fix.v_n, fix.sigma_v)
            if align.levelled:
                break
            found = align.start(align.C, fix.v_n)
            texts.add(align.text)
            assert found is None or np.sqrt(np.diag(found.P)[:2]).max() < 3.0 * DEG
    assert any("disagree" in text for text in texts)


@pytest.mark.parametrize(
    ("disturb", "reason"),
    [
        (lambda f, w: (f + np.array([0.0, 0.5, 0.0]), w), "tilted or was pushed"),
        (lambda f, w: (f, w + np.array([0.0, 0.0, 0.05])), "turned"),
        (lambda f, w: (f * 1.2, w), "the board shakes"),
    ],
)
def test_moving_during_levelling_begins_it_again_and_says_why(disturb, reason):
    align = Alignment(AlignmentSettings())
    still = np.array([0.0, 0.0, -9.81]), np.zeros(3)
    moved = disturb(*still)
    for k in range(650):
        align.imu(0.01 * k, *still)
    assert align.text == "levelling: still for 6 of 10 s"
    for k in range(650, 900):
        align.imu(0.01 * k, *moved)
    assert not align.levelled
    assert reason in align.text and "begun again" in align.text
    for k in range(900, 1800):
        align.imu(0.01 * k, *still)
    assert not align.levelled  # 9 s only: what came before does not count
    for k in range(1800, 2100):
        align.imu(0.01 * k, *still)
    assert align.levelled
    assert align.text.startswith("level")


@pytest.mark.parametrize(
    ("f", "w"),
    [([0.0, 4.0, -9.81], [0.0, 0.0, 0.0]), ([0.0, 0.0, -9.81], [0.0, 0.0, 0.3])],
    ids=["pushed", "turning"],
)
def test_what_never_changes_is_still_no_standstill(f, w):
    align = Alignment(AlignmentSettings())
    for k in range(3000):
        align.imu(0.01 * k, np.array(f), np.array(w))
    assert not align.levelled
    assert align.text == "stand still for 10 s"


def test_a_smooth_motorway_is_no_standstill():
    align = Alignment(AlignmentSettings(in_motion=False))
    for k in range(3000):
        align.imu(0.01 * k, np.array([0.0, 0.0, -9.81]), np.zeros(3))
        if k % 100 == 99:
            align.fix(0.01 * k, np.array([30.0, 0.0, 0.0]), np.full(3, 0.1))
    assert not align.levelled
    assert "moving at 30.0 m/s by GNSS" in align.text or "stand still" in align.text


def test_the_window_is_bounded():
    window = MotionWindow(MotionSettings())
    for k in range(20_000):
        window.imu(0.01 * k, np.array([0.0, 0.0, -9.81]), np.zeros(3))
        if k % 100 == 99:
            window.fix(0.01 * k, np.array([10.0, 0.0, 0.0]), np.full(3, 0.1))
    assert window.span <= MotionSettings().longest
    assert len(window._samples) <= 100 * (2 * MotionSettings().longest + 4) + 1


def test_navigation_begins_in_motion_and_stays_consistent():
    drive = simulate(3, "B", seconds=260.0)
    navigator = NAVIGATOR(NavigatorConfig())
    fixes = [f for f in drive.fixes if f.t >= 200.5]
    heading = []
    for row in drive.imu[20_000:]:
        while fixes and fixes[0].arrival <= row[0]:
            navigator.fix(fixes.pop(0))
        navigator.imu(row[0], row[1:4], row[4:7])
        if navigator.mode == Mode.NAVIGATING and row[0] > 245.0:
            yaw = euler_angles(to_matrix(navigator.solution().q_nb))[2]
            heading.append(
                math.remainder(
                    yaw - euler_angles(drive.truth.C_nb[drive.row_of(row[0])])[2], math.tau
                )
            )
    assert "in motion" in navigator.solution().alignment
    assert np.degrees(np.sqrt(np.mean(np.square(heading)))) < 3.0


@pytest.mark.parametrize("begin", [90.0, 300.0])
def test_a_real_drive_cut_so_that_it_begins_in_motion(data_dir, begin):
    """Heading against course from 40 s after the cut, and no worse position than of the drive that
    began standing.
    """
    folder = data_dir / "car_drive"
    whole = read_drive(folder / "imu.csv", folder / "gnss.csv", every=4)
    imu = whole.imu[(whole.imu[:, 0] >= begin) & (whole.imu[:, 0] < begin + 110.0)]
    fixes = [f for f in whole.fixes if begin + 0.5 <= f.t < begin + 109.0]
    navigator = NAVIGATOR(NavigatorConfig(lever_arm_b=CAR_LEVER_ARM_B))
    drive, heading, position = Drive(imu, fixes), [], []
    began = math.inf
    pending = list(drive.fixes)
    for row in drive.imu:
        while pending and pending[0].arrival <= row[0]:
            navigator.fix(pending.pop(0))
        for c in navigator.imu(row[0], row[1:4], row[4:7]):
            if c.fix.withheld and len(c.values) and c.fix.t > began + 30.0:
                position.append(np.hypot(*c.error_ned[:2]))
                if math.hypot(*c.fix.v_n[:2]) > COURSE_SPEED:
                    heading.append(
                        math.remainder(c.yaw - math.atan2(c.fix.v_n[1], c.fix.v_n[0]), math.tau)
                    )
        if navigator.mode == Mode.NAVIGATING:
            began = min(began, row[0])
    assert began < begin + 60.0
    assert "in motion" in navigator.solution().alignment
    assert np.sqrt(np.mean(np.square(position))) < 0.12
    assert np.degrees(np.sqrt(np.mean(np.square(heading)))) < 3.0


@pytest.mark.parametrize("name", ["kf", "huber-nhc"])
def test_a_hole_in_the_samples_does_not_turn_the_attitude(name):
    """What is kept across a hole is the attitude, not the time since it was found."""
    drive = simulate(3, "B", 160.0)
    navigator = NAVIGATORS[name](NavigatorConfig())
    fixes = list(drive.fixes)
    errors = []
    for row in drive.imu[(drive.imu[:, 0] < 100.0) | (drive.imu[:, 0] >= 100.4)]:
        while fixes and fixes[0].arrival <= row[0]:
            navigator.fix(fixes.pop(0))
        navigator.imu(float(row[0]), row[1:4].copy(), row[4:7].copy())
        if row[0] > 110.0 and navigator.mode == Mode.NAVIGATING:
            up = to_matrix(navigator.solution().q_nb) @ drive.truth.C_nb[drive.row_of(row[0])].T
            errors.append(np.hypot(up[0, 2], up[1, 2]))
    assert len(errors) > 3000 and np.degrees(np.max(errors)) < 6.0
