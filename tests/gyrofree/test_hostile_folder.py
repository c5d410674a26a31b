"""What a person keeps in the working folder is never executed by a process of the product."""

import io
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from rich.console import Console
from support.table_session import table_recording
from support.waiting import until

from dashboard.web import readings
from dashboard.web.control import ProcessReplay
from dashboard.web.jobs import Jobs
from gyrofree.running.process import command
from gyrofree.running.supervisor import Supervisor

NAMES = "estimator messages numpy gateway inertial sessions logs dashboard gyrofree zenoh typer"
PATIENCE = 120.0  # s; generous, the tests wait for states


@pytest.fixture
def hostile(tmp_path, monkeypatch):
    """The working folder, with modules that bear our names and leave a mark when imported."""
    folder = tmp_path / "hostile"
    folder.mkdir()
    for name in NAMES.split():
        path = folder / f"{name}.py"
        path.write_text(f"open({str(folder / 'executed')!r}, 'a').write({name!r} + ' ')\n")
    monkeypatch.chdir(folder)
    yield folder
    assert not (folder / "executed").exists(), (folder / "executed").read_text()


def test_the_folder_is_hostile_without_protection(tmp_path):
    """The trap works: a plain `python -m` falls into it."""
    (tmp_path / "numpy.py").write_text("raise SystemExit(7)\n")
    words = [sys.executable, "-m", "sessions.library.curves_build"]
    assert subprocess.run(words, cwd=tmp_path, timeout=60).returncode == 7


def test_services_below_the_supervisor_start_in_it(hostile, free_port, tmp_path):
    config = tmp_path / "gyrofree.toml"
    config.write_text(
        f'[bus]\nrouter = "tcp/127.0.0.1:{free_port}"\nlisten = ["tcp/127.0.0.1:{free_port}"]\n'
        f'[gateway]\njournal = "{tmp_path}/journal"\n[recorder]\nroot = "{tmp_path}/sessions"\n'
        'auto_start = true\n[estimator]\nrate = ["least-squares"]\n'
        'navigators = ["kf"]\nattitudes = ["vqf"]\n'
    )
    text = io.StringIO()
    supervisor = Supervisor(Console(file=text, width=200))
    for name in ("router", "gateway", "estimator", "record"):
        supervisor.add(name, name, "--config", str(config))
    supervisor.start()
    said = ("nothing to read", "estimating: ", "recording ")
    try:

        def ready():
            supervisor.step()
            assert supervisor.fatal is None, text.getvalue()
            return all(word in text.getvalue() for word in said)

        until(ready, text.getvalue)
        assert [child.restarts for child in supervisor.children] == [0] * 4, text.getvalue()
    finally:
        supervisor.stop()


def test_jobs_and_replays_of_the_pages_run_in_it(hostile, tmp_path):
    config = tmp_path / "gyrofree.toml"
    config.write_text(f'[recorder]\nroot = "{tmp_path}/sessions"\n')
    jobs = Jobs(command())
    job = jobs.start(
        "list", "s", ["sessions", "list", "--config", str(config)], "otto", makes="session"
    )
    until(lambda: job.state in ("done", "failed"), lambda: job.state)
    jobs.close()
    assert job.state == "done", job.message
    replay = ProcessReplay(command("replay", "--help"), look_s=PATIENCE)
    replay.start(Path("recording.mcap"), 1.0)  # raises where the process ends with an error


def test_recordings_are_read_in_it(hostile, tmp_path, monkeypatch):
    path = tmp_path / "recording.mcap"
    shutil.copy(table_recording(), path)
    monkeypatch.setattr(readings, "SHORT", 0)  # as a long one is: by a process of its own
    reader = readings.Readings()

    def read():
        curves, reading = reader.get(path)
        assert reading is None or not reading.fault, reading.fault
        return curves is not None and not curves.coarse

    until(read, lambda: "the curves")
    reader.close()


def test_the_command_line_started_with_python_m_runs_in_it(hostile):
    (hostile / "gyrofree.py").unlink()  # by that name it would be asked for
    words = [sys.executable, "-m", "gyrofree", "sessions", "--help"]
    done = subprocess.run(words, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
