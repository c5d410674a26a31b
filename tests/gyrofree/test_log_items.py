"""Logs in CSV become what a board would have sent, or a line that names file, row and column."""

import threading
from pathlib import Path

import numpy as np
import pytest

from firmware_protocol.codec import Deframer, Frame
from firmware_protocol.frames import Acc12, Gps, Hello, Imu6, Status, Tacho
from firmware_protocol.ledger import Ledger
from gateway.gnss.decoder import GnssDecoder
from gateway.gnss.fix import RTK_FIXED
from gateway.samples.convert import imu_si
from gateway.virtual.virtual_board import PLAYED, BoardImu, VirtualBoard
from gyrofree.running.log_items import items_of
from logs.board_log import CUBE_AXES, read_board_log
from logs.sheet import LogError

CUBE = ("t_s", *(f"{name}_counts" for name in CUBE_AXES))
REST = ["0", "0", "256"] * 2 + ["0", "0", "-256"] * 2  # counts of a cube that lies still
IMU_HEADER = "t_s,fx_mps2,fy_mps2,fz_mps2,wx_radps,wy_radps,wz_radps\n"


class Wire:
    """A line that keeps what is sent on it, or refuses frames."""

    connected = True

    def __init__(self) -> None:
        self.sent = b""
        self.refuse = False

    def read(self) -> bytes:
        return b""

    def write(self, data: bytes) -> bool:
        self.sent += b"" if self.refuse else data
        return not self.refuse


def events(wire: Wire) -> tuple[list[Frame], Ledger]:
    ledger = Ledger()
    found = Deframer().feed(wire.sent)
    for event in found:
        ledger.count(event)
    assert all(isinstance(event, Frame) for event in found)
    return found, ledger


def write(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def imu_rows(n: int) -> str:
    return IMU_HEADER + "".join(
        f"{10 + k * 0.01:.3f},0.1,-0.2,-9.8,{k * 1e-6:.6f},0,0.01\n" for k in range(n)
    )


def test_the_car_drive_goes_through_the_wire_unchanged(data_dir):
    log = read_board_log(data_dir / "car_drive")
    assert (
        log.kind == "imu"
        and len(log.t_s) == 54858
        and log.timing.period_s == pytest.approx(0.01, rel=0.002)
    )
    wire = Wire()
    board = VirtualBoard(wire, PLAYED, sample_period_s=log.timing.period_s)
    samples = np.column_stack([log.t_s, log.f_b, log.omega_b])
    rows = samples[log.t_s < 40.0]
    for item in items_of(log):
        if item.t_s >= 40.0:
            break
        board.take(item)
    board.finish()
    frames, ledger = events(wire)
    assert ledger.lost_frames == 0 and ledger.lost_samples == 0 and ledger.device_dropped == 0
    imu = [frame for frame in frames if frame.type == Imu6.TYPE]
    assert len(imu) == len(rows)
    for frame, row in zip(imu, rows, strict=True):
        f_b, omega_b = imu_si(frame.payload)
        assert f_b == pytest.approx(row[1:4], abs=5.1e-6) and omega_b == pytest.approx(
            row[4:], abs=5.1e-7
        )
        assert abs(frame.t_us / 1e6 - (row[0] - rows[0][0])) < 2e-6
    hello = next(frame.payload for frame in frames if frame.type == Hello.TYPE)
    assert (hello.board_id, hello.n_axes) == (PLAYED, 6)

    decoder = GnssDecoder()
    fixes = [
        fix for f in frames if f.type == Gps.TYPE for fix in decoder.feed(f.payload.data)
    ] + decoder.flush()
    epochs = [e for e in log.fixes if rows[0][0] <= e.t < 40.0]
    assert len(fixes) == len(epochs) > 140 and decoder.bad == 0
    for fix, epoch in zip(fixes, epochs, strict=True):
        assert (fix.latitude_deg, fix.longitude_deg) == pytest.approx(
            np.degrees([epoch.latitude, epoch.longitude]), abs=6e-10
        )
        assert fix.height_m == pytest.approx(epoch.height, abs=6e-5) and fix.quality == RTK_FIXED
        assert fix.v_n == pytest.approx(epoch.v_n, abs=6e-4)


def test_gap_in_the_log_is_a_gap_in_the_index(tmp_path):
    text = imu_rows(50).splitlines(keepends=True)
    log = read_board_log(write(tmp_path / "imu.csv", "".join(text[:20] + text[27:])))
    wire = Wire()
    board = VirtualBoard(wire, PLAYED, sample_period_s=log.timing.period_s, batch=4)
    for item in items_of(log):
        board.take(item)
    board.finish()
    _, ledger = events(wire)
    assert ledger.lost_samples == 7 and ledger.lost_frames == 0


def test_cube_log_with_table_rate(tmp_path):
    header = ",".join((*CUBE, "tacho_rad_s")) + "\n"
    rows = "".join(f"{k / 100},{','.join(REST)},{3.0 if k < 100 else -3.0}\n" for k in range(200))
    path = write(tmp_path / "cube.csv", "# a comment\n" + header + rows)
    with pytest.raises(LogError, match="frozen or stale"):
        read_board_log(path)
    log = read_board_log(path, units_as_named=True)
    assert log.kind == "cube"
    wire = Wire()
    board = VirtualBoard(wire, PLAYED, sample_period_s=log.timing.period_s)
    for item in items_of(log):
        board.take(item)
    board.finish()
    frames, ledger = events(wire)
    pulses = [f.payload for f in frames if f.type == Tacho.TYPE]
    assert (
        board.pulses
        == sum(len(p.offsets_10ns) for p in pulses)
        == pytest.approx(2 * 0.99 * 3.0 * 360 / 6.2832, abs=3)
    )
    assert {p.edge for p in pulses} == {3, 7} and ledger.lost_pulses == 0
    assert sum(f.type == Acc12.TYPE for f in frames) == 200


def test_dropped_frames_are_counted_by_the_board_and_seen_by_the_ledger():
    wire = Wire()
    board = VirtualBoard(wire, PLAYED)
    for k in range(300):
        wire.refuse = 100 <= k < 130
        board.take(BoardImu(k / 100, (0.0, 0.0, -9.8), (0.0, 0.0, 0.0)))
    board.finish()
    frames, ledger = events(wire)
    assert (
        ledger.lost_frames == ledger.device_dropped == board.dropped >= 30 and ledger.link_lost == 0
    )
    assert (
        next(f for f in reversed(frames) if f.type == Status.TYPE).payload.dropped == board.dropped
    )


def test_real_time_pacing_and_stop():
    wire = Wire()
    board = VirtualBoard(wire, PLAYED)
    items = (BoardImu(k / 100, (0.0, 0.0, -9.8), (0.0, 0.0, 0.0)) for k in range(10**9))
    stop = threading.Event()
    thread = threading.Thread(target=board.run, args=(items, stop, 50.0))
    thread.start()
    while board.samples < 500:
        stop.wait(0.01)
    stop.set()
    thread.join(10)
    assert not thread.is_alive() and board.samples < 100_000


def test_last_line_that_was_cut_off_is_left_out_and_said(tmp_path):
    log = read_board_log(write(tmp_path / "imu.csv", imu_rows(10) + "10.100,0.1,-0.2"))
    assert len(log.t_s) == 10 and "cut off" in log.notes[-1]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "empty"),
        (IMU_HEADER, "want at least two"),
        ("t_s,fx_mps2\n1,2\n", "imu.csv:1: column 'fy_mps2' is missing"),
        (
            imu_rows(3) + "11,0,zero,0,0,0,0\n",
            "imu.csv:5: column 'fy_mps2': 'zero' is no finite number",
        ),
        (
            imu_rows(3) + "11,0,nan,0,0,0,0\n",
            "imu.csv:5: column 'fy_mps2': 'nan' is no finite number",
        ),
        (imu_rows(3) + "11,0,0,0\n", "imu.csv:5: 4 cells, the header names 7"),
        (
            imu_rows(3) + "9,0,0,0,0,0,0\n",
            "imu.csv:5: column 't_s': time 9.000000 s after 10.020000 s does not rise",
        ),
        (
            ",".join(CUBE)
            + "\n"
            + "".join(f"{k / 100}," + "1," * 11 + "40000\n" for k in range(3)),
            "column 'a43_counts' at 0.000 s: 40000; want a whole number of 16 bits",
        ),
    ],
)
def test_errors_name_file_row_and_column(tmp_path, text, words):
    with pytest.raises(LogError) as error:
        read_board_log(write(tmp_path / "imu.csv", text))
    assert words in str(error.value)


def test_missing_file(tmp_path):
    with pytest.raises(FileNotFoundError):
        read_board_log(tmp_path / "no.csv")
