"""The mechanisation against its exact inverse."""

import numpy as np
from support.estimator_drive import DT, exact

from inertial.core import navigation as core
from inertial.earth import ned_between
from inertial.navigation.error_model import ImuNoise, make_model
from inertial.rotation import euler_matrix
from tests.inertial.twins.strapdown import step


def test_closure_over_120_s() -> None:
    truth, imu = exact(120.0, ba=np.array([0.1, -0.2, 0.05]), bg=np.array([0.01, 0.002, -0.004]))
    x = truth[0]
    for row in imu:
        x = step(x, row[1:4], row[4:7], DT)
    end = truth[-1]
    assert np.abs(ned_between(end.place, x.place)).max() < 1e-8
    assert np.abs(x.v_n - end.v_n).max() < 3e-10
    assert np.abs(x.C_nb - end.C_nb).max() < 1e-12


def test_closing_an_interval_takes_out_rounding_of_the_attitude() -> None:
    leg, model = core.new_leg(15), make_model(ImuNoise())
    leg.x.C_nb = euler_matrix(0.3, -0.2, 2.0) * (1.0 + 1e-6)
    leg.run(model, np.array([[0.01, 0.0, 0.0, -9.8, 0.0, 0.0, 0.0]]))
    leg.close(model)
    C_nb = leg.x.C_nb
    assert np.abs(C_nb @ C_nb.T - np.eye(3)).max() < 1e-11
