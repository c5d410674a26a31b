"""Figures of the calibration: simulated devices recovered, rates before and after, a real board
against its gyroscopes.

One JSON line per figure. The real board needs $GYROFREE_DATA or shared/data beside the checkout.
"""

import json
import os
import sys
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from inertial.calibration import model  # noqa: E402
from inertial.calibration.card import make_card  # noqa: E402
from inertial.calibration.fit import fit  # noqa: E402
from inertial.calibration.poses import collect, find, plan  # noqa: E402
from inertial.calibration.steps import blocks  # noqa: E402
from inertial.layouts.catalogue import find as find_layout  # noqa: E402
from inertial.rate.beliefs import make  # noqa: E402
from inertial.rate.estimators import ESTIMATORS  # noqa: E402
from inertial.simulation.imperfect import MOUNTINGS, device, table_run, tumble  # noqa: E402
from tests.support.array_log import calibrate_at_rest, read_array, score  # noqa: E402

SEEDS = range(1, int(os.environ.get("SEEDS", "10")) + 1)
DATE = "2026-01-02T00:00:00Z"


def line(name: str, value: object, unit: str = "") -> None:
    """One figure."""
    print(
        json.dumps({"bench": "calibration", "figure": name, "value": value, "unit": unit}),
        flush=True,
    )


def simulated() -> None:
    """Ten imperfect cubes: 14 poses and three mountings on the table each."""
    cube = find_layout("cube", 0.05)
    errors: dict[str, list] = {key: [] for key in ("bias", "scale", "direction", "position")}
    nees, seconds = [], []
    rms: dict[str, list] = {"before": [], "after": []}
    for seed in SEEDS:
        one = device(cube, seed)
        readings = tumble(one, plan(14))
        found, noise = find(readings, 0.01)
        runs = [
            table_run(one, mounting, seed=10 * seed + k) for k, mounting in enumerate(MOUNTINGS)
        ]
        steps = [blocks(run.t_s, run.readings, run.tacho, 0.01) for run in runs]
        started = time.perf_counter()
        solved = fit(cube, collect(readings, found), steps, noise=noise)
        seconds.append(time.perf_counter() - started)
        p = solved.parameters
        place, _ = model.places(cube)
        true_r = np.array([one.true.r_b[np.argmax(place == s)] for s in range(len(p.r))])
        errors["bias"].append(p.b - one.bias)
        errors["scale"].append(solved.scale - one.scale)
        errors["direction"].append(
            np.linalg.norm(np.cross(solved.direction, one.true.theta_b), axis=1)
        )
        errors["position"].append(p.r - true_r)
        error = np.concatenate([p.b - one.bias, (p.c - one.c).ravel(), (p.r - true_r).ravel()])
        values, vectors = np.linalg.eigh(solved.covariance[: len(error), : len(error)])
        free = values > 1e-10
        nees.append(float(np.mean((vectors.T @ error)[free] ** 2 / values[free])))
        card = make_card(solved, cube, cube.axis_names, device="cube", date=DATE)
        run = table_run(one, profile="published", seed=1000 + seed)
        for when, layout, values, known in (
            ("before", cube, run.readings, None),
            ("after", card.layout(cube), card.correct(run.readings), card),
        ):
            estimator = make(ESTIMATORS["products-ekf"], layout, known)
            said = [
                estimator.step(k, float(t), f).omega_b
                for k, (t, f) in enumerate(zip(run.t_s, values, strict=True))
            ]
            error = np.array(said) - run.omega_b
            rms[when].append(float(np.rad2deg(np.sqrt(np.mean(error**2, axis=0)).max())))
    scale = {
        "bias": (1e3 / 9.80665, "mg"),
        "scale": (100.0, "%"),
        "direction": (180 / np.pi, "deg"),
        "position": (1e3, "mm"),
    }
    for name, (factor, unit) in scale.items():
        line(
            f"{name} error, RMS over {len(SEEDS)} devices",
            round(float(np.sqrt(np.mean(np.square(errors[name])))) * factor, 5),
            unit,
        )
    line(
        "squared error over its covariance, mean per degree of freedom (1 is right, below is"
        " modest)",
        round(float(np.mean(nees)), 3),
    )
    line("fit of 14 poses and 3 table runs, median", round(float(np.median(seconds)), 3), "s")
    for when, values in rms.items():
        line(
            f"products-ekf on cw-ccw, worst-axis rate RMS {when} calibration, median",
            round(float(np.median(values)), 3),
            "deg/s",
        )
        line(
            f"products-ekf on cw-ccw, worst-axis rate RMS {when} calibration, worst",
            round(max(values), 3),
            "deg/s",
        )


def real() -> None:
    """accelerometer_array: static poses first, then scored on the violent part."""
    folder = Path(os.environ.get("GYROFREE_DATA", ROOT.parent / "shared" / "data"))
    path = folder / "accelerometer_array" / "exp_1.npz"
    if not path.is_file():
        line("real array", "not measured: set GYROFREE_DATA")
        return
    log, layout = read_array(path), find_layout("array-24")
    card, omega_b = calibrate_at_rest(log, layout, 470.0, DATE)
    line("array: poses found", card.poses)
    line(
        "array: residual of the poses after the fit",
        round(card.residual_rms * 1e3 / 9.80665, 3),
        "mg",
    )
    line(
        "array: largest bias found", round(float(np.abs(card.bias).max()) * 1e3 / 9.80665, 1), "mg"
    )
    violent = log.t_s > 488.0
    for name, use in (
        ("gyroscopes in range", violent & ~log.clipped),
        ("all samples, gyroscopes clipped too", violent),
    ):
        for when, shape, f in (
            ("before", layout, log.f_axis),
            ("after", card.layout(layout), card.correct(log.f_axis)),
        ):
            found = score(shape, f, omega_b, use)
            line(
                f"array: (w_x^2 + w_y^2)/2 + w_z^2 against the gyroscopes, {when} calibration,"
                f" {name}",
                {
                    "correlation": round(found.correlation, 4),
                    "slope": round(found.slope, 4),
                    "samples": found.samples,
                },
            )


if __name__ == "__main__":
    simulated()
    real()
