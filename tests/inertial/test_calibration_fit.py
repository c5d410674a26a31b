"""Calibration against devices whose imperfections are known, drawn by physics that does not share
the fit's model.
"""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2
from typer.testing import CliRunner

from gyrofree.commands.main import app
from inertial.calibration import model
from inertial.calibration.card import CardError, as_dict, make_card, read_card, write_card
from inertial.calibration.fit import CalibrationError, Parameters, fit
from inertial.calibration.poses import (
    candidates,
    collect,
    describe,
    find,
    next_pose,
    plan,
    predicted,
)
from inertial.calibration.steps import blocks
from inertial.layouts.catalogue import find as find_layout
from inertial.simulation.imperfect import MOUNTINGS, device, table_run, tumble
from logs.calibrate import advice, calibrate
from logs.imperfect_logs import write

CUBE = find_layout("cube", 0.05)
SEEDS = (1, 2, 3)


def solved(seed, layout=CUBE, poses=14):
    """A device and its fits: from poses alone, and with three mountings on the table."""
    one = device(layout, seed)
    readings = tumble(one, plan(poses))
    found, noise = find(readings, 0.01)
    means = collect(readings, found)
    runs = [table_run(one, mounting, seed=10 * seed + k) for k, mounting in enumerate(MOUNTINGS)]
    steps = [blocks(run.t_s, run.readings, run.tacho, 0.01) for run in runs]
    return one, fit(layout, means, noise=noise), fit(layout, means, steps, noise=noise)


@pytest.fixture(scope="module")
def devices():
    return [solved(seed) for seed in SEEDS]


def normalised(error, covariance):
    """Squared error in units of its covariance, and degrees of freedom: without what the gauge
    holds.
    """
    values, vectors = np.linalg.eigh(covariance)
    free = values > 1e-10
    return float(np.sum((vectors.T @ error)[free] ** 2 / values[free])), int(free.sum())


def test_parameters_are_recovered_within_their_sigma(devices):
    total, degrees = np.zeros(2), np.zeros(2)
    for one, _, both in devices:
        p, n = both.parameters, CUBE.axes
        error = np.concatenate([p.b - one.bias, (p.c - one.c).ravel()])
        place, _ = model.places(CUBE)
        true_r = np.array([one.true.r_b[np.argmax(place == s)] for s in range(4)])
        for k, (e, part) in enumerate(
            ((error, slice(0, 4 * n)), ((p.r - true_r).ravel(), slice(4 * n, 4 * n + 12)))
        ):
            square, dof = normalised(e, both.covariance[part, part])
            total[k] += square
            degrees[k] += dof
        assert np.abs(p.b - one.bias).max() < 0.004  # 0.4 mg of biases of 20 mg
        assert np.abs(both.scale - one.scale).max() < 5e-4
        assert np.linalg.norm(p.r - true_r, axis=1).max() < 1.2e-4
    # The floor of the noise makes the fit modest: not below a third of what it says, not beyond the
    # 99.9 % band.
    for square, dof in zip(total, degrees, strict=True):
        assert dof / 5.0 < square < chi2.ppf(0.999, dof), (total, degrees)


def test_poses_alone_leave_positions_nominal(devices):
    _, poses, both = devices[0]
    assert (poses.narrowed[48:] > 0.8).all() and (both.narrowed[48:] < 0.1).all()
    assert (poses.narrowed[:48] < 0.1).all()


def test_products_of_a_turning_device_before_and_after(devices):
    """The mean of the measured w_i w_j on a plateau: uncalibrated off by scale and lever arms,
    calibrated right.
    """
    for one, _, both in devices:
        card = make_card(both, CUBE, CUBE.axis_names, device="cube", date="2026-01-02T03:04:05Z")
        run = table_run(one, profile="fast", seed=77)
        plateau = slice(1550, 1950)  # 684 deg/s
        true = run.omega_b[1600, 2] ** 2

        def error(layout, readings, plateau=plateau, true=true):
            mean = layout.field_inverse[6:] @ readings[plateau].mean(axis=0)
            return np.abs(mean - np.array([0.0, 0.0, 0.0, 0.0, 0.0, true])).max() / true

        before, after = (
            error(CUBE, run.readings),
            error(card.layout(CUBE), card.correct(run.readings)),
        )
        assert after < 0.002 < 0.01 < before, (before, after)


def test_another_layout_single_axes(devices):
    layout = find_layout("edges-12", 0.05)
    one, poses, _ = solved(4, layout, poses=12)
    assert np.abs(poses.parameters.b - one.bias).max() < 0.006


def test_jacobians_match_differences():
    draw = np.random.default_rng(0)
    place, r0 = model.places(CUBE)
    unit = draw.normal(size=(5, 3))
    unit /= np.linalg.norm(unit, axis=1)[:, None]
    c = CUBE.theta_b + 0.1 * draw.normal(size=(12, 3))
    p = Parameters(
        draw.normal(size=12), c, r0, unit[:3], unit[3:4], unit[4:], draw.normal(size=(1, 3))
    )
    angle, alpha = draw.normal(size=(3, 6)), 5.0 * draw.normal(size=6)
    steps = model.Steps(np.zeros((6, 12)), np.full(6, 20), *angle, alpha, np.zeros(6))
    H = model.steps_jacobian(p, 0, steps, place, 9.8)
    H_pose = model.pose_jacobian(p, 1, 9.8)
    zero, H_gauge = model.gauge(p, CUBE.theta_b, r0)
    for column in range(p.size):
        e = 1e-6 * np.eye(p.size)[column]
        ahead, back = model.apply(p, e), model.apply(p, -e)
        difference = model.read_steps(ahead, 0, steps, place, 9.8) - model.read_steps(
            back, 0, steps, place, 9.8
        )
        np.testing.assert_allclose(H[:, :, column], difference / 2e-6, atol=1e-5)
        pose = model.read_poses(ahead, 9.8)[1] - model.read_poses(back, 9.8)[1]
        np.testing.assert_allclose(H_pose[:, column], pose / 2e-6, atol=1e-5)
        held = model.gauge(ahead, CUBE.theta_b, r0)[0] - model.gauge(back, CUBE.theta_b, r0)[0]
        np.testing.assert_allclose(H_gauge[:, column], held / 2e-6, atol=1e-8)


def test_plan_determines_everything_from_nine_poses():
    assert len(candidates()) == 26 and len({tuple(v) for v in candidates().round(6)}) == 26
    few, nine = (predicted(CUBE, plan(n), 400, 0.04) for n in (6, 9))
    assert (
        few.scale_sigma.max() < 1e-3 < np.deg2rad(1.0) < few.misalignment_sigma.max()
    )  # a shear stays open
    assert nine.misalignment_sigma.max() < 1e-3
    assert describe(plan(9)[0]) == "+z face up" and describe(plan(9)[8]).startswith("edge between")
    taken = []
    while (up := next_pose(np.array(taken).reshape(-1, 3))) is not None:
        taken.append(up)
    assert len(taken) == 24
    with pytest.raises(CalibrationError, match="want 6 to 24"):
        plan(5)


def test_card_survives_its_file_and_refuses_strangers(devices, tmp_path):
    said = {
        "device": "cube",
        "date": "2026-01-02T03:04:05Z",
        "uid": "ab12",
        "data": [("a.csv", "0" * 64)],
    }
    card = make_card(devices[0][2], CUBE, CUBE.axis_names, **said)
    path = tmp_path / "card.toml"
    write_card(card, path)
    again = read_card(path)
    assert as_dict(again).keys() == as_dict(card).keys()
    for name in ("bias", "scale", "direction_b", "position_b", "covariance", "residual", "noise"):
        np.testing.assert_allclose(getattr(again, name), getattr(card, name), atol=1e-12)
    assert (again.uid, again.data, again.names, again.poses) == (
        card.uid,
        card.data,
        card.names,
        card.poses,
    )
    assert again.id.startswith("cube-20260102-")
    with pytest.raises(CardError, match="is for layout cube"):
        again.layout(find_layout("edges-12", 0.05))
    path.write_text(path.read_text().replace("version = 1", "version = 9"))
    with pytest.raises(CardError, match="file version 9, this program reads 1"):
        read_card(path)
    path.write_text("version = 1\nid = 'x'\n")
    with pytest.raises(CardError, match="not a whole calibration file"):
        read_card(path)


def test_logs_without_a_standstill_or_with_too_little_say_so(tmp_path):
    draw = np.random.default_rng(1)
    moving = np.cumsum(draw.normal(size=(600, 12)), axis=0)
    with pytest.raises(CalibrationError, match="no standstill"):
        find(moving, 0.01)
    with pytest.raises(CalibrationError, match="nothing to fit"):
        fit(CUBE, None)
    with pytest.raises(CalibrationError, match="no log"):
        calibrate([], CUBE, device="cube", date="2026-01-02T03:04:05Z")


def test_the_commands_from_logs_to_a_corrected_run(tmp_path):
    write(tmp_path, CUBE, seed=6, poses=9)
    runner = CliRunner()
    card = tmp_path / "card.toml"
    logs = [str(tmp_path / "poses.csv"), *(str(tmp_path / f"steps-{k}.csv") for k in (1, 2, 3))]
    made = runner.invoke(
        app, ["calibrate", "fit", *logs, "--out", str(card), "--device", "bench", "--json"]
    )
    assert made.exit_code == 0, made.output
    said = json.loads(made.stdout)
    assert said["fit"]["poses"] == 9 and said["fit"]["steps"] == 3 and said["advice"] == []
    truth = json.loads((tmp_path / "truth.json").read_text())
    found = read_card(card)
    np.testing.assert_allclose(found.bias, truth["bias_mps2"], atol=0.006)
    np.testing.assert_allclose(found.position_b, truth["position_b_m"], atol=1.5e-4)
    shown = runner.invoke(app, ["calibrate", "show", str(card)])
    assert found.id in shown.output and "a43" in shown.output
    out, layout = tmp_path / "corrected.csv", tmp_path / "calibrated.toml"
    written = ["--out", str(out), "--layout-out", str(layout)]
    applied = runner.invoke(
        app, ["calibrate", "apply", str(tmp_path / "run.csv"), str(card), *written]
    )
    assert applied.exit_code == 0, applied.output
    scores = []
    for options in (["run.csv", "--card", str(card)], ["corrected.csv", "--layout", str(layout)]):
        options += ["--estimators", "least-squares", "--json"]
        run = runner.invoke(app, ["run", str(tmp_path / options[0]), *options[1:]])
        scores.append(json.loads(run.stdout)["estimators"]["least-squares"]["rate_rms_radps"])
    np.testing.assert_allclose(scores[0], scores[1], rtol=0.02)
    bad = runner.invoke(app, ["calibrate", "show", str(tmp_path / "run.csv")])
    assert bad.exit_code != 0 and "no calibration file" in bad.output


def test_wrong_wiring_shows_in_the_residuals(devices):
    one = devices[0][0]
    readings = tumble(one, plan(9))[:, [1, 0, *range(2, 12)]]  # two axes swapped
    found, noise = find(readings, 0.01)
    swapped = fit(CUBE, collect(readings, found), noise=noise)
    crossed = np.abs(np.sum(swapped.direction * CUBE.theta_b, axis=1)) < 0.5
    assert list(np.nonzero(crossed)[0]) == [0, 1]  # it finds where they really point


def test_advice_names_what_is_missing(tmp_path):
    write(tmp_path, CUBE, seed=6, poses=6)
    made = calibrate([tmp_path / "poses.csv"], CUBE, device="cube", date="2026-01-02T03:04:05Z")
    assert any("positions are nominal" in line for line in advice(made))
    assert replace(made.card, steps=1).steps == 1
