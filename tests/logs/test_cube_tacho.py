"""The tachometer of an export: a report holds until the next, and no longer than its own pace."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from logs.cube_tacho import beside
from logs.sheet import open_sheet

HEAD = "utc_s,sequence,device_us,omega_radps,direction_known"


def files(folder, reports, known=True):
    accel = folder / "cube.accel.csv"
    accel.write_text("utc_s,sequence,device_us,a11_counts\n1700000000.0,1,0,5\n")
    rows = [f"{t},{k},{k},{rate},{known}" for k, (t, rate) in enumerate(reports)]
    (folder / "cube.tacho.csv").write_text("\n".join([HEAD, *rows]) + "\n")
    return open_sheet(accel)


@pytest.mark.parametrize("pace, stop", [(0.01, 1.0), (0.05, 1.04), (0.4, 1.38)])
def test_a_report_holds_until_the_next_and_ends_with_its_own_pace(tmp_path, pace, stop):
    start = 1_700_000_000.0
    times = np.arange(0.0, 1.0, pace)
    sheet = files(tmp_path, [(start + t, 2.0 + k) for k, t in enumerate(times)])
    at = np.arange(-0.5, 2.0, 0.01)
    found = beside(sheet, start + at)
    inside = (at > -1e-9) & (at < times[-1] + pace - 1e-6)
    wanted = 2.0 + np.searchsorted(times, at + 1e-6, side="right") - 1
    np.testing.assert_array_equal(found, np.where(inside, wanted, 0.0))


@given(st.lists(st.floats(0.0, 10.0), min_size=1, max_size=30))
def test_no_report_is_heard_before_its_time_nor_half_a_second_after(tmp_path_factory, times):
    folder = tmp_path_factory.mktemp("t")
    sheet = files(folder, [(t, 1.0) for t in times])
    at = np.linspace(-1.0, 12.0, 400)
    found = beside(sheet, at)
    for t in at[found != 0.0]:
        assert any(-3e-6 <= t - one < 0.5 for one in times)
    assert not found[at < min(times) - 3e-6].any()


def test_reports_that_are_named_need_no_export(tmp_path):
    log, reports = tmp_path / "cube.csv", tmp_path / "turntable.csv"
    log.write_text("t_s,a11_counts\n0,5\n")
    reports.write_text("Time (s);tacho_rad_s;direction_known\n0,0;1,5;True\n0,1;-2;True\n")
    sheet = open_sheet(log)
    assert beside(sheet, np.zeros(1)) is None
    np.testing.assert_array_equal(beside(sheet, np.array([0.05, 0.15]), reports), [1.5, -2.0])
    reports.write_text("t_s;tacho_rad_s;direction_known\n0,0;1,5;false\n")
    assert beside(sheet, np.zeros(1), reports) is None


def test_without_direction_or_file_there_is_none(tmp_path):
    assert beside(files(tmp_path, [(0.0, 1.0)], known=False), np.zeros(1)) is None
    (tmp_path / "cube.tacho.csv").unlink()
    assert beside(open_sheet(tmp_path / "cube.accel.csv"), np.zeros(1)) is None
