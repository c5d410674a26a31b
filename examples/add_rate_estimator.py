"""Add a rate estimator of one's own and run it beside the built-in ones on a simulated log.

Shown: what an estimator has to offer (RateEstimator in inertial/rate/estimators.py: made of a
layout, fed with batches, it answers with columns), its entry in the table of estimators, and its
score. This one takes the paper's integration, which drifts, and sets the rate to zero whenever the
zero-velocity detector says that the cube stands; from then on what had drifted is left out. In the
product the class is an entry of ESTIMATORS, and CONTRIBUTING.md names what else wants to know it.

    python examples/add_rate_estimator.py
"""

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gyrofree.running.simulate_csv import write
from inertial.layouts.layout import Layout
from inertial.rate.batch import RateColumns
from inertial.rate.estimators import ESTIMATORS, LeastSquaresRate
from logs.cube import run_cube

Array = NDArray[np.float64]


class ZeroVelocityRate(LeastSquaresRate):
    """Least squares and Runge-Kutta, with a zero-velocity update of the rate."""

    name = "least-squares-zupt"

    def __init__(self, layout: Layout, calibration: str = "") -> None:
        """Raises GeometryError when the layout cannot see angular acceleration."""
        super().__init__(layout, calibration=calibration)
        self._drift_b = np.zeros(3)  # rad/s, of the integrated rate at the last standstill
        self._angle = 0.0  # rad, about z_b, that the drift has made
        self._before_s = np.nan

    def feed(self, t_s: Array, f_axis: Array) -> RateColumns:
        """Readings (n, axes), m/s^2, at times (n,), s; the columns after each of them."""
        columns = super().feed(t_s, f_axis)
        omega_b, angle_z = columns.omega_b.copy(), columns.angle_z.copy()
        for k, t in enumerate(t_s):
            if columns.still[k]:
                self._drift_b = columns.omega_b[k].copy()
            if np.isfinite(self._before_s):
                self._angle += self._drift_b[2] * (t - self._before_s)
            self._before_s = float(t)
            omega_b[k] -= self._drift_b
            angle_z[k] -= self._angle
        return replace(columns, omega_b=omega_b, angle_z=angle_z)


def main() -> dict[str, Array]:
    """RMS of the error of all that an estimator said, deg/s, axes x y z of the cube."""
    ESTIMATORS[ZeroVelocityRate.name] = ZeroVelocityRate
    names = ["least-squares", ZeroVelocityRate.name]
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log.csv"
        write(log, profile="published", seed=1, layout="cube", half_side_m=0.05)
        result = run_cube(log, estimators=names, half_side_m=0.05)
    found = {name: np.degrees(result["estimators"][name]["rate_rms_all_radps"]) for name in names}
    for name, (x, y, z) in found.items():
        print(f"{name:18} error of the rate {x:6.2f} {y:6.2f} {z:6.2f} deg/s RMS (x y z)")
    better = 1.0 - np.linalg.norm(found[names[1]]) / np.linalg.norm(found[names[0]])
    print(f"the zero-velocity update takes {better:.0%} of the error away")
    return found


if __name__ == "__main__":
    main()
