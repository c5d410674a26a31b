"""`gyrofree run`: what it prints fits the terminal and never says 0 for unknown; what it writes."""

import json

import numpy as np
import pyarrow.csv
import pyarrow.parquet as pq
import pytest
from typer.testing import CliRunner

from gyrofree.commands.main import app
from gyrofree.commands.run_tables import DASH, number, percent, three
from gyrofree.running import simulate_csv

RUN = CliRunner()


@pytest.fixture(scope="module")
def published(tmp_path_factory):
    path = tmp_path_factory.mktemp("series") / "cw-ccw.csv"
    simulate_csv.write(path, "cw-ccw", 3)
    return path


@pytest.mark.parametrize("rows", [2, 10, 60])
def test_a_log_too_short_to_know_anything_says_so_and_fails(published, tmp_path, rows):
    log = tmp_path / "short.csv"
    lines = [line for line in published.open() if not line.startswith("#")]
    log.write_text("".join(lines[: rows + 1]))
    done = RUN.invoke(app, ["run", str(log), "--estimators", "products-ekf,least-squares"])
    assert done.exit_code == 1, done.output
    assert "none is valid" in done.stdout and "rate error RMS" in done.stdout
    row = next(line for line in done.stdout.splitlines() if line.startswith("products-ekf*"))
    assert row.split()[1:4] == ["0", DASH, DASH]  # valid %, rate, angle
    found = json.loads(RUN.invoke(app, ["run", str(log), "--json"]).stdout)["estimators"]
    for entry in found.values():
        assert entry["rate_rms_radps"] == [None] * 3 and entry["valid_share"] == [0.0] * 3
        assert entry["nees_mean"] is None and entry["angle_error_final_rad"] is None


def test_the_table_fits_a_terminal_and_is_in_degrees(published):
    done = RUN.invoke(app, ["run", str(published)])
    assert done.exit_code == 0, done.output
    lines = done.stdout.splitlines()
    table = lines[: next(k for k, line in enumerate(lines) if line.startswith("* "))]
    assert max(map(len, table)) <= 80 and "deg/s" in "".join(table)
    row = next(line for line in table if line.startswith("products-ekf*")).split()
    found = json.loads(RUN.invoke(app, ["run", str(published), "--json"]).stdout)
    wanted = np.degrees(found["estimators"]["products-ekf"]["rate_rms_radps"])
    np.testing.assert_allclose([float(cell) for cell in row[-6:-3]], wanted, rtol=6e-3)
    assert any(line.startswith("least-squares: most of its rate is unknown") for line in lines)


@pytest.mark.parametrize("form", ["csv", "parquet"])
def test_every_estimators_series_is_written_with_its_flags(published, tmp_path, form):
    out = tmp_path / f"series.{form}"
    done = RUN.invoke(app, ["run", str(published), "--out", str(out), "--json"])
    assert done.exit_code == 0, done.output
    result = json.loads(done.stdout)
    options = pyarrow.csv.ConvertOptions(strings_can_be_null=True)
    table = (
        pq.read_table(out)
        if form == "parquet"
        else pyarrow.csv.read_csv(out, convert_options=options)
    )
    assert len(table) == result["written"]["rows"] == 3000 * len(result["estimators"])
    of = {name: table[name].to_numpy() for name in table.column_names}
    for name, entry in result["estimators"].items():
        mine = of["estimator"] == name
        valid = of["valid_z"][mine] == 1
        assert valid.mean() == pytest.approx(entry["valid_share"][2])
        assert ((of["sight_z"][mine] == "valid") == valid).all()
        error = (of["wz_radps"] - of["reference_wz_radps"])[mine][valid].astype(float)
        assert np.sqrt(np.mean(error**2)) == pytest.approx(entry["rate_rms_radps"][2])
        unknown = np.isnan(of["wz_radps"][mine].astype(float))
        assert unknown.any() and not (unknown & valid).any()  # empty until it began, never 0


def test_a_file_of_another_kind_or_place_is_refused_before_the_work(published, tmp_path):
    for out in (tmp_path / "a.txt", tmp_path / "none" / "a.csv"):
        done = RUN.invoke(app, ["run", str(published), "--out", str(out)])
        assert done.exit_code == 2 and "--out" in done.output and not out.exists()


def test_numbers_for_a_person():
    assert number(None) == number(float("nan")) == DASH
    assert number(0.0) == "0" and number(4e-5) == "4.0e-05" and number(123.456) == "123"
    assert number(0.0999999) == "0.1000" or number(0.0999999) == "0.100"
    assert three([None, None, 1.0]) == "- - 1.00" and three([None] * 3) == DASH == three(None)
    assert percent([0.0] * 3) == "0" and percent([1e-4, 0.9999, 1.0]) == "<1 >99 100"
