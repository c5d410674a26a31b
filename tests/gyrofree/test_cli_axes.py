"""`gyrofree calibrate axes` on logs of a board turned by hand."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from gyrofree.commands.main import app
from inertial.attitude.axis_map import read_map
from inertial.simulation.hand import GUIDED, AnalogueWiring, guided, misread


def write(path, names, columns):
    t = np.arange(len(columns)) * 0.01
    np.savetxt(
        path,
        np.column_stack([t, columns]),
        delimiter=",",
        header=",".join(["t_s", *names]),
        comments="",
    )
    return path


def call(*arguments):
    result = CliRunner().invoke(app, ["calibrate", "axes", *map(str, arguments)])
    return result.exit_code, result.output


def test_a_log_in_si_units_gives_the_map(tmp_path):
    force, rate, _ = guided(2)
    columns = np.hstack(
        [misread(force, (2, 0, 1), (1, 1, -1)), misread(rate, (0, 1, 2), (-1, 1, -1))]
    )
    log = write(
        tmp_path / "turns.csv",
        [
            f"{a}_{u}"
            for a, u in zip(
                ("fx", "fy", "fz", "wx", "wy", "wz"), ["mps2"] * 3 + ["radps"] * 3, strict=True
            )
        ],
        columns,
    )
    code, out = call(log, "--json", "--out", tmp_path / "map.toml", "--device", "drone")
    said = json.loads(out)
    assert code == 0 and said["device"] == "drone"
    found = {one["axis"]: (one["column"], one["sign"]) for one in said["axes"]}
    assert found == {
        "force x": (1, 1),
        "force y": (2, -1),
        "force z": (0, 1),
        "rate x": (3, -1),
        "rate y": (4, 1),
        "rate z": (5, -1),
    }
    f_b, omega_b = read_map(tmp_path / "map.toml").apply(columns)
    np.testing.assert_allclose(f_b, force, atol=1e-6)
    np.testing.assert_allclose(omega_b, rate, atol=1e-6)
    assert [t["about"] for t in said["turns"]] == ["y", "x", "z"]
    code, out = call(log)
    assert code == 0 and "force z" in out and "by accelerometer" in out


def test_counts_of_a_converter_give_the_gateways_wiring(tmp_path):
    wiring = AnalogueWiring((4, 1, 0, 2, 3), (1, -1, 1, 1, -1))
    force, rate, _ = guided(4, GUIDED[:5])
    log = write(
        tmp_path / "turns.csv", [f"in{k}_counts" for k in range(5)], wiring.counts(force, rate)
    )
    code, out = call(log, "--json")
    toml = json.loads(out)["gateway_toml"]
    assert code == 0 and "accel_x = { channel = 4, invert = false }" in toml
    assert "gyro_yz = { channel = 3, invert = true }" in toml and "gyro_z" not in toml


@pytest.mark.parametrize(
    ("poses", "complaint"),
    [
        (("level",), "tip its nose up"),
        (("level", "nose up", "level", "right down", "level"), "turn it to the right"),
    ],
)
def test_a_log_that_ends_too_early_says_what_is_missing(tmp_path, poses, complaint):
    force, rate, _ = guided(1, poses)
    names = ["fx_mps2", "fy_mps2", "fz_mps2", "wx_radps", "wy_radps", "wz_radps"]
    code, out = call(write(tmp_path / "turns.csv", names, np.hstack([force, rate])))
    assert code == 1 and complaint in " ".join(out.split())


def test_a_wrong_log_is_refused_by_name(tmp_path):
    code, out = call(write(tmp_path / "log.csv", ["a", "b"], np.zeros((9, 2))))
    assert code == 2 and "want t_s, fx_mps2" in " ".join(out.split())
    names = ["fx_mps2", "fy_mps2", "fz_mps2", "wx_radps", "wy_radps", "wz_radps"]
    bad = np.zeros((9, 6))
    bad[4, 2] = np.nan
    code, out = call(write(tmp_path / "log.csv", names, bad))
    assert code == 2 and ":6:" in out
