"""The calibration on a real board: eight MPU-9150, twenty poses by hand, then turned as fast as the
gyroscopes go.
"""

import numpy as np
import pytest
from support.array_log import RATE_QUADRATIC, calibrate_at_rest, combination, read_array, score

from inertial.layouts.catalogue import find
from inertial.layouts.layout import GeometryError

STILL_S, VIOLENT_S = 470.0, 488.0


@pytest.fixture(scope="module")
def array(data_dir):
    return read_array(data_dir / "accelerometer_array" / "exp_1.npz")


def test_static_poses_then_the_violent_part(array):
    layout = find("array-24")
    card, omega_b = calibrate_at_rest(array, layout, STILL_S, "2026-01-02T00:00:00Z")
    assert card.poses >= 18
    assert card.residual_rms < 0.004  # 0.4 mg over all poses, from offsets of up to 65 mg
    assert np.abs(card.bias).max() > 0.5
    assert (card.observed[:, :4]).all() and not card.observed[:, 4:].any()
    use = (array.t_s > VIOLENT_S) & ~array.clipped
    after = score(card.layout(layout), card.correct(array.f_axis), omega_b, use)
    assert after.samples > 5000
    assert after.correlation >= 0.985
    assert after.slope == pytest.approx(1.0, abs=0.02)


def test_the_flat_board_says_what_it_cannot_see():
    layout = find("array-24")
    combination(layout, RATE_QUADRATIC)
    flat = type(layout)("flat", layout.r_b * [1.0, 1.0, 0.0], layout.theta_b, layout.scale_m)
    with pytest.raises(GeometryError, match="does not see"):
        combination(flat, np.eye(12)[11] - np.eye(12)[6])


def test_a_file_of_another_form_is_refused(tmp_path):
    path = tmp_path / "x.npz"
    np.savez(path, raw=np.zeros(3))
    with pytest.raises(ValueError, match="is missing"):
        read_array(path)
