"""A report measures by the board's clock: a mapping to UTC that moves changes no figure."""

import numpy as np

from sessions.export.columns import Column
from sessions.export.table import Table
from sessions.report.times import Times

SLOW = 1.75  # s of UTC for each of the board's: a board that gets too little of a processor


def table(**columns) -> Table:
    data = {name: np.asarray(values) for name, values in columns.items()}
    return Table([Column(name) for name in data], data)


def boot():
    """Batches of ten samples at 100 Hz, an estimate for each sample, a receiver on its own port."""
    board_us = 5_000_000 + 100_000 * np.arange(30)
    utc_s = 1.7e9 + SLOW * (board_us - board_us[0]) * 1e-6
    after_s = np.tile(0.01 * np.arange(10), 30)
    accel = table(
        utc_s=np.repeat(utc_s, 10) + after_s,
        device_us=np.repeat(board_us, 10),
        period_s=np.full(300, 0.01),
    )
    rate = table(
        utc_s=np.repeat(utc_s, 10) + after_s,
        device_us=np.repeat(board_us, 10) + np.round(after_s * 1e6),
    )
    fixes = table(utc_s=1.7e9 + SLOW * np.array([0.5, 1.5]), device_us=np.zeros(2))
    return accel, rate, fixes


def test_seconds_are_the_boards():
    accel, rate, fixes = boot()
    times = Times([accel, rate])
    assert times.by_board and times.first == 5.0 and times.first_utc_s == 1.7e9
    for one in (accel, rate):
        np.testing.assert_allclose(times.of(one), 0.01 * np.arange(300), atol=1e-9)
    np.testing.assert_allclose(times.of(fixes), [0.5, 1.5], atol=0.05)
    assert abs(times.seconds - 2.99) < 1e-9


def test_without_the_boards_time_seconds_go_by_utc():
    accel, rate, fixes = boot()
    rate.data["device_us"] = np.zeros(300)
    times = Times([accel, rate])
    assert not times.by_board
    np.testing.assert_allclose(times.of(fixes), SLOW * np.array([0.5, 1.5]), atol=1e-6)
