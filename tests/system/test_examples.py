"""Every example runs for real, as a person would run it, and says what it promises."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "examples"
SAYS = {  # example -> a part of what it prints
    "add_rate_estimator.py": "the zero-velocity update takes",
    "add_wire_frame.py": "damaged: cobs, 35 bytes",
    "live_values.py": "0.00 - 114.59 deg/s",
    "read_recording.py": "deg/s RMS against the tachometer",
    "run_log.py": "the worst is least-squares",
    "subscribe_to_rates.py": "products-ekf: ",
}


@pytest.mark.parametrize("name", sorted(SAYS))
def test_an_example_runs_and_shows_what_it_promises(name, tmp_path):
    done = subprocess.run(
        [sys.executable, str(EXAMPLES / name)],
        cwd=tmp_path,
        env={"PATH": "/usr/bin:/bin", "PYTHONPATH": str(ROOT), "HOME": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    assert SAYS[name] in done.stdout


def test_every_example_is_run_here_and_can_be_read_at_once():
    files = {path.name: path.read_text().splitlines() for path in EXAMPLES.glob("*.py")}
    assert set(files) == set(SAYS)
    for name, lines in files.items():
        assert 30 <= len(lines) <= 100, name
        assert lines[0].startswith('"""') and lines[0].endswith("."), f"{name}: one sentence first"
        assert any(line.startswith("def main(") for line in lines), name


def test_run_log_draws_its_picture(tmp_path):
    sys.path.insert(0, str(EXAMPLES))
    try:
        import run_log
    finally:
        sys.path.remove(str(EXAMPLES))
    found = run_log.main(picture=tmp_path / "run.png")
    assert (tmp_path / "run.png").stat().st_size > 20_000
    assert (found["products-ekf"] < 1.2).all() and found["least-squares"].max() > 3.0
