"""The comparison of in-motion alignment filters again: the paper's tables in its form, and figures
of the horizon.

`gyrofree reproduce in-motion` calls reproduce(). The published numbers themselves cannot be
recovered from the text that is left of the paper, so what is reproduced is the experiment: the same
methods on drives with a known truth, in the conditions A to J of the comparison, and on a real
drive whose RTK fixes are the truth.
"""

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inertial.simulation.drive import CONDITIONS, Sensors, SimulatedDrive, Tuning, simulate
from logs.reproduce import in_motion, in_motion_draw, in_motion_real
from logs.reproduce.in_motion import Begin, Errors, Inputs

Array = NDArray[np.float64]
Progress = Callable[[float, str], None]

CALIBRATION = (101, 102)  # seeds of the drives that give the mean covariance; never scored
TOWN, HILL = 20.0, 90.0  # m of height change, the paper's two drives

NOTE = (
    "error: estimate minus truth, after the update. prediction: state carried to the next fix minus"
    " that fix. residual: estimate minus the fix just fed in; the published tables are believed to"
    " show this one."
)


def reproduce(
    out: Path, *, data: Path | None = None, seeds: int = 10, progress: Progress | None = None
) -> dict[str, Any]:
    """Run the comparison and write tables and figures to the folder `out`.

    data: the car_drive folder, or the folder that holds it; None: simulated drives only. seeds:
    drives per condition. Writes index.html, in-motion.md, in-motion.json and PNG figures; returns
    what in-motion.json holds: {"conditions": {A: {method: figures}}, "paper": {table: {method:
    {metric: {component: {mean, std}}}}}, "real": {...}, "files": [...]}. Raises ValueError for no
    seeds, or data that cannot be read.
    """
    if seeds < 1:
        raise ValueError(f"{seeds} seeds, want at least 1")
    folder = in_motion_real.find(data)
    out = Path(out)
    out.mkdir(parents=True, exist_ok=True)
    tell = progress or (lambda done, what: None)
    tell(0.0, "calibration drives")
    methods = in_motion.methods(mean_covariance())
    result: dict[str, Any] = {"seeds": seeds, "note": NOTE}
    result["conditions"] = compare(methods, seeds, lambda done, what: tell(0.02 + 0.7 * done, what))
    tell(0.72, "the paper's tables")
    result["paper"], horizons = paper_tables(methods, seeds)
    result["real"] = None
    if folder is not None:
        result["real"], horizon = in_motion_real.compare(
            folder, methods, min(seeds, 6), lambda done, what: tell(0.8 + 0.15 * done, what)
        )
        horizons["car_drive"] = horizon
    tell(0.96, "figures")
    files = [in_motion_draw.horizon(out, name, drive) for name, drive in horizons.items()]
    files.append(in_motion_draw.columns(out, result["conditions"]))
    text = in_motion_draw.markdown(result)
    (out / "in-motion.md").write_text(text, encoding="utf-8")
    (out / "index.html").write_text(in_motion_draw.page(text, files), encoding="utf-8")
    written = ("index.html", "in-motion.md", "in-motion.json")
    result["files"] = [str(file) for file in files] + [str(out / name) for name in written]
    (out / "in-motion.json").write_text(json.dumps(result, indent=1), encoding="utf-8")
    tell(1.0, "done")
    return result


def inputs_of(drive: SimulatedDrive) -> Inputs:
    """A simulated drive with its truth at the fixes."""
    rows, truth = [drive.row_of(fix.t) for fix in drive.fixes], drive.truth
    position = np.column_stack([truth.latitude[rows], truth.longitude[rows], truth.height[rows]])
    return Inputs(
        drive.imu, drive.fixes, position, truth.v_n[rows], truth.C_nb[rows], drive.lever_arm_b
    )


def mean_covariance(seeds: tuple[int, ...] = CALIBRATION) -> Array:
    """Time mean (15, 15) of the Kalman filter's covariance after its fixes, over the calibration
    drives.
    """
    means = []
    for seed in seeds:
        inputs = inputs_of(simulate(seed, "B"))
        kf = in_motion.plain("fpe-mean-n1", arrival="kf")
        _, memory = in_motion.run_with_memory(inputs, in_motion.align(inputs), kf, Tuning())
        means.append(memory.window.sum / memory.window.seen)
    return np.mean(means, axis=0)


def compare(
    methods: dict[str, Any], seeds: int, progress: Progress, columns: list[str] | None = None
) -> dict:
    """{condition: {method: figures}}: root mean square over the drives of each figure.

    A drive is simulated and aligned once for all conditions that share its sensors. The time until
    heading is within 3 degrees is the mean over the drives, in heading_settled_s.
    """
    columns = list(CONDITIONS) if columns is None else columns
    collected: dict[str, dict[str, list]] = {c: {m: [] for m in methods} for c in columns}
    for seed in range(1, seeds + 1):
        ready: dict[tuple[Sensors, tuple], tuple[Inputs, Begin]] = {}
        for k, column in enumerate(columns):
            progress(
                (seed - 1 + k / len(columns)) / seeds,
                f"drive {seed} of {seeds}, condition {column}",
            )
            condition = CONDITIONS[column]
            key = condition.sensors, condition.outages
            if key not in ready:
                inputs = inputs_of(simulate(seed, condition))
                ready[key] = inputs, in_motion.align(inputs)
            for name, method in methods.items():
                errors = in_motion.run(*ready[key], method, condition.tuning)
                collected[column][name].append(in_motion.figures(errors) | settled(errors))
    return {
        c: {m: _over_drives(rows) for m, rows in table.items()} for c, table in collected.items()
    }


def settled(errors: Errors, within: float = math.radians(3.0)) -> dict[str, float]:
    """Seconds from the start of navigation until the heading stays within 3 degrees for 10 s."""
    yaw = np.abs(np.array(errors.attitude_from_start)[:, 2])
    good = yaw < within
    for k in range(len(good) - 10):
        if good[k : k + 10].all():
            return {"heading_settled_s": errors.t_from_start[k]}
    return {"heading_settled_s": errors.t_from_start[-1]}


def _over_drives(rows: list[dict[str, float]]) -> dict[str, float]:
    result = {}
    for key in rows[0]:
        values = np.array([row[key] for row in rows])
        result[key] = float(np.mean(values))
    return result


def paper_tables(methods: dict[str, Any], seeds: int) -> tuple[dict[str, Any], dict[str, Errors]]:
    """Tables in the paper's form (town; fixed horizons; hill), and the fuzzy runs for its horizon
    figures.
    """
    wanted = {
        "town drive: Kalman filter and predictive estimator": (TOWN, ["KF", "FPE-P0 fuzzy"]),
        "town drive: fixed horizons": (TOWN, [m for m in methods if m.startswith("FPE-P0")]),
        "hill drive: Kalman filter and predictive estimator": (HILL, ["KF", "FPE-P0 fuzzy"]),
    }
    ready = {climb: _drive(climb) for climb in (TOWN, HILL)}
    runs: dict[tuple[float, str], Errors] = {}
    tables: dict[str, Any] = {}
    for title, (climb, names) in wanted.items():
        tables[title] = {}
        for name in names:
            if (climb, name) not in runs:
                runs[climb, name] = in_motion.run(*ready[climb], methods[name], Tuning())
            tables[title][name] = in_motion.paper_form(runs[climb, name])
    return tables, {"town": runs[TOWN, "FPE-P0 fuzzy"], "hill": runs[HILL, "FPE-P0 fuzzy"]}


def _drive(climb: float) -> tuple[Inputs, Begin]:
    inputs = inputs_of(simulate(1, "B", climb=climb))
    return inputs, in_motion.align(inputs)
