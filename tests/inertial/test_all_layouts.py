"""Every products filter on every layout of the catalogue: finite, never begun anew, and as sure as
it may be.
"""

import numpy as np
import pytest

from inertial.layouts.catalogue import LAYOUTS, find
from inertial.rate.estimators import ESTIMATORS
from inertial.simulation.table import TableTest


@pytest.mark.parametrize("name", ["products-ekf", "products-ukf", "products-rls", "products-mhe"])
@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_turn_is_followed_on_every_layout(layout, name):
    shape = find(layout, 0.05)
    table = TableTest(1, layout=shape)
    blocks = [table.block(k) for k in range(2)]
    t_s, readings, omega = (
        np.concatenate([getattr(b, k) for b in blocks]) for k in ("t_s", "readings", "omega_b")
    )
    track = ESTIMATORS[name](shape).run_batch(t_s, readings)
    assert np.isfinite(track.omega_b).all() and np.isfinite(track.P).all()
    assert track.started[130:].all(), "began anew"
    error = track.omega_b - omega
    limit = (
        150.0 if name == "products-rls" else 13.0
    )  # forgetting where nothing but integration is left
    assert np.rad2deg(np.sqrt(np.mean(error**2, axis=0))).max() < limit
    if name == "products-rls":
        return  # no noise model, no honest covariance
    turning = np.flatnonzero(~track.still[600:]) + 600
    nees = np.einsum(
        "ki,kij,kj->k", error[turning], np.linalg.inv(track.P[turning]), error[turning]
    )
    # 2.4 is right; moving horizon uses its window's samples more than once
    assert np.median(nees) < (60.0 if name == "products-mhe" else 10.0)
