"""`gyrofree run` on a cube's log: the result's form, its honesty about what cannot be known, and
named faults.
"""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from gyrofree.commands.main import app
from gyrofree.running import simulate_csv
from inertial.layouts.catalogue import find
from logs.cube import run_cube
from logs.cube_log import read_log
from logs.cube_score import nees_mean
from logs.sheet import LogError

NAMES = find("cube").axis_names
ENTRY = {
    "rate_rms_radps",
    "valid_share",
    "rate_rms_all_radps",
    "angle_error_final_rad",
    "bound_rate_rms_radps",
    "nees_mean",
    "us_per_sample",
}


@pytest.fixture(scope="module")
def published(tmp_path_factory):
    """The published test's log with its truth."""
    path = tmp_path_factory.mktemp("cube") / "cw-ccw.csv"
    assert simulate_csv.write(path, "cw-ccw", 3) == 3000
    return path


def rewritten(path, target, change, keep=None):
    """A copy of the log with `change` applied to the cells (header row 0), only some columns if
    `keep` says so.
    """
    rows = [line.split(",") for line in path.read_text().splitlines() if not line.startswith("#")]
    if keep is not None:
        columns = [k for k, name in enumerate(rows[0]) if keep(name)]
        rows = [[row[k] for k in columns] for row in rows]
    rows = change(rows) or rows
    target.write_text("\n".join(",".join(row) for row in rows) + "\n")
    return target


def test_result_has_the_published_form_and_beats_integration(published, tmp_path):
    plot = tmp_path / "run.png"
    result = run_cube(published, estimators=["least-squares", "products-ekf"], plot=plot)
    assert json.loads(json.dumps(result)).keys() >= {"estimators", "default", "gaps", "axes"}
    assert result["default"] == "products-ekf"
    for entry in result["estimators"].values():
        assert entry.keys() == ENTRY
        assert len(entry["rate_rms_radps"]) == len(entry["bound_rate_rms_radps"]) == 3
        assert entry["us_per_sample"] > 0.0
    products, integral = result["estimators"]["products-ekf"], result["estimators"]["least-squares"]
    assert max(products["rate_rms_radps"]) < np.deg2rad(2.0) < max(integral["rate_rms_all_radps"])
    assert products["angle_error_final_rad"] < np.deg2rad(8.0)
    # of what it calls valid alone: integration soon says that it does not know
    assert max(integral["rate_rms_radps"]) < np.deg2rad(3.0) and max(integral["valid_share"]) < 0.2
    assert integral["angle_error_final_rad"] is None and min(products["valid_share"]) > 0.9
    assert 0.3 < products["nees_mean"] < 9.0
    assert set(result["axes"]) == set(NAMES)
    assert {axis["state"] for axis in result["axes"].values()} == {"good"}
    assert plot.read_bytes().startswith(b"\x89PNG") and plot.stat().st_size > 50_000


def test_without_truth_only_what_the_tachometer_knows(published, tmp_path):
    log = rewritten(
        published,
        tmp_path / "tacho.csv",
        lambda rows: None,
        lambda name: not name.startswith("true_"),
    )
    entry = run_cube(log, estimators=["products-ekf"])["estimators"]["products-ekf"]
    assert entry["rate_rms_radps"][:2] == [None, None]
    assert entry["rate_rms_radps"][2] < np.deg2rad(2.5)
    assert entry["nees_mean"] is None and entry["angle_error_final_rad"] < np.deg2rad(9.0)
    log = rewritten(
        log, tmp_path / "bare.csv", lambda rows: rows[:1200], lambda name: name != "tacho_rad_s"
    )
    bare = run_cube(log, estimators=["products-ekf"])
    assert bare["estimators"]["products-ekf"]["rate_rms_radps"] == [None] * 3
    assert any("nothing to score against" in note for note in bare["notes"])


def test_gap_is_counted_named_and_survived(published, tmp_path):
    log = rewritten(published, tmp_path / "gap.csv", lambda rows: rows[:901] + rows[909:])
    result = run_cube(log, estimators=["products-ekf"])
    gap = result["gaps"]["list"][0]
    assert (result["gaps"]["count"], result["gaps"]["missing_samples"]) == (1, 8)
    assert gap["line"] == 902 and gap["missing"] == 8 and gap["t_s"] == pytest.approx(8.99)
    assert max(result["estimators"]["products-ekf"]["rate_rms_radps"]) < np.deg2rad(2.5)


def test_metres_per_second_squared_are_the_same_as_counts(published, tmp_path):
    def scaled(rows):
        for row in rows[1:]:
            row[1:13] = [repr(float(cell) * 3.9e-3 * 9.80665) for cell in row[1:13]]
        rows[0] = [name.replace("_counts", "_mps2") for name in rows[0]]

    log = read_log(rewritten(published, tmp_path / "si.csv", scaled), NAMES)
    np.testing.assert_allclose(log.f_axis, read_log(published, NAMES, 3.9).f_axis, atol=1e-12)
    assert log.counts is None


@pytest.mark.parametrize(
    ("change", "wanted"),
    [
        (
            lambda rows: rows[700].__setitem__(5, "nan"),
            r":701: column 'a22_counts': 'nan' is no finite number.*leave",
        ),
        (lambda rows: rows[20].__setitem__(0, "x"), r":21: column 't_s': 'x' is no finite number"),
        (
            lambda rows: rows[9].__setitem__(3, "1.5"),
            r":10: column 'a13_counts': 1.5 is no whole number",
        ),
        (
            lambda rows: rows[50].__setitem__(0, "0.10"),
            r":51: column 't_s': time 0.100000 s after 0.480000 s does not rise.*sort",
        ),
        (
            lambda rows: rows[30].__delitem__(slice(4, None)),
            r":31: 4 cells, the header names 21: .*; complete the row",
        ),
        (
            lambda rows: rows[0].__setitem__(4, "b"),
            r":1: column 'a21_counts' is missing, found t_s.*--layout",
        ),
        (lambda rows: rows[0].__setitem__(0, "time"), r":1: column 't_s' is missing"),
        (
            lambda rows: rows[0].__setitem__(2, "a11_counts"),
            r":1: column 'a11_counts' stands there twice",
        ),
        (
            lambda rows: rows[0].__setitem__(15, "wy"),
            r":1: column 'true_wy' is missing beside 'true_wx'",
        ),
        (
            lambda rows: rows[5].__setitem__(17, "9"),
            r":6: true_qw ... true_qz have length .* normalise",
        ),
        (lambda rows: rows[:2], r": 1 samples; want at least two"),
    ],
)
def test_faults_are_named_by_row_and_column(published, tmp_path, change, wanted):
    with pytest.raises(LogError, match=wanted):
        read_log(rewritten(published, tmp_path / "bad.csv", change), NAMES)


def test_a_stuck_axis_is_named(published, tmp_path):
    def stuck(rows):
        for row in rows[1000:1400]:
            row[6] = "77"

    result = run_cube(
        rewritten(published, tmp_path / "stuck.csv", stuck), estimators=["least-squares"]
    )
    assert [name for name, axis in result["axes"].items() if axis["state"] != "good"] == ["a23"]
    assert result["axes"]["a23"]["longest_stuck_s"] == pytest.approx(4.0, abs=0.05)


@pytest.mark.parametrize("layout", ["nine", "edges-12"])
def test_other_layouts_run_or_say_why_not(tmp_path, layout):
    path = tmp_path / "log.csv"
    simulate_csv.write(path, "published", 2, layout)
    result = run_cube(path, layout=layout)
    for name, entry in result["estimators"].items():
        assert entry["us_per_sample"] is not None or any(
            note.startswith(f"{name}: ") for note in result["notes"]
        )
    with pytest.raises(LogError, match="--layout"):
        run_cube(path, layout="chen-6")


def test_nees_of_errors_drawn_from_the_covariance_is_three():
    draw = np.random.default_rng(5)
    root = np.array([[0.3, 0.0, 0.0], [0.1, 0.2, 0.0], [0.0, 0.05, 0.4]])
    error = draw.normal(size=(4000, 3)) @ root.T
    assert nees_mean(error, np.tile(root @ root.T, (4000, 1, 1))) == pytest.approx(3.0, abs=0.15)
    assert nees_mean(np.full((5, 3), np.nan), np.tile(np.eye(3), (5, 1, 1))) is None


def test_the_commands_print_json_and_one_line_of_what_is_wrong(tmp_path):
    path = tmp_path / "still.csv"
    runner = CliRunner()
    made = runner.invoke(app, ["simulate", "--csv", str(path), "--profile", "still", "--seed", "4"])
    assert made.exit_code == 0, made.output
    options = "--layout cube --half-side 0.05 --estimators products-ekf --json".split()
    done = runner.invoke(app, ["run", str(path), *options])
    assert json.loads(done.stdout)["estimators"]["products-ekf"]["rate_rms_radps"][2] < 0.05
    bad = runner.invoke(app, ["run", str(path), "--layout", "cuve", "--json"])
    assert bad.exit_code != 0 and "Traceback" not in bad.output
    bad = runner.invoke(app, ["simulate", "--csv", str(path), "--profile", "spin"])
    assert bad.exit_code != 0 and "want one of" in bad.output


def test_a_log_that_begins_while_turning_is_resolved_and_named_so(tmp_path):
    log = tmp_path / "turning.csv"
    simulate_csv.write(log, "turning", 3, "cube", 0.05)
    live = run_cube(log, estimators=["products-ekf"])["estimators"]["products-ekf"]
    result = run_cube(log, estimators=["products-ekf"], resolve=True)
    late = result["estimators"]["products-ekf+resolved"]
    assert late["rate_rms_radps"][2] < 0.06 < live["rate_rms_all_radps"][2]
    assert late["valid_share"][2] > 0.99 > live["valid_share"][2]
    assert any("corrected backwards" in note for note in result["notes"])


def test_a_rate_that_is_never_known_is_said(published, tmp_path):
    short = tmp_path / "short.csv"
    short.write_text("".join(published.open().readlines()[:102]))
    notes = run_cube(short, estimators=["products-ekf"])["notes"]
    assert any("its rate is not known in most of this log" in note for note in notes)
