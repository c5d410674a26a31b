"""The command line for sessions, as processes: what a person types, what comes out, which exit
code.
"""

import json
import shutil
import subprocess
import sys

import duckdb
import pytest
from support.table_session import SESSION, table_root

from sessions.library.annotations import FILE
from sessions.library.catalogue import Catalogue
from sessions.library.remove import Retention, too_many


@pytest.fixture(scope="module")
def home(tmp_path_factory):
    folder = tmp_path_factory.mktemp("home")
    shutil.copytree(table_root(), folder / "sessions")
    (folder / "gyrofree.toml").write_text(
        '[recorder]\nroot = "sessions"\n[estimator]\nrate = ["least-squares"]\n'
    )
    return folder


def gyrofree(home, *arguments, code=0):
    done = subprocess.run(
        [sys.executable, "-m", "gyrofree", *arguments],
        cwd=home,
        capture_output=True,
        text=True,
        timeout=280,
    )
    assert done.returncode == code, done.stderr
    assert "Traceback" not in done.stderr
    return done


def test_list_show_and_verify(home):
    (row,) = json.loads(gyrofree(home, "sessions", "list", "--json").stdout)
    assert (row["id"], row["state"], row["completeness"]) == (SESSION, "closed", 1.0)
    assert SESSION in gyrofree(home, "sessions", "list").stdout
    assert json.loads(gyrofree(home, "sessions", "show", SESSION, "--json").stdout)["sha256"]
    found = json.loads(gyrofree(home, "sessions", "verify", SESSION, "--json").stdout)
    assert found["ok"] and found["messages"] == found["counted"] > 6000


def test_verify_finds_a_changed_byte(home, tmp_path):
    shutil.copytree(home / "sessions", tmp_path / "sessions")
    shutil.copy(home / "gyrofree.toml", tmp_path)
    path = tmp_path / "sessions" / SESSION / "recording.mcap"
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    found = json.loads(gyrofree(tmp_path, "sessions", "verify", SESSION, "--json", code=1).stdout)
    assert found["hash_ok"] is False and not found["ok"]


def test_notes_and_tags_leave_the_recording_alone(home):
    gyrofree(home, "sessions", "note", SESSION, "it was nudged", "--at", "12.5", "--author", "anna")
    gyrofree(home, "sessions", "tag", SESSION, "--add", "keep", "--title", "First")
    assert "12.50 s  anna: it was nudged" in gyrofree(home, "sessions", "show", SESSION).stdout
    assert json.loads(gyrofree(home, "sessions", "list", "--search", "keep", "--json").stdout)
    assert json.loads(gyrofree(home, "sessions", "list", "--search", "drop", "--json").stdout) == []
    gyrofree(home, "sessions", "tag", SESSION, "--outcome", "splendid", code=2)
    gyrofree(home, "sessions", "verify", SESSION)


def test_report_in_a_folder_and_its_exit_code(home):
    (home / "easy.toml").write_text("[limits.rate_rms_z_dps]\nmax = 100\n")
    assert (
        "verdict: pass"
        in gyrofree(home, "report", SESSION, "--spec", "easy.toml", "--out", "rep").stdout
    )
    assert {path.name for path in (home / "rep").iterdir()} == {
        "report.html",
        "report.pdf",
        "report.json",
    }
    (home / "hard.toml").write_text("[limits.rate_rms_z_dps]\nmax = 0.0001\n")
    report = json.loads(
        gyrofree(home, "report", SESSION, "--spec", "hard.toml", "--json", code=1).stdout
    )
    assert report["verdict"] == "fail" and report["checks"][0]["passed"] is False
    said = gyrofree(home, "report", SESSION, "--spec", "none.toml", code=2).stderr
    assert "none.toml" in said and "No such file" in said


def test_rerun_with_another_estimator_stands_beside_the_old_one(home):
    new = gyrofree(
        home, "rerun", SESSION, "--estimators", "least-squares", "--name", "again"
    ).stdout.strip()
    assert new == f"{SESSION}-again"
    keys = json.loads(gyrofree(home, "sessions", "show", new, "--json").stdout)["keys"]
    old, again = (
        keys[f"gyrofree/cube/rate/{name}"] for name in ("least-squares", "least-squares-again")
    )
    assert old["messages"] == again["messages"] > 2000
    gyrofree(home, "sessions", "delete", new, "--yes")
    said = gyrofree(home, "rerun", SESSION, "--estimators", "no-such", code=2).stderr
    assert "no estimator 'no-such'" in said


def test_reprocess_gives_one_table_that_duckdb_reads(home):
    gyrofree(home, "reprocess", "--out", "all.parquet", "--jobs", "1")
    rows = duckdb.sql(
        f"select session, estimator, rate_rms_z_radps, problem from '{home}/all.parquet'"
    ).fetchall()
    assert [row[:2] for row in rows] == [(SESSION, "least-squares")]
    assert rows[0][2] > 0.01 and rows[0][3] == ""


def test_sessions_that_are_kept_survive_every_rule(home):
    catalogue = Catalogue(home / "sessions")
    folder = home / "sessions" / SESSION
    rule = Retention(days=1.0)
    (folder / FILE).unlink(missing_ok=True)
    assert [info.id for info in too_many(catalogue, rule)] == [SESSION]
    gyrofree(home, "sessions", "tag", SESSION, "--add", "keep")
    assert too_many(catalogue, rule) == [] == too_many(catalogue, Retention(max_bytes=10))
    gyrofree(home, "sessions", "retain", "--days", "1", "--yes")
    assert folder.is_dir()


def test_import_makes_a_session_of_a_log(home):
    rows = ["t_s,fx_mps2,fy_mps2,fz_mps2,wx_radps,wy_radps,wz_radps"]
    rows += [f"{k / 100:.2f},0.01,0.02,-9.8,0.001,0.0,0.0" for k in range(300)]
    (home / "imu.csv").write_text("\n".join(rows) + "\n")
    session = gyrofree(home, "import", "imu.csv", "--device", "car").stdout.strip()
    keys = json.loads(gyrofree(home, "sessions", "show", session, "--json").stdout)["keys"]
    assert keys["gyrofree/car/imu"]["messages"] == 300
    (home / "bad.csv").write_text("t_s,fx\n0,1\n")
    assert "bad.csv" in gyrofree(home, "import", "bad.csv", code=2).stderr


def test_reprocess_on_a_dask_scheduler_gives_the_same_rows(home):
    from distributed import LocalCluster

    from sessions.replay.reprocess import run_all

    paths = [home / "sessions" / SESSION / "recording.mcap"] * 2
    here = [rows for rows in run_all(paths, sizes, jobs=1)]
    with LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None
    ) as cluster:
        there = [rows for rows in run_all(paths, sizes, scheduler=cluster.scheduler_address)]
    strip = lambda many: sorted((row["session"], row["samples"]) for rows in many for row in rows)  # noqa: E731
    assert strip(here) == strip(there) and len(strip(there)) == 2


def sizes(path):
    """Work that a cluster does: a row of a file."""
    return [{"session": path.parent.name, "samples": path.stat().st_size}]
