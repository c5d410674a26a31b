"""Logs of a simulated imperfect device on disk: a tumble, table steps in three mountings, a run
with its truth.
"""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np

from inertial.calibration.poses import plan
from inertial.layouts.layout import Layout
from inertial.simulation.imperfect import MOUNTINGS, Device, device, table_run, tumble
from inertial.whole_file import whole_files

TRUTH = ("true_wx", "true_wy", "true_wz", "true_qw", "true_qx", "true_qy", "true_qz")


def write(
    folder: Path,
    layout: Layout,
    seed: int,
    poses: int = 14,
    progress: Callable[[float, str], None] = lambda done, what: None,
) -> list[Path]:
    """Write the logs; returns their paths. Raises OSError, CalibrationError for a number of poses
    outside 6 to 24.
    """
    one = device(layout, seed)
    with whole_files(Path(folder)) as drafts:
        files = _logs(drafts, one, seed, poses, progress)
    return [Path(folder) / file.name for file in files]


def _logs(
    folder: Path, one: Device, seed: int, poses: int, progress: Callable[[float, str], None]
) -> list[Path]:
    progress(0.0, "poses")
    readings = tumble(one, plan(poses))
    files = [_log(folder / "poses.csv", one, np.arange(len(readings)) / 100.0, readings)]
    for k, mounting in enumerate(MOUNTINGS):
        progress(0.2 + 0.2 * k, f"table steps {k + 1}")
        run = table_run(one, mounting, seed=10 * seed + k)
        files.append(
            _log(
                folder / f"steps-{k + 1}.csv",
                one,
                run.t_s,
                run.readings,
                ("tacho_rad_s",),
                [run.tacho],
            )
        )
    progress(0.8, "run")
    run = table_run(one, profile="published", seed=10 * seed + 9)
    columns = [run.tacho, *run.omega_b.T, *run.q_nb.T]
    files.append(
        _log(folder / "run.csv", one, run.t_s, run.readings, ("tacho_rad_s", *TRUTH), columns)
    )
    truth = {
        "seed": seed,
        "bias_mps2": one.bias.tolist(),
        "scale": one.scale.tolist(),
        "direction_b": one.true.theta_b.tolist(),
        "position_b_m": one.true.r_b.tolist(),
    }
    path = folder / "truth.json"
    path.write_text(json.dumps(truth, indent=2))
    return [*files, path]


def _log(
    path: Path, one: Device, t_s: np.ndarray, readings: np.ndarray, names=(), columns=()
) -> Path:
    counts = np.rint(readings / one.off.count)
    table = np.column_stack([t_s, counts, *columns])
    head = ",".join(["t_s", *(f"{name}_counts" for name in one.nominal.axis_names), *names])
    form = ["%.4f"] + ["%d"] * counts.shape[1] + ["%.7f"] * len(columns)
    np.savetxt(path, table, fmt=form, delimiter=",", header=head, comments="")
    return path
