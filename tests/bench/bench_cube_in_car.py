"""How well a cube of 10 cm side sees the turns of a car: rate error on a simulated drive, sensors
without errors.

One line of JSON per setting of the products filter; deg/s, body axes x y z, from 20 s after the
start.

    python tests/bench/bench_cube_in_car.py
"""

import json

import numpy as np

from inertial.layouts.catalogue import CUBE
from inertial.rate import products_ekf
from inertial.rate.estimators import ProductsRate
from inertial.simulation.drive import simulate
from inertial.simulation.table import IDEAL
from tests.support.cube_drive import cube_readings

SETTINGS = {
    "as on a table": {},
    "free axis": {"fixed_axis": False},
    "free axis, no gravity aid": {"fixed_axis": False, "gravity_aid": False},
}
START = 2000  # samples


def main() -> None:
    """Print the figures."""
    drive = simulate(4, "A", seconds=90.0)
    readings = cube_readings(drive, CUBE(0.05), IDEAL, seed=4)
    truth = drive.truth.omega_ib_b[1 : len(readings) + 1]
    turns = np.degrees(np.sqrt((truth[START:] ** 2).mean(axis=0)))
    for name, setting in SETTINGS.items():
        estimator = ProductsRate(CUBE(0.05), products_ekf.Config(**setting))
        omega = np.array(
            [
                estimator.step(k, float(drive.imu[k, 0]), row).omega_b
                for k, row in enumerate(readings)
            ]
        )
        error = np.degrees(np.sqrt(((omega - truth)[START:] ** 2).mean(axis=0)))
        found = {"bench": "cube_in_car", "setting": name, "error_dps": error.round(2).tolist()}
        print(json.dumps(found | {"car_turns_dps": turns.round(2).tolist()}))


if __name__ == "__main__":
    main()
