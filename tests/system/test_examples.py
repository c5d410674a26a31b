"""Every example runs for real, as a person would run it, and says what it promises."""

import contextlib
import io
import json
import re
import subprocess
import sys
from pathlib import Path

import matplotlib
import matplotlib.pyplot
import numpy as np
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


NOTEBOOK = EXAMPLES / "first_look.ipynb"
NUMBER = re.compile(r" *\d+(?:\.\d+)?")
REMAKE = "the estimators say something else now: run the notebook anew and save it"


def cells() -> list[dict]:
    return json.loads(NOTEBOOK.read_text())["cells"]


def test_the_notebook_gives_what_it_shows(tmp_path, monkeypatch):
    """Its code, cell by cell as a kernel runs it: it prints what it holds, numbers nearly so."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("matplotlib.pyplot.show", lambda: None)
    matplotlib.use("Agg")
    names: dict[str, object] = {}
    drawn = 0
    for cell in cells():
        if cell["cell_type"] != "code":
            continue
        said = io.StringIO()
        with contextlib.redirect_stdout(said):
            exec(compile("".join(cell["source"]), NOTEBOOK.name, "exec"), names)
        shown = [one for one in cell["outputs"] if one["output_type"] == "stream"]
        held = "".join(text for one in shown for text in one["text"])
        assert NUMBER.sub("#", said.getvalue()) == NUMBER.sub("#", held)
        found, wanted = (
            np.array(NUMBER.findall(text), dtype=float) for text in (said.getvalue(), held)
        )
        np.testing.assert_allclose(found, wanted, rtol=0.2, atol=1.0, err_msg=REMAKE)
        pictures = len(matplotlib.pyplot.get_fignums())
        assert pictures == len(cell["outputs"]) - len(shown)
        drawn += pictures
        matplotlib.pyplot.close("all")
    assert drawn == 1


def test_the_notebook_is_small_and_has_no_path_of_a_machine():
    text = NOTEBOOK.read_text()
    assert len(text) < 60_000 and json.loads(text)["nbformat"] == 4
    assert not re.search(r'["\s=](/home|/tmp|/work|/root|/Users|C:\\)', text)
    counts = [cell["execution_count"] for cell in cells() if cell["cell_type"] == "code"]
    assert counts == [*range(1, len(counts) + 1)]
