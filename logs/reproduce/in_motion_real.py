"""The comparison on a real drive: RTK fixes are the truth, and the filters get low-cost fixes made
of them at 1 Hz.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inertial.earth import radii
from inertial.navigation import results
from inertial.navigation.fix import AUTONOMOUS, RTK_FIXED, Fix, FixSettings, core_fix
from inertial.navigation.navigation import NavigatorConfig, first_leg
from inertial.simulation.drive import (
    OUTLIERS,
    REALISTIC,
    SAID_P,
    SAID_V,
    Sensors,
    Tuning,
    fix_errors,
)
from logs.reproduce import in_motion
from logs.reproduce.in_motion import Errors, Inputs
from logs.score import read_drive

Array = NDArray[np.float64]

FILES = "imu.csv", "gnss.csv"
REFERENCE = "attitude of a Kalman filter that is given every RTK fix"

CASES: dict[str, tuple[str, Sensors | None, Tuning]] = {
    "R1": ("1 Hz fixes of a low-cost receiver: RTK plus the noise of B", REALISTIC, Tuning()),
    "R2": ("R1 with 5 % gross fixes and bursts", OUTLIERS, Tuning()),
    "R3": (
        (
            "the RTK itself fed at 1 Hz and taken as the reference: in-sample, the error is the"
            " residual"
        ),
        None,
        Tuning(),
    ),
    "R4": ("R1, filter believes Q/100", REALISTIC, Tuning(q_scale=0.01)),
}


def find(data: Path | None) -> Path | None:
    """The folder with imu.csv and gnss.csv, or car_drive below it; raises ValueError where there is
    none.
    """
    if data is None:
        return None
    for folder in (Path(data), Path(data) / "car_drive"):
        if all((folder / name).is_file() for name in FILES):
            return folder
    raise ValueError(
        f"{data}: no drive; want a folder with {' and '.join(FILES)}, or one that holds car_drive/"
    )


def compare(
    folder: Path, methods: dict[str, Any], seeds: int, progress: Callable[[float, str], None]
) -> tuple[dict[str, Any], Errors]:
    """{case: {"text", "methods": {method: figures}}}, and the fuzzy run of R1 for the picture of
    its horizon.
    """
    drive = read_drive(folder / FILES[0], folder / FILES[1])
    second = [k for k, fix in enumerate(drive.fixes) if fix.quality == RTK_FIXED and _whole(fix.t)]
    attitude = reference(drive)
    truth = [drive.fixes[k] for k in second]
    C_nb = attitude[second]
    result, pictured = {}, Errors()
    for c, (case, (text, sensors, tuning)) in enumerate(CASES.items()):
        rows: dict[str, list] = {name: [] for name in methods}
        draws = 1 if sensors is None else seeds
        for seed in range(1, draws + 1):
            progress(
                (c + (seed - 1) / draws) / len(CASES), f"car_drive {case}, noise {seed} of {draws}"
            )
            inputs = low_cost(drive.imu, truth, C_nb, sensors, seed)
            begin = in_motion.align(inputs)
            for name, method in methods.items():
                errors = in_motion.run(inputs, begin, method, tuning)
                rows[name].append(in_motion.figures(errors))
                if (case, seed, name) == ("R1", 1, "FPE-P0 fuzzy"):
                    pictured = errors
        averages = {
            n: {k: float(np.nanmean([row[k] for row in r])) for k in r[0]} for n, r in rows.items()
        }
        result[case] = {"text": text, "seeds": draws, "reference": REFERENCE, "methods": averages}
    return result, pictured


def _whole(t: float) -> bool:
    return abs(t - round(t)) < 0.01


def low_cost(
    imu: Array, truth: list[Fix], C_nb: Array, sensors: Sensors | None, seed: int
) -> Inputs:
    """The drive with fixes of a worse receiver; sensors None: the RTK fixes as they are. The IMU is
    at the antenna.
    """
    position = np.array([(f.latitude, f.longitude, f.height) for f in truth])
    v_n = np.array([f.v_n for f in truth])
    fixes = [
        replace(f, sigma_p=np.maximum(f.sigma_p, 0.02), sigma_v=np.maximum(f.sigma_v, 0.1))
        for f in truth
    ]
    if sensors is not None:
        error, _ = fix_errors(np.random.default_rng([seed, 20]), len(truth), sensors)
        meridian, normal = radii(position[:, 0])
        shift = np.column_stack(
            [
                error[:, 0] / (meridian + position[:, 2]),
                error[:, 1] / ((normal + position[:, 2]) * np.cos(position[:, 0])),
                error[:, 2],
            ]
        )
        fixes = [
            replace(
                f,
                latitude=p[0],
                longitude=p[1],
                height=p[2],
                v_n=v,
                quality=AUTONOMOUS,
                sigma_p=np.array(SAID_P),
                sigma_v=np.array(SAID_V),
            )
            for f, p, v in zip(truth, position + shift, v_n + error[:, 3:], strict=True)
        ]
    return Inputs(imu, fixes, position, v_n, C_nb)


def reference(drive: Any) -> Array:
    """C_nb (k, 3, 3) at every fix of the drive, by a Kalman filter that is given all of them."""
    unknown = np.full((len(drive.fixes), 3), np.nan)
    inputs = Inputs(drive.imu, drive.fixes, unknown, unknown, None)
    begin = in_motion.align(inputs)
    config, chosen = NavigatorConfig(), in_motion.plain("kf")
    leg = first_leg(config, chosen, begin.start, drive.fixes[begin.fix])
    model = chosen.model(config.imu)
    given = [core_fix(f, FixSettings()) for f in drive.fixes[begin.fix + 1 :]]
    settings = chosen.settings(FixSettings(), (0.0, 0.0, 0.0))
    memory = chosen.memory(leg.P, begin.still_f)
    imu = np.ascontiguousarray(drive.imu)
    out = results.run(leg, model, settings, memory, imu, begin.sample, len(imu), given)
    C_nb = np.full((len(drive.fixes), 3, 3), math.nan)
    C_nb[begin.fix + 1 :] = out["x"]["C_nb"]
    return C_nb
