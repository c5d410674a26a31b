"""Navigation on a cube's own rate through the live pipeline, where it works and where it does not:
JSON lines.

An arm of 3 m that turns at 70 to 130 deg/s, receiver of 0.3 m and 0.1 m/s twice a second, one fix
in two held back; and a town drive (condition B), likewise one fix in two held back. RMS from 25 s
on: position and velocity against the truth, heading, and the held-back fixes. 10 cm cube, sensors
as published (20 mg, 0.5 %) or calibrated.

    python tests/bench/bench_gyro_free_navigation.py [seeds]
"""

import json
import logging
import sys
from pathlib import Path

import numpy as np

sys.path[:0] = [
    str(Path(__file__).resolve().parent.parent.parent),
    str(Path(__file__).resolve().parent.parent),
]

from support.gyro_free_rig import (  # noqa: E402
    COS,
    LATITUDE,
    LONGITUDE,
    METRES,
    SETTINGS,
    car_messages,
    heading_error,
    messages,
)

from estimator.pipeline import Pipeline  # noqa: E402
from estimator.settings import EstimatorSettings  # noqa: E402
from inertial.constants import MILLI_G  # noqa: E402
from inertial.simulation.arm import centre  # noqa: E402
from inertial.simulation.drive import simulate  # noqa: E402
from inertial.simulation.table import SensorModel  # noqa: E402
from messages.contract.topics import INNOVATION, NAV  # noqa: E402

PUBLISHED = SensorModel()
CALIBRATED = SensorModel(bias=2.0 * MILLI_G, scale_error=0.0005)
FROM_S = 25.0
FILTERS = ["huber", "huber-nhc"]


def run(sent: list, filters: list[str]) -> dict[str, dict[str, list]]:
    """Solutions and errors on the held-back fixes of every filter."""
    pipeline = Pipeline(EstimatorSettings(**SETTINGS | {"gyro_free_navigation": filters}))
    found: dict[str, dict[str, list]] = {}
    for topic, message in sent:
        for out in pipeline.on(topic, message):
            m = out.message
            if out.topic not in (NAV, INNOVATION) or m.header.device_us < FROM_S * 1e6:
                continue
            entry = found.setdefault(out.estimator, {"nav": [], "unseen": []})
            if out.topic is NAV:
                entry["nav"].append(m)
            elif len(m.error_to_reference):
                entry["unseen"].append(m.error_to_reference[:2])
    return found


def rms(rows: list) -> float:
    """RMS of vectors' lengths."""
    return round(float(np.sqrt(np.mean(np.sum(np.square(rows), axis=1)))), 2)


def arm(seed: int, sensor: SensorModel) -> dict[str, dict[str, float]]:
    """The arm with every filter that has no wheels."""
    test, sent = messages(88.0, seed=seed, sensor=sensor)
    out = {}
    for name, entry in run(sent, FILTERS[:1]).items():
        p, v, turn = [], [], []
        for m in entry["nav"]:
            t = m.header.device_us * 1e-6
            true_p, true_v = centre(test, t)
            p.append(
                [
                    (m.latitude_deg - LATITUDE) * METRES - true_p[0],
                    (m.longitude_deg - LONGITUDE) * METRES * COS - true_p[1],
                ]
            )
            v.append(np.array(m.v_n_mps)[:2] - true_v[:2])
            turn.append([heading_error(test, t, m.q_nb)])
        out[name] = {
            "position_m": rms(p),
            "velocity_mps": rms(v),
            "heading_deg": rms(np.degrees(turn)),
            "unseen_m": rms(entry["unseen"]),
        }
    return out


def car(seed: int, sensor: SensorModel, half_side: float) -> dict[str, dict[str, float]]:
    """A town drive of 150 s."""
    drive = simulate(seed, "B", seconds=150.0)
    out = {}
    for name, entry in run(car_messages(drive, half_side, sensor, seed), FILTERS).items():
        p, v = [], []
        for m in entry["nav"]:
            k = drive.row_of(m.header.device_us * 1e-6)
            p.append(
                [
                    (np.radians(m.latitude_deg) - drive.truth.latitude[k]) * 6.36e6,
                    (np.radians(m.longitude_deg) - drive.truth.longitude[k]) * 6.36e6 * COS,
                ]
            )
            v.append(np.array(m.v_n_mps)[:2] - drive.truth.v_n[k][:2])
        out[name] = {"position_m": rms(p), "velocity_mps": rms(v), "unseen_m": rms(entry["unseen"])}
    return out


def main() -> None:
    """Print the figures, medians over seeds."""
    logging.disable(logging.WARNING)
    seeds = range(1, 1 + (int(sys.argv[1]) if len(sys.argv) > 1 else 3))
    cases = {
        "arm, sensors as published": lambda seed: arm(seed, PUBLISHED),
        "arm, sensors calibrated": lambda seed: arm(seed, CALIBRATED),
        "car, sensors calibrated": lambda seed: car(seed, CALIBRATED, 0.05),
    }
    for case, made in cases.items():
        runs = [made(seed) for seed in seeds]
        for name in runs[0]:
            median = {
                key: float(np.median([run[name][key] for run in runs])) for key in runs[0][name]
            }
            worst = {
                f"{key}_worst": float(max(run[name][key] for run in runs))
                for key in ("position_m",)
            }
            print(
                json.dumps(
                    {
                        "bench": "gyro_free_navigation",
                        "case": case,
                        "filter": name,
                        "seeds": len(seeds),
                        **median,
                        **worst,
                    }
                ),
                flush=True,
            )


if __name__ == "__main__":
    main()
