"""Whatever a log holds that its reader accepts, its board can say and an import can write."""

import threading

import numpy as np
import pytest

from gateway.virtual.virtual_board import PLAYED, VirtualBoard
from gyrofree.running.importer import rows_of
from gyrofree.running.log_items import items_of
from logs.board_log import read_board_log
from logs.sheet import LogError

IMU = "t_s,fx_mps2,fy_mps2,fz_mps2,wx_radps,wy_radps,wz_radps"
GNSS = "t_s,lat_deg,lon_deg,height_m,quality,sd_n_m,sd_e_m,sd_u_m,vn_mps,ve_mps,vd_mps"
BIG = [0.0, -1.0, 1e3, -2.1e4, 1e5, 1e7, 1e10, -1e12, 1e17, 1e150, -1e308]


class Line:
    """A line that takes everything."""

    connected = True

    def __init__(self) -> None:
        self.bytes = 0

    def write(self, data: bytes) -> bool:
        self.bytes += len(data)
        return True

    def read(self) -> bytes:
        return b""


def still(n: int = 40) -> np.ndarray:
    """Samples of a board at rest."""
    t, zeros = np.arange(n) / 100.0, np.zeros((n, 2))
    return np.column_stack([t, zeros, np.full(n, -9.8), zeros, zeros[:, 0]])


def played(folder) -> None:
    """Read a log; what is accepted is played and imported whole."""
    try:
        log = read_board_log(folder, units_as_named=True)
    except LogError as error:
        assert str(folder) in str(error)
        return
    line = Line()
    board = VirtualBoard(line, PLAYED, sample_period_s=log.timing.period_s)
    board.run(items_of(log), threading.Event(), speed=1e12)
    assert board.samples == len(log.t_s) and line.bytes > 0
    assert len(list(rows_of(log, "gyrofree", "log"))) >= len(log.t_s)


@pytest.mark.parametrize("column", range(7))
@pytest.mark.parametrize("value", BIG)
def test_any_number_in_a_sample_is_played_or_refused(tmp_path, column, value):
    n = 40
    table = np.column_stack(
        [np.arange(n) / 100.0, np.zeros((n, 2)), np.full(n, -9.8), np.zeros((n, 3))]
    )
    table[20:, column] += value
    write(tmp_path / "imu.csv", IMU, table)
    played(tmp_path)


@pytest.mark.parametrize("column", range(11))
@pytest.mark.parametrize("value", [*BIG, np.nan])
def test_any_number_in_a_fix_is_played_or_refused(tmp_path, column, value):
    n = 40
    table = np.column_stack(
        [np.arange(n) / 100.0, np.zeros((n, 2)), np.full(n, -9.8), np.zeros((n, 3))]
    )
    fixes = np.tile([0.1, 49.0, 11.0, 300.0, 1, 0.02, 0.02, 0.03, 1.0, 0.0, 0.0], (3, 1))
    fixes[:, 0] += [0.0, 0.1, 0.2]
    fixes[1:, column] = value
    write(tmp_path / "imu.csv", IMU, table)
    write(tmp_path / "gnss.csv", GNSS, fixes)
    played(tmp_path)


def write(path, header, table):
    np.savetxt(path, table, "%.17g", ",", header=header, comments="")
