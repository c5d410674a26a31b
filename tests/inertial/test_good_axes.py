"""Good axes are left alone whatever shakes, loses or distorts them, and bad ones are found in the
same conditions.
"""

import numpy as np
import pytest
from support.good_axes import BOARDS, watch

from estimator.devices.rate import RateBoard
from inertial.layouts.catalogue import CUBE
from inertial.rate.axis_fault import AxisState
from logs.cube import run_estimator
from logs.cube_log import read_log
from logs.cube_parts import monitored

NAMES = CUBE(0.05).axis_names
START = 1200  # row, 12 s: the table turns


@pytest.mark.parametrize("seed", [3, 6])
@pytest.mark.parametrize("profile", ["published", "fast"])
@pytest.mark.parametrize("name", BOARDS)
def test_no_good_axis_is_left_out(name, profile, seed):
    monitor, out = watch(BOARDS[name](profile, seed))
    assert out == set(), monitor.message
    assert monitor.counts.named == 0


def spoilt(readings, kind):
    """Axis a21 with a fault from START on, and who is guilty of it."""
    f, k = readings.f_axis.copy(), NAMES.index("a21")
    rows, guilty = slice(START, None), {k}
    draw = np.random.default_rng(5)
    if kind == "stuck":
        f[rows, k] = f[START, k]
    elif kind == "dead":
        f[rows, k] = 0.0
    elif kind == "biased":
        f[rows, k] += 3.0
    elif kind == "noisy":
        f[rows, k] += 4.0 * draw.normal(size=len(f) - START)
    elif kind == "scale":
        f[rows, k] *= 1.6
    elif kind == "swapped":
        j = NAMES.index("a13")
        f[rows, k], f[rows, j] = f[rows, j].copy(), f[rows, k].copy()
        guilty.add(j)
    return readings._replace(f_axis=f), guilty


@pytest.mark.parametrize("kind", ["stuck", "dead", "biased", "noisy", "scale", "swapped"])
@pytest.mark.parametrize(
    "name",
    ["as published", "vibration 10 mg", "vibration 50 mg", "noise 10 mg", "imperfect device"],
)
def test_a_bad_axis_is_left_out_in_the_same_conditions_and_no_other(name, kind):
    profile = "fast" if kind == "scale" else "published"  # slowly, it changes next to nothing
    readings, guilty = spoilt(BOARDS[name](profile, 2), kind)
    monitor, out = watch(readings)
    assert out == guilty, monitor.message
    if kind == "stuck":
        assert monitor.faults[min(guilty)].state == AxisState.STUCK


def test_less_exact_axes_are_said_to_be_that():
    monitor, out = watch(BOARDS["misalignment 3 deg"]("fast", 2))
    assert out == set() and monitor.counts.widened > 0
    assert "scales or directions off by about" in monitor.message


def as_log(path, readings):
    """The readings as a log of a cube."""
    names = ",".join(["t_s", *(f"{name}_mps2" for name in NAMES)])
    table = np.column_stack([readings.t_s, readings.f_axis])
    np.savetxt(path, table, fmt="%.17g", delimiter=",", header=names, comments="")
    return read_log(path, NAMES)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_log_and_the_live_path_give_the_same_bits(seed, tmp_path):
    readings, _ = spoilt(BOARDS["imperfect device"]("published", seed), "biased")
    data, shape = as_log(tmp_path / "log.csv", readings), CUBE(0.05)
    watched = monitored(data, shape, data.f_axis)
    run = run_estimator("products-ekf", data, shape, data.f_axis, watched.parts)
    board, omega = RateBoard("cube", shape, ["products-ekf"], 1000.0), []
    for k in range(0, len(data.t_s), 10):
        rows = slice(k, k + 10)
        said = board.feed(0, k, data.period_s, data.t_s[rows], data.f_axis[rows])
        omega += [one.columns.omega_b.copy() for one in said]
    assert np.concatenate(omega).tobytes() == np.ascontiguousarray(run.omega_b).tobytes()
    assert [f.word for f in board.health.faults] == [f.word for f in watched.faults]
    assert board.health.belief.width.text == watched.width
