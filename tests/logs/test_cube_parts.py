"""A log gives the answer of the live path: axes that cannot be believed are named and left out."""

import numpy as np

from inertial.layouts.catalogue import CUBE
from inertial.simulation.table import TableTest
from logs.cube import run_cube
from logs.cube_parts import Part, cut


def write(path, swapped=None):
    table = TableTest(seed=5)
    counts = np.vstack([table.block(k).counts for k in range(2)])
    omega = np.vstack([table.block(k).omega_b for k in range(2)])
    if swapped:
        names = list(CUBE(0.05).axis_names)
        a, b = (names.index(name) for name in swapped)
        counts[:, [a, b]] = counts[:, [b, a]]
    header = [
        "t_s",
        *(f"{n}_counts" for n in CUBE(0.05).axis_names),
        "true_wx",
        "true_wy",
        "true_wz",
    ]
    rows = np.column_stack([np.arange(len(counts)) / 100.0, counts, omega])
    np.savetxt(path, rows, "%.9g", ",", header=",".join(header), comments="")
    return path


def test_swapped_axes_are_named_and_left_out(tmp_path):
    right = run_cube(write(tmp_path / "right.csv"), estimators=["products-ekf"])
    wrong = run_cube(write(tmp_path / "wrong.csv", ("a21", "a22")), estimators=["products-ekf"])
    assert {axis["state"] for axis in right["axes"].values()} == {"good"}
    assert {n for n, axis in wrong["axes"].items() if axis["state"] == "swapped"} == {"a21", "a22"}
    assert any("a21" in note and "not used" in note for note in wrong["notes"])
    rms = [max(r["estimators"]["products-ekf"]["rate_rms_radps"]) for r in (right, wrong)]
    assert rms[0] < 0.03 and rms[1] < 0.3


def test_parts_are_cut_after_the_rows_that_are_asked_for():
    parts = [Part(0, 10, 0, 0), Part(10, 20, 3, 1)]
    made = cut(parts, [4, 9, 15])
    assert [(p.begin, p.end) for p in made] == [(0, 5), (5, 10), (10, 16), (16, 20)]
    assert [p.missing for p in made] == [0, 0, 3, 0] and [p.mask for p in made] == [0, 0, 1, 1]
