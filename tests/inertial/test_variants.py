"""Filters for special sensors and the robust smoother: each does what it is there for."""

from dataclasses import replace

import numpy as np
import pytest
from support.estimator_drive import drive, exact

from inertial.navigation.batch import run_filters
from inertial.navigation.filters import DEFAULT, FILTERS
from inertial.navigation.smoother import smooth_drive
from inertial.simulation.drive import simulate


def rms(errors: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.sum(errors**2, axis=1))))


def test_scale_factors_are_found_and_taken_out() -> None:
    """Gyro of yaw 2 % too large, forward accelerometer 1.5 %: on a road with turns and stops of
    speed.
    """
    truth, imu = exact(120.0, still=12.0)
    imu[:, 6] *= 1.02
    imu[:, 1] *= 1.015
    runs = run_filters(imu, drive(truth, imu).fixes, ["kf-scale", "kf-latency"])
    x = runs["kf-scale"].x[-1]
    assert x["scale_gyro"][2] == pytest.approx(0.02, abs=0.007) and abs(x["scale_gyro"][0]) < 0.015
    rows = np.round(runs["kf-scale"].t / 0.01).astype(int)
    late = rows > 6000
    true_v = np.array([truth[row].v_n for row in rows])
    error = {name: rms((run.x["v_n"] - true_v)[late]) for name, run in runs.items()}
    assert error["kf-scale"] < error["kf-latency"]


def test_a_fading_filter_forgets_a_bias_that_jumped() -> None:
    """H2: both biases jump at 150 s. The covariance never closes as far, the velocity is found
    again sooner.
    """
    town = simulate(2, "H2", 200.0)
    chosen = {name: replace(FILTERS[name], gated=False) for name in ("kf", "kf-fading")}
    runs = run_filters(town.imu, town.fixes, chosen)
    plain, fading = runs["kf"], runs["kf-fading"]
    assert np.all(
        np.diagonal(fading.P, axis1=1, axis2=2)[20:] > np.diagonal(plain.P, axis1=1, axis2=2)[20:]
    )
    rows = [town.row_of(t) for t in plain.t]
    after = plain.t > 152.0
    error = {name: rms((run.x["v_n"] - town.truth.v_n[rows])[after]) for name, run in runs.items()}
    assert error["kf-fading"] < 0.9 * error["kf"]


def test_the_default_doubts_itself_and_not_the_receiver_when_a_bias_jumped() -> None:
    town = simulate(2, "H2", 200.0)
    deaf = replace(FILTERS[DEFAULT], jump=(0.0, 0.0))
    runs = run_filters(town.imu, town.fixes, {"default": FILTERS[DEFAULT], "deaf": deaf})
    run = runs["default"]
    rows = [town.row_of(t) for t in run.t]
    error = {name: r.x["v_n"] - town.truth.v_n[rows] for name, r in runs.items()}
    after, found = run.t > 152.0, run.t > 160.0
    assert rms(error["default"][after]) < 0.6 * rms(error["deaf"][after])
    variance = np.diagonal(run.P, axis1=1, axis2=2)[:, 3:6]
    assert np.mean(error["default"][found] ** 2 / variance[found]) < 2.0
    assert run.leg.receiver.velocity < 2.0


def test_the_robust_smoother_is_not_drawn_by_gross_fixes() -> None:
    town = simulate(3, "C", 150.0)
    smoothed = smooth_drive(town.imu, town.fixes, "smoother-robust")
    filtered = run_filters(
        town.imu, town.fixes, {"plain": replace(FILTERS["kf-nhc"], gated=False)}
    )["plain"]
    rows = [town.row_of(t) for t in filtered.t]
    assert len(smoothed.t) == len(rows)
    truth = town.truth.v_n[rows]
    assert rms((smoothed.x["v_n"] - truth)[20:]) < 0.6 * rms((filtered.x["v_n"] - truth)[20:])
    gross = np.isin([fix.key for fix in smoothed.fixes], town.gross)
    left = np.linalg.norm(smoothed.y[:, :2], axis=1)
    assert gross.any() and np.median(left[gross]) > 3.0 * np.median(left[~gross])
