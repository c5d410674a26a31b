"""From standstill to navigation: noiseless gives the truth, NEES keeps its band, fixes late, bad
and missing.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from support.estimator_drive import DT, drive, exact, fix_at

from inertial.earth import ned_between
from inertial.navigation.error_model import ImuNoise
from inertial.navigation.fix import Fix, FixSettings
from inertial.navigation.navigation import NAVIGATORS, Mode, Navigator, NavigatorConfig
from inertial.rotation import euler_angles, rotation_vector
from tests.inertial.twins.strapdown import State

Array = NDArray[np.float64]
STILL = 12.0  # s


@pytest.fixture(scope="module")
def perfect() -> tuple[list[State], Array]:
    return exact(72.0, still=STILL)


def play(navigator: Navigator, imu: Array, fixes: list) -> list:
    waiting = sorted(fixes, key=lambda fix: fix.arrival)
    corrections = []
    for row in imu:
        while waiting and waiting[0].arrival <= row[0]:
            navigator.fix(waiting.pop(0))
        corrections += navigator.imu(row[0], row[1:4], row[4:7])
    return corrections


def test_noiseless_gives_the_truth_also_with_late_fixes(perfect: tuple[list[State], Array]) -> None:
    truth, imu = perfect
    ends = []
    for delay in (0.0, 0.35):
        navigator = Navigator()
        assert navigator.solution().mode == Mode.WAITING
        corrections = play(navigator, imu, drive(truth, imu, delay=delay).fixes)
        s, end = navigator.solution(), truth[-1]
        assert s.mode == Mode.NAVIGATING
        assert np.abs(s.p_ned - truth_ned(end, s.origin)).max() < 0.02
        assert np.abs(s.v_n - end.v_n).max() < 0.03
        assert all(c.accepted for c in corrections)
        assert 0.0 < s.fix_age < 1.5
        ends.append(s)
    # the corrections are the same, each at its own time; only the very last may still be on its way
    assert np.abs(ends[0].p_ned - ends[1].p_ned).max() < 0.005


def truth_ned(x: State, origin: tuple[float, float, float]) -> Array:
    return np.array(ned_between(origin, (x.latitude, x.longitude, x.height)))


def test_fixes_between_samples_are_used_at_their_instant(
    perfect: tuple[list[State], Array],
) -> None:
    truth, imu = perfect
    navigator = Navigator()
    play(navigator, imu[: int(60 / DT)], [f for f in drive(truth, imu).fixes if f.t < 58.0])
    half = 59.0 + 0.5 * DT
    a, b = truth[5900], truth[5901]
    place = (0.5 * (p + q) for p, q in zip(a.place, b.place, strict=True))
    middle = State(*place, 0.5 * (a.v_n + b.v_n), a.C_nb)
    between = fix_at(middle, half, np.zeros(3), np.zeros(3), 0.01, 0.05)
    navigator.fix(between)
    (correction,) = navigator.imu(60.01, imu[6000, 1:4], imu[6000, 4:7])
    assert np.abs(correction.error_ned).max() < 0.05  # 12 m/s times half a sample would be 0.06


def test_an_outlier_is_refused_and_a_moved_truth_is_taken_after_ten(
    perfect: tuple[list[State], Array],
) -> None:
    truth, imu = perfect
    fixes = drive(truth, imu).fixes
    jump = 50.0 / 6.4e6  # rad, 50 m
    fixes[40] = replace(fixes[40], latitude=fixes[40].latitude + jump)
    for k in range(55, 72):
        fixes[k] = replace(fixes[k], latitude=fixes[k].latitude + jump)
    navigator = Navigator()
    corrections = play(navigator, imu, fixes)
    verdicts = {round(c.fix.t): c.accepted for c in corrections}
    assert not verdicts[40] and verdicts[41]
    assert [verdicts[t] for t in range(55, 66)] == [False] * 9 + [True] * 2
    assert navigator.counts["rejected"] == 10 and navigator.counts["readmitted"] == 1


def test_sigma_and_fix_age_grow_in_an_outage(perfect: tuple[list[State], Array]) -> None:
    truth, imu = perfect
    navigator = Navigator()
    fixes = [f for f in drive(truth, imu).fixes if f.t < 50.0]
    play(navigator, imu[: int(51 / DT)], fixes)
    before = navigator.solution()
    play(navigator, imu[int(51 / DT) :], [])
    after = navigator.solution()
    assert after.fix_age == pytest.approx(before.fix_age + 21.0, abs=1e-6)
    assert after.sigma[6] > 20.0 * before.sigma[6]
    error = after.p_ned - truth_ned(truth[-1], after.origin)
    assert abs(error[0]) < 4.0 * after.sigma[6] and abs(error[1]) < 4.0 * after.sigma[7]


def test_no_satellites_no_number_no_use(perfect: tuple[list[State], Array]) -> None:
    truth, imu = perfect
    navigator = Navigator()
    fix = drive(truth, imu).fixes[0]
    bad = [replace(fix, quality=0), replace(fix, t=2.0, arrival=2.0, longitude=math.nan)]
    corrections = play(navigator, imu[:500], bad)
    assert [c.accepted for c in corrections] == [False, False]
    assert navigator.solution().fix_age == math.inf


def flat(fix: Fix) -> Fix:
    """The fix of a receiver that gives neither height nor vertical speed."""
    v, sigma_v = fix.v_n.copy(), fix.sigma_v.copy()
    v[2] = sigma_v[2] = math.nan
    return replace(fix, height=math.nan, v_n=v, sigma_v=sigma_v)


@pytest.mark.parametrize("name", ["kf", "huber-nhc", "fpe-fuzzy", "mhe-robust"])
def test_fixes_without_height_give_the_place_and_claim_no_height(
    perfect: tuple[list[State], Array], name: str
) -> None:
    truth, imu = perfect
    navigator = NAVIGATORS[name]()
    said = play(navigator, imu, [flat(f) for f in drive(truth, imu).fixes])
    s, end = navigator.solution(), truth[-1]
    assert s.mode == Mode.NAVIGATING and navigator.counts["rejected"] == 0
    error = np.abs(s.p_ned - truth_ned(end, (*s.origin[:2], 0.0)))
    assert error[:2].max() < 0.3
    assert math.isnan(s.height) and math.isnan(s.p_ned[2]) and s.sigma[8] > 1000.0
    last = said[-1]
    known = np.isfinite(last.values[:6]).tolist()
    assert known == np.isfinite(last.sigma[:6]).tolist() == [True, True, False, True, True, False]
    assert math.isfinite(last.nis) and np.isfinite(last.error_ned[:2]).all()


def test_a_height_that_comes_later_is_taken(perfect: tuple[list[State], Array]) -> None:
    truth, imu = perfect
    fixes = [flat(f) if f.t < 50.0 else f for f in drive(truth, imu).fixes]
    navigator = Navigator()
    play(navigator, imu, fixes)
    s = navigator.solution()
    assert abs(s.height - truth[-1].height) < 0.1 and s.sigma[8] < 5.0
    assert np.abs(s.p_ned - truth_ned(truth[-1], s.origin)).max() < 0.1
    assert navigator.counts["rejected"] == 0


def test_sea_level_is_no_better_known_than_the_geoid(perfect: tuple[list[State], Array]) -> None:
    """All heights have one offset: no number of them makes it smaller."""
    truth, imu = perfect
    fixes = [replace(f, height=f.height - 47.0, datum=110.0) for f in drive(truth, imu).fixes]
    navigator = Navigator()
    play(navigator, imu, fixes)
    s = navigator.solution()
    assert s.sigma[8] >= 110.0 and s.position_covariance[2, 2] >= 110.0**2
    assert s.datum == 110.0 and abs(s.height + 47.0 - truth[-1].height) < 0.1


def test_a_receiver_that_loses_its_geoid_does_not_lose_its_fixes(
    perfect: tuple[list[State], Array],
) -> None:
    truth, imu = perfect
    fixes = [
        replace(f, height=f.height - 47.0, datum=110.0) if f.t > 50.0 else f
        for f in drive(truth, imu).fixes
    ]
    navigator = Navigator()
    play(navigator, imu, fixes)
    s = navigator.solution()
    assert navigator.counts["rejected"] == 0 and s.datum == 0.0
    assert np.abs(s.p_ned - truth_ned(truth[-1], s.origin))[:2].max() < 0.1
    assert abs(s.height - truth[-1].height) < 3.0 * s.sigma[8] + 1.0


def test_a_gap_asks_for_the_heading_again(
    perfect: tuple[list[State], Array], caplog: pytest.LogCaptureFixture
) -> None:
    truth, imu = perfect
    navigator = Navigator()
    play(navigator, imu[:4000], [f for f in drive(truth, imu).fixes if f.t < 40.0])
    assert navigator.mode == Mode.NAVIGATING
    navigator.imu(imu[4100, 0], imu[4100, 1:4], imu[4100, 4:7])
    assert navigator.mode == Mode.COURSE and "without samples" in caplog.text
    play(navigator, imu[4101:], [f for f in drive(truth, imu).fixes if f.t > 41.5])
    assert navigator.mode == Mode.NAVIGATING


def test_nees_keeps_its_band() -> None:
    """Ten drives with noise as the filter models it: mean NEES of attitude, velocity and position
    near 9.
    """
    noise, sigma_p, sigma_v, root = ImuNoise(turn=0.0), 0.3, 0.15, math.sqrt(DT)
    config = NavigatorConfig(imu=noise, fix=FixSettings(wander=0.0, lag=0.0))
    truth, imu = exact(52.0, still=STILL)
    end, moving = truth[-1], imu[:, :1] > STILL
    nees = []
    for seed in range(10):
        draw = np.random.default_rng(seed)
        noisy = imu.copy()
        noisy[:, 1:4] += (
            draw.normal(0.0, 0.03, 3) + draw.normal(0.0, noise.accel / root, (len(imu), 3)) * moving
        )
        noisy[:, 4:7] += (
            draw.normal(0.0, 8e-4, 3) + draw.normal(0.0, noise.gyro / root, (len(imu), 3)) * moving
        )
        fixes = [
            fix_at(
                truth[k],
                k * DT,
                draw.normal(0, sigma_p, 3),
                draw.normal(0, sigma_v, 3),
                sigma_p,
                sigma_v,
            )
            for k in range(0, len(truth) - 100, 100)
        ]
        navigator = Navigator(config)
        play(navigator, noisy, fixes)
        x = navigator.nominal
        psi = rotation_vector(end.C_nb @ x.C_nb.T)
        error = np.concatenate([psi, x.v_n - end.v_n, truth_ned(x, end.place) * (1, 1, -1)])
        P = navigator.covariance()[:9, :9]
        nees.append(error @ np.linalg.solve(P, error))
    assert 5.2 < np.mean(nees) < 13.8  # 99.9 % of chi-square with 90 degrees of freedom, over 10


def test_heading_starts_from_the_course(perfect: tuple[list[State], Array]) -> None:
    truth, imu = perfect
    navigator = Navigator()
    fixes, k = drive(truth, imu).fixes, 0
    while navigator.mode != Mode.NAVIGATING:
        now = (k + 1) * DT
        play(navigator, imu[k : k + 1], [f for f in fixes if now - DT < f.arrival <= now])
        k += 1
    yaw = euler_angles(truth[k].C_nb)[2]
    found = euler_angles(navigator.nominal.C_nb)[2]
    assert math.remainder(found - yaw, 2.0 * math.pi) == pytest.approx(0.0, abs=0.02)
