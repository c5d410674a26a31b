"""Attitude on logs: figures on real trials, the documented CSV, and what is said of logs that
cannot be used.
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from logs.attitude import inclination_error, run_attitude
from logs.attitude_log import SAMPLES, TRUTH
from logs.sheet import LogError

HEADER = ",".join(SAMPLES + TRUTH)


def rows(up: float) -> np.ndarray:
    """Ten seconds of a slow swing; the reference's z points down (up = -1) or up (+1)."""
    t = np.arange(1000) / 100.0
    to_n = Rotation.from_rotvec(np.outer(0.4 * np.sin(t), [1.0, 0.0, 0.0]))
    f = to_n.inv().apply([0.0, 0.0, -9.81])
    w = np.column_stack([0.4 * np.cos(t), np.zeros((len(t), 2))])
    frame = (
        Rotation.identity()
        if up < 0
        else Rotation.from_quat([np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0])
    )
    return np.column_stack([t, f, w, (frame * to_n).as_quat()[:, [3, 0, 1, 2]]])


def write(path, table, header=HEADER):
    np.savetxt(path, table, delimiter=",", header=header, comments="", fmt="%.9g")
    return path


def test_real_trials_with_optical_truth(data_dir):
    result = run_attitude(data_dir / "attitude_optical")
    assert len(result["logs"]) == 3
    filters = result["filters"]
    assert result["default"] == "vqf"
    assert np.degrees(filters["vqf"]["inclination_rms_rad"]) < 0.75
    assert (
        max(
            np.degrees(log["filters"]["vqf"]["inclination_rms_rad"])
            for log in result["logs"].values()
        )
        < 0.75
    )
    # what a fixed weight costs, and what the third gyro is worth
    assert (
        filters["tilt-published"]["inclination_rms_rad"]
        > filters["tilt-vector"]["inclination_rms_rad"]
    )
    assert filters["tilt-vector"]["inclination_rms_rad"] > filters["vqf"]["inclination_rms_rad"]


@pytest.mark.parametrize("up", [-1.0, 1.0])
def test_the_reference_may_point_up_or_down(tmp_path, up):
    log = write(tmp_path / "swing.csv", rows(up))
    plot = tmp_path / "errors.png"
    seen = []
    result = run_attitude(log, plot=plot, progress=lambda done, what: seen.append(done))
    assert np.degrees(result["filters"]["vqf"]["inclination_rms_rad"]) < 0.3
    assert plot.stat().st_size > 10_000
    assert seen == sorted(seen) and seen[-1] == 1.0


def test_rows_without_reference_are_not_scored(tmp_path):
    table = rows(-1.0)
    table[500:, 7:] = np.nan
    result = run_attitude(write(tmp_path / "half.csv", table), filters=["tilt-vector"])
    assert result["logs"]["half"]["scored"] == 500
    assert list(result["filters"]) == ["tilt-vector"]


def test_inclination_does_not_see_heading():
    q = Rotation.from_euler("ZYX", [[0.0, 0.2, 0.1], [2.0, 0.2, 0.1]]).as_quat()[:, [3, 0, 1, 2]]
    up = np.tile(Rotation.from_euler("ZYX", [0.0, 0.2, 0.1]).inv().apply([0.0, 0.0, -1.0]), (2, 1))
    np.testing.assert_allclose(inclination_error(q, up), 0.0, atol=1e-9)
    np.testing.assert_allclose(
        inclination_error(np.array([[1.0, 0.0, 0.0, 0.0]]), np.array([[0.0, 1.0, 0.0]])), np.pi / 2
    )


@pytest.mark.parametrize(
    ("spoil", "complaint"),
    [
        (lambda t: t[:1], "want at least two"),
        (lambda t: np.where(np.arange(len(t))[:, None] == 7, np.nan, t), ":9: column 't_s'"),
        (
            lambda t: np.column_stack([t[:, :7], np.full((len(t), 4), np.nan)]),
            "no row has a reference",
        ),
    ],
)
def test_a_damaged_log_is_refused_with_its_reason(tmp_path, spoil, complaint):
    with pytest.raises(LogError, match=complaint):
        run_attitude(write(tmp_path / "bad.csv", spoil(rows(-1.0))))


@pytest.mark.parametrize(
    ("lost", "limit_deg", "said"),
    [
        ([], 0.3, ""),
        ([300, 301, 500], 0.3, "3 samples are missing"),
        (range(300, 400), 3.0, "100 s"),
    ],
)
def test_missing_samples_are_bridged_and_after_a_hole_a_filter_starts_anew(
    tmp_path, lost, limit_deg, said
):
    table = np.delete(rows(-1.0), list(lost), axis=0)
    result = run_attitude(write(tmp_path / "swing.csv", table), filters=["vqf"])
    assert np.degrees(result["filters"]["vqf"]["inclination_rms_rad"]) < limit_deg
    assert result["logs"]["swing"]["samples"] == len(table)
    assert said in " ".join(result["notes"])


def test_wrong_names_and_files_are_refused_with_the_right_ones(tmp_path):
    with pytest.raises(LogError, match="want some of vqf, tilt-vector, tilt-published"):
        run_attitude(write(tmp_path / "swing.csv", rows(-1.0)), filters=["madgwick"])
    with pytest.raises(LogError, match="column 'wx_radps' is missing"):
        run_attitude(write(tmp_path / "less.csv", rows(-1.0)[:, :4], "t_s,fx_mps2,fy_mps2,fz_mps2"))
    with pytest.raises(LogError, match="no .csv or .mat files"):
        (tmp_path / "nothing").mkdir()
        run_attitude(tmp_path / "nothing")
    with pytest.raises(LogError, match="not a MATLAB 5 file"):
        (tmp_path / "x.mat").write_bytes(b"no such thing" * 30)
        run_attitude(tmp_path / "x.mat")
