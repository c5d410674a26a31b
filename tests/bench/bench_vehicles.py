"""Is the default navigator right in any vehicle, not only in a car? One JSON line per vehicle.

Cars, a minute without fixes in a city, an aircraft, a walker, a rolling body (simulated, five
seeds): RMS of position (m, and at the end of the outage), heading and tilt (deg) against the truth
from 60 s after the start, of the default filter and the plain one, their ratio (wanted: at most
1.2), the share of fixes refused, and NEES per component of position (wanted: about 1).
Usage: python tests/bench/bench_vehicles.py [seeds] [vehicle ...]
"""

import json
import sys
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from inertial.navigation.filters import DEFAULT  # noqa: E402
from inertial.navigation.navigation import NAVIGATORS, Mode, NavigatorConfig  # noqa: E402
from inertial.simulation.vehicles import VEHICLES, travel  # noqa: E402

PLAIN = "kf"
SETTLED_S = 60.0
METRES = 6_371_000.0  # per rad, near enough for an error


def errors(name: str, drive) -> dict[str, np.ndarray]:
    """Errors of one filter at every tenth sample from SETTLED_S on, fed as it would be live."""
    navigator = NAVIGATORS[name](NavigatorConfig(lever_arm_b=drive.lever_arm_b))
    fixes, pending = iter(drive.fixes), None
    pending = next(fixes, None)
    position, heading, tilt, nees, times = [], [], [], [], []
    for k, row in enumerate(drive.imu):
        t = float(row[0])
        while pending is not None and pending.arrival <= t:
            if not pending.withheld:
                navigator.fix(pending)
            pending = next(fixes, None)
        navigator.imu(t, row[1:4].copy(), row[4:7].copy())
        if k % 10 or t < SETTLED_S or navigator.mode != Mode.NAVIGATING:
            continue
        at, s = drive.row_of(t), navigator.solution()
        truth = drive.truth
        p = np.array(
            [
                (s.latitude - truth.latitude[at]) * METRES,
                (s.longitude - truth.longitude[at]) * METRES * np.cos(truth.latitude[at]),
                truth.height[at] - s.height,
            ]
        )
        turn = (
            Rotation.from_quat(s.q_nb, scalar_first=True).as_matrix() @ truth.C_nb[at].T
        )  # error rotation in n
        position.append(p)
        heading.append(np.arctan2(turn[1, 0] - turn[0, 1], turn[0, 0] + turn[1, 1]))
        tilt.append(np.hypot(turn[0, 2], turn[1, 2]))
        nees.append(p**2 / np.diag(s.position_covariance))
        times.append(t)
    return {
        "t": np.array(times),
        "position": np.array(position).reshape(-1, 3),
        "heading": np.degrees(heading),
        "tilt": np.degrees(tilt),
        "nees": np.array(nees),
        "refused": navigator.counts.get("rejected", 0) / max(1, sum(navigator.counts.values())),
    }


def figures(vehicle: str, seeds: int) -> dict:
    """Root of the mean square over all seeds, default and plain beside each other."""
    out: dict = {}
    pooled: dict[str, dict[str, list]] = {DEFAULT: {}, PLAIN: {}}
    for seed in range(1, seeds + 1):
        drive = travel(vehicle, seed)
        for name in (DEFAULT, PLAIN):
            e = errors(name, drive)
            kept = pooled[name]
            for key, value in (
                ("position_m", np.linalg.norm(e["position"], axis=1)),
                ("heading_deg", e["heading"]),
                ("tilt_deg", e["tilt"]),
            ):
                kept.setdefault(key, []).append(
                    float(np.sqrt(np.mean(value**2))) if len(value) else np.nan
                )
            kept.setdefault("nees", []).append(
                float(np.mean(e["nees"])) if len(e["nees"]) else np.nan
            )
            kept.setdefault("refused", []).append(e["refused"])
    for key in ("position_m", "heading_deg", "tilt_deg"):
        by_default, by_plain = (
            np.sqrt(np.mean(np.square(pooled[n][key]))) for n in (DEFAULT, PLAIN)
        )
        out[key] = [round(float(by_default), 2), round(float(by_plain), 2)]
        out[f"{key}_ratio"] = round(float(by_default / by_plain), 2)
    for key in ("nees", "refused"):
        out[key] = [round(float(np.mean(pooled[n][key])), 2) for n in (DEFAULT, PLAIN)]
    return {key: None if value != value else value for key, value in out.items()}


def main() -> None:
    """All figures."""
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 5
    for vehicle in sys.argv[2:] or ("car", "city", *VEHICLES):
        print(
            json.dumps(
                {
                    "bench": "vehicles",
                    "vehicle": vehicle,
                    "seeds": seeds,
                    "filters": [DEFAULT, PLAIN],
                }
                | figures(vehicle, seeds)
            ),
            flush=True,
        )


if __name__ == "__main__":
    main()
