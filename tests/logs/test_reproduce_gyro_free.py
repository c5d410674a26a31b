"""The published test's figures and table: the paper's own arithmetic, a simulated session, a
recorded one.
"""

import json

import numpy as np
import pytest

from gyrofree.running import simulate_csv
from inertial.constants import MILLI_G
from inertial.layouts.catalogue import find
from inertial.rate.field import cube_angular_acceleration, cube_specific_force
from logs.reproduce import gyro_free_study as study
from logs.reproduce.gyro_free import reproduce


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    out = tmp_path_factory.mktemp("reproduce")
    return out, reproduce(out, seed=1)


def test_table_1_is_recovered_to_a_tenth_of_a_mg_and_drift_is_ours_below_the_papers_way(made):
    _, result = made
    table = result["table_1_bias_mg"]
    assert table["paper"] == [4.2, 2.5, 5.4] and table["told_apart_from_tilt"]
    np.testing.assert_allclose(table["ours"], table["true"], atol=0.25)
    ours, papers = result["estimators"]["products-ekf"], result["estimators"]["least-squares"]
    assert ours["navigated_s"] == pytest.approx(30.0, abs=0.05)
    assert ours["omega_z_rms_deg_per_s"] < 0.2 * papers["omega_z_rms_deg_per_s"]
    assert np.linalg.norm(ours["position_error_m"]) < 0.1 * np.linalg.norm(
        papers["position_error_m"]
    )
    assert result["drift_deg_per_h"]["products-ekf"] < result["drift_deg_per_h"]["least-squares"]


def test_everything_is_written(made):
    out, result = made
    assert json.loads((out / "result.json").read_text()) == result
    page = (out / "index.html").read_text()
    assert len(result["figures"]) == 7
    for one in result["figures"]:
        assert one["file"] in page
        assert (out / one["file"]).read_bytes().startswith(b"\x89PNG")


def test_equations_25_26_and_27(made):
    layout, draw = find("cube", 0.05), np.random.default_rng(3)
    a = draw.normal(size=12)
    np.testing.assert_allclose(
        layout.S @ a, np.r_[cube_angular_acceleration(a, 0.1), cube_specific_force(a)]
    )
    # 30 deg/h beside Table 1: 1/2 b t^2 is 18.5 11.0 23.8 m, the drift adds 1/6 d g t^3 = 6.4 m
    bias = np.array(study.PAPER_BIAS_MG) * MILLI_G
    error = study.closed_form(bias, study.paper_drift(), np.array([30.0]))[0]
    np.testing.assert_allclose(error, [18.54 + 6.42, 11.03, 23.83], atol=0.01)
    assert study.drift_of(error, bias, 30.0) * study.PER_HOUR == pytest.approx(30.0)


def test_a_recorded_session_without_truth(made, tmp_path):
    log = tmp_path / "bench.csv"
    simulate_csv.write(log, "cw-ccw", 2)
    rows = [line.split(",") for line in log.read_text().splitlines()[1:]]
    log.write_text("\n".join(",".join(row[:14]) for row in rows) + "\n")
    result = reproduce(tmp_path / "out", session=log)
    assert result["reference"] == "tachometer" and result["table_1_bias_mg"]["true"] is None
    assert (
        result["estimators"]["products-ekf"]["omega_z_rms_deg_per_s"] < 5.0
    )  # a bad seed, and the tachometer lags
    assert "bench.csv" in (tmp_path / "out" / "index.html").read_text()
