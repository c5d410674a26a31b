"""A log's samples become what its board would have sent: items on a board's line, in time order.

Reading and checking is logs/board_log.py's. GNSS epochs become UBX, NAV-PVT and NAV-HPPOSLLH each,
as a receiver would send. A log has no date: its t_s counts from LOG_EPOCH_S.
"""

import heapq
import itertools
import math
from collections.abc import Iterator

from gateway.gnss.ubx import Epoch, ubx_bytes
from gateway.virtual.pulses import table_pulses
from gateway.virtual.virtual_board import BoardAccel, BoardBytes, BoardImu, Item
from inertial.navigation.fix import AUTONOMOUS, DIFFERENTIAL, RTK_FIXED, RTK_FLOAT, Fix
from logs.board_log import BoardLog

LOG_EPOCH_S = 1704067200  # 2024-01-01T00:00:00Z, stands for the date that a log does not have
LONGEST_S = 1.0  # without samples, over which the table is said to have turned on
RTKLIB = {RTK_FIXED: 1, RTK_FLOAT: 2, DIFFERENTIAL: 4, AUTONOMOUS: 5}


def items_of(log: BoardLog, pulses_per_rev: int = 360) -> Iterator[Item]:
    """What the board sees, in time order."""
    samples = _imu(log) if log.kind == "imu" else _cube(log, 2.0 * math.pi / pulses_per_rev)
    return heapq.merge(samples, _gnss(log), key=lambda item: item.t_s)


def _imu(log: BoardLog) -> Iterator[Item]:
    rows = zip(log.t_s, log.index, log.f_b, log.omega_b, strict=True)
    for t_s, index, f_b, omega_b in rows:  # one by one: lists of a long log would be large
        yield BoardImu(float(t_s), tuple(f_b.tolist()), tuple(omega_b.tolist()), int(index))


def _cube(log: BoardLog, pitch: float) -> Iterator[Item]:
    angle, before_s = 0.0, float(log.t_s[0])
    rates = itertools.repeat(0.0) if log.tacho is None else log.tacho
    for row, rate in zip(zip(log.t_s, log.index, log.counts, strict=True), rates, strict=False):
        t_s, index, counts, rate = float(row[0]), int(row[1]), row[2].tolist(), float(rate)
        if t_s - before_s < LONGEST_S:
            yield from table_pulses(angle, rate, before_s, t_s, pitch)
        angle, before_s = angle + rate * (t_s - before_s), t_s
        yield BoardAccel(t_s, tuple(counts), index)


def _gnss(log: BoardLog) -> Iterator[Item]:
    start_s, end_s = float(log.t_s[0]), float(log.t_s[-1])
    for fix in log.fixes:
        if start_s <= fix.t <= end_s:
            yield BoardBytes(fix.t, ubx_bytes(epoch_of(fix)))


def epoch_of(fix: Fix) -> Epoch:
    """A fix as a receiver's epoch."""
    return Epoch(
        LOG_EPOCH_S,
        fix.t,
        math.degrees(fix.latitude),
        math.degrees(fix.longitude),
        fix.height,
        RTKLIB.get(fix.quality, 0),
        tuple(fix.sigma_p.tolist()),
        None if fix.v_n is None else tuple(fix.v_n.tolist()),
    )
