"""Kinds of logs that people bring, by the commands that they give: one log written in many ways has
one answer, and what cannot be used is named with file, line, column, unit and remedy.
"""

import json

import numpy as np
import pytest
from support.broken_files import GNSS_HEADER, IMU_HEADER
from typer.testing import CliRunner

from gyrofree.commands.main import app
from gyrofree.running.simulate_csv import write

EKF = "products-ekf"


@pytest.fixture(scope="module")
def lines(tmp_path_factory):
    """A cube's log of 12 s, header first."""
    path = tmp_path_factory.mktemp("log") / "log.csv"
    write(path, "published", 3, "cube", 0.05)
    return [text for text in path.read_text().splitlines() if not text.startswith("#")][:1201]


def gyrofree(*arguments):
    result = CliRunner().invoke(app, [str(word) for word in arguments])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result


def rates(path):
    """RMS of the rate's error, rad/s, and the whole result, by `gyrofree run`."""
    result = gyrofree("run", path, "--estimators", EKF, "--json")
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)
    return np.array(found["estimators"][EKF]["rate_rms_radps"]), found


def times(lines, change):
    """The log with other time stamps: change(t, k) as text."""
    head, *rows = lines
    parts = [row.split(",", 1) for row in rows]
    return [head, *(f"{change(float(t), k)},{rest}" for k, (t, rest) in enumerate(parts))]


def quoted(lines):
    return [",".join(f'"{cell}"' for cell in line.split(",")) for line in lines]


def semicolons(lines):
    return [lines[0].replace(",", ";"), *(x.replace(",", ";").replace(".", ",") for x in lines[1:])]


def milliseconds(t, k):
    return f"{t * 1e3:.1f}"


def nanoseconds(t, k):
    return f"{round(t * 1e9)}"


def renamed(name, lines):
    """The log with another name of its first column."""
    return [name + lines[0][len("t_s") :], *lines[1:]]


SAME = {
    "bom": lambda x: ("\n".join(x), "utf-8-sig"),
    "utf-16": lambda x: ("\n".join(x), "utf-16"),
    "crlf": lambda x: ("\r\n".join(x), "ascii"),
    "quoted": lambda x: ("\n".join(quoted(x)), "ascii"),
    "comments": lambda x: ("\n".join(["# Messung für März", "", *x[:9], "# x", *x[9:]]), "cp1252"),
    "semicolons": lambda x: ("\n".join(semicolons(x)), "ascii"),
    "trigger": lambda x: ("\n".join(times(x, lambda t, k: f"{t - 2.0:.4f}")), "ascii"),
    "unix": lambda x: ("\n".join(times(x, lambda t, k: f"{t + 1.7e9:.4f}")), "ascii"),
    "ms": lambda x: (
        "\n".join(["t_ms" + x[0][3:], *times(x, lambda t, k: f"{t * 1e3:.1f}")[1:]]),
        "ascii",
    ),
    "ns": lambda x: ("\n".join(renamed("t_ns", times(x, nanoseconds))), "ascii"),
}


@pytest.mark.parametrize("way", SAME)
def test_a_log_has_one_answer_however_it_is_written(lines, tmp_path, way):
    plain, spoilt = tmp_path / "plain.csv", tmp_path / "Messung (1) #2.csv"
    plain.write_text("\n".join(lines))
    text, encoding = SAME[way](lines)
    spoilt.write_bytes(text.encode(encoding))
    wanted, found = rates(plain)[0], rates(spoilt)
    np.testing.assert_allclose(found[0], wanted, rtol=2e-3)
    assert found[1]["gaps"]["missing_samples"] == 0
    config = tmp_path / "gyrofree.toml"
    config.write_text(f'[recorder]\nroot = "{tmp_path}/sessions"\n')
    made = gyrofree("import", spoilt, "--device", "cube", "--config", config)
    assert made.exit_code == 0, made.output
    shown = gyrofree("sessions", "show", made.stdout.split()[-1], "--json", "--config", config)
    keys = json.loads(shown.stdout)["keys"]
    assert keys["gyrofree/cube/accel"]["messages"] == 1200
    assert keys["gyrofree/cube/accel"]["lost"] == 0


def test_stamps_that_jitter_or_are_coarse_cost_nothing_and_every_tenth_little(lines, tmp_path):
    rng = np.random.default_rng(4)
    path = tmp_path / "log.csv"
    path.write_text("\n".join(times(lines, lambda t, k: f"{t + rng.uniform(-0.004, 0.004):.6f}")))
    rms, found = rates(path)
    assert found["gaps"]["missing_samples"] == 0 and rms.max() < 0.03
    path.write_text("\n".join(lines[:1] + [x for k, x in enumerate(lines[1:]) if k % 10 != 5]))
    rms, found = rates(path)
    assert found["gaps"]["missing_samples"] == 120 and rms.max() < 0.03


def spoilt_counts(lines, factor):
    head, *rows = lines
    table = [row.split(",") for row in rows]
    return [
        head,
        *(
            ",".join([r[0], *(str(round(int(c) * factor)) for c in r[1:13]), *r[13:]])
            for r in table
        ),
    ]


REFUSED = {
    "resolution": (lambda x: spoilt_counts(x, 0.125), ["0.126 g", "--lsb-mg 31.2"]),
    "ms in t_s": (lambda x: times(x, milliseconds), ["t_ms", "100 Hz"]),
    "ns in t_s": (lambda x: times(x, nanoseconds), ["t_ns", "100 Hz"]),
    "nan": (
        lambda x: [*x[:70], x[70].replace(x[70].split(",")[1], "nan", 1), *x[71:]],
        [":71:", "'nan'"],
    ),
    "equal stamps": (
        lambda x: times(x, lambda t, k: f"{t:.1f}"),
        [":3:", "'t_s'", "does not rise"],
    ),
    "ragged": (lambda x: [*x[:50], x[50].rpartition(",")[0], *x[51:]], [":51:", "cells"]),
}


@pytest.mark.parametrize("kind", REFUSED)
@pytest.mark.parametrize("command", ["run", "import"])
def test_what_cannot_be_right_is_named_with_its_place_and_remedy(lines, tmp_path, command, kind):
    change, words = REFUSED[kind]
    path = tmp_path / "log.csv"
    path.write_text("\n".join(change(lines)))
    config = ["--config", tmp_path / "none.toml"] if command == "import" else []
    (tmp_path / "none.toml").write_text(f'[recorder]\nroot = "{tmp_path}/s"\n')
    result = gyrofree(command, path, *config)
    assert result.exit_code == 2 and len(result.stderr.strip().splitlines()) == 1, result.output
    for word in (str(path), *words):
        assert word in result.stderr, result.stderr


def drive(folder, quality, unit=1.0):
    """A car that stands for 20 s and turns its head a little."""
    folder.mkdir()
    t = np.arange(2000) / 100.0
    rate = 0.3 * np.sin(t)
    tilt = 0.3 * (1.0 - np.cos(t))
    f = np.column_stack([0.0 * t, -9.81 * np.sin(tilt), -9.81 * np.cos(tilt)])
    w = np.column_stack([rate, 0.0 * t, 0.0 * t]) * unit
    np.savetxt(
        folder / "imu.csv", np.column_stack([t, f, w]), "%.9g", ",", header=IMU_HEADER, comments=""
    )
    rows = [f"{k / 4},49,11,300,{quality},0.02,0.02,0.03,0,0,0" for k in range(80)]
    (folder / "gnss.csv").write_text("\n".join([GNSS_HEADER, *rows]))
    return folder


def test_degrees_in_a_column_of_radians_are_named(tmp_path):
    result = gyrofree("run", drive(tmp_path / "d", 1, 180.0 / np.pi))
    assert result.exit_code == 2 and "deg/s" in result.stderr and "_degps" in result.stderr


def test_epochs_of_every_quality_are_used_and_empty_ones_named(tmp_path):
    assert "are not used" not in gyrofree("run", drive(tmp_path / "sbas", 3)).output
    result = gyrofree("run", drive(tmp_path / "empty", ""))
    for word in ("gnss.csv:2", "80 of 80 epochs are not used", "empty", "want 1 fixed"):
        assert word in result.output, result.output


def test_a_device_name_that_no_key_can_have_is_named(lines, tmp_path):
    (tmp_path / "log.csv").write_text("\n".join(lines))
    result = gyrofree("import", tmp_path / "log.csv", "--device", "Cube 1")
    assert result.exit_code == 2 and "'Cube 1'" in result.stderr and "want a-z" in result.stderr
