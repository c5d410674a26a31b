"""The processor and the chips of the emulated board, by a small program of their own and by data
sheet.
"""

import subprocess
from pathlib import Path

import numpy as np
import pytest

from emulator.adxl345 import DATA_READY, DATAX0, ID, OVERRUN, Adxl345
from emulator.board import Board
from emulator.cycles import narrow_cost, wide_cost
from emulator.engine import EmulationError
from emulator.world import Fault, FaultError, parse_fault

ROOT = Path(__file__).resolve().parents[2]
CLOCK = 96e6


@pytest.fixture(scope="module")
def probe(tmp_path_factory) -> bytes:
    """tests/firmware_protocol/c/probe.c as an image."""
    folder = tmp_path_factory.mktemp("probe")
    source, script = (
        ROOT / "tests" / "firmware_protocol" / "c" / "probe.c",
        ROOT / "tests" / "firmware_protocol" / "c" / "probe.ld",
    )
    subprocess.run(
        [
            "arm-none-eabi-gcc",
            "-O1",
            "-mcpu=cortex-m3",
            "-mthumb",
            "-ffreestanding",
            "-nostdlib",
            "-Wall",
            "-Wextra",
            "-Werror",
            f"-Wl,-T,{script}",
            "-o",
            folder / "probe.elf",
            source,
        ],
        check=True,
    )
    subprocess.run(
        ["arm-none-eabi-objcopy", "-O", "binary", folder / "probe.elf", folder / "probe.bin"],
        check=True,
    )
    return (folder / "probe.bin").read_bytes()


def churn(seed: int) -> int:
    """What the probe computes between interrupts, in Python."""
    for i in range(20000):
        seed = (seed * 1664525 + 1013904223 + (i if seed > 0x80000000 else 0)) & 0xFFFFFFFF
    return seed


def test_interrupts_leave_the_program_alone_and_nest(probe):
    board = Board(probe)
    lines = board.run(0.2).decode().splitlines()
    said = {
        letter: [int(line[1:], 16) for line in lines if line.startswith(letter)]
        for letter in "cdtnw"
    }
    assert said["c"][:4] == [churn(k) for k in range(4)]  # registers and flags survive
    assert set(said["d"]) == {ID}
    assert said["t"][-1] == pytest.approx(
        board.now_s * 1000, abs=5
    )  # a match every millisecond, none lost
    assert said["n"][-1] >= 3  # the UART's handler inside the timer's
    assert set(said["w"]) == {0}  # the stack was aligned to 8 bytes in every handler
    assert 0.01 < board.core.idle / board.core.now < 0.5


def test_two_runs_are_the_same_bytes_at_the_same_clocks(probe):
    def run(slices: int) -> tuple[bytes, int, int]:
        board = Board(probe)
        sent = b"".join(board.run(0.05 * (k + 1) / slices) for k in range(slices))
        return sent, board.core.instructions, board.core.exceptions

    first = run(1)
    assert len(first[0]) > 300 and run(1) == first
    assert (
        run(7)[0][:200] == first[0][:200]
    )  # how the time is cut changes nothing that a host can see


def test_a_received_byte_interrupts_and_takes_its_time_on_the_line(probe):
    board = Board(probe)
    board.run(0.01)
    assert board.uart0.byte_clocks == 10 * 16 * 2  # ten bits of sixteen clocks by divisor 2
    board.feed(b"@")
    assert b"A" in board.run(0.012)


def test_a_held_line_sends_nothing_and_loses_nothing(probe):
    board = Board(probe, faults=[Fault("uart-stall", 0.010, seconds=0.02)])
    before = board.run(0.0101)
    assert board.run(0.0299) == b""
    lines = (before + board.run(0.06)).decode().splitlines()
    said = [int(line[1:], 16) for line in lines if line.startswith("c")]
    assert len(said) > 5 and said == [churn(k) for k in range(len(said))]
    assert {len(line) for line in lines[:-1]} == {9}


def test_an_image_that_is_none_or_that_crashes_is_said():
    with pytest.raises(EmulationError, match="is it the .bin"):
        Board(b"abc")
    with pytest.raises(EmulationError, match="no Thumb address"):
        Board(bytes(1024))
    wild = (0x10008000).to_bytes(4, "little") + (0x101).to_bytes(4, "little") + bytes(0xF8)
    code = bytes.fromhex("4ff0ff300047")  # mov.w r0, #-1; bx r0
    with pytest.raises(EmulationError, match="fault"):
        Board(wild + code + bytes(512)).run(0.001)


@pytest.mark.parametrize(
    ("op", "clocks"), [(0x4618, 1), (0x6801, 2), (0xB5F0, 6), (0xBDF0, 6), (0xC803, 3), (0xE7FE, 1)]
)
def test_narrow_instructions_cost_what_the_manual_says(op, clocks):
    assert narrow_cost(op) == clocks


@pytest.mark.parametrize(
    ("first", "second", "clocks"),
    [(0xFBB1, 0xF0F2, 8), (0xFBA0, 0x2301, 5), (0xF8D0, 0x1004, 2), (0xE92D, 0x41F0, 7)],
)
def test_wide_instructions_cost_what_the_manual_says(first, second, clocks):
    assert wide_cost(first, second) == clocks


def ramp(t_s: np.ndarray) -> np.ndarray:
    """x is the time in units of 10 ms, y and z are constant."""
    return np.column_stack([t_s * 100.0, np.full(len(t_s), 7.3), np.full(len(t_s), -250.0)])


class Spi:
    """One sensor with its chip select, at a time given in s."""

    def __init__(self, sensor: Adxl345) -> None:
        self.sensor = sensor

    def read(self, register: int, n: int, t_s: float) -> bytes:
        clock = int(t_s * CLOCK)
        self.sensor.select(True, clock)
        self.sensor.exchange(0xC0 | register, clock)
        data = bytes(self.sensor.exchange(0, clock) for _ in range(n))
        self.sensor.select(False, clock)
        return data

    def write(self, register: int, value: int, t_s: float) -> None:
        clock = int(t_s * CLOCK)
        self.sensor.select(True, clock)
        self.sensor.exchange(register, clock)
        self.sensor.exchange(value, clock)
        self.sensor.select(False, clock)

    def xyz(self, t_s: float) -> list[int]:
        return np.frombuffer(self.read(DATAX0, 6, t_s), "<i2").tolist()


def started(rate_code: int = 10, format_: int = 0x0B, fifo: int = 0) -> Spi:
    spi = Spi(Adxl345(ramp, CLOCK))
    for register, value in ((0x2C, rate_code), (0x31, format_), (0x38, fifo), (0x2D, 8)):
        spi.write(register, value, 0.0)
    return spi


def test_a_sensor_samples_on_its_own_clock_and_says_what_is_fresh():
    spi = started()
    assert spi.read(0, 1, 0.001)[0] == ID
    assert (
        spi.read(0x30, 1, 0.005)[0] & DATA_READY == 0
    )  # nothing before turn-on time and one period
    assert spi.xyz(0.0152) == [1, 7, -250]
    assert spi.read(0x30, 1, 0.0153)[0] & DATA_READY == 0
    assert (
        spi.read(0x30, 1, 0.0355)[0] == DATA_READY | OVERRUN
    )  # two samples came, one was never read
    assert spi.xyz(0.0356) == [3, 7, -250] and spi.read(0x30, 1, 0.0357)[0] == 0


def test_the_fifo_gives_every_sample_once_and_needs_five_microseconds():
    spi = started(fifo=0x80)
    assert spi.read(0x39, 1, 0.0555)[0] == 5
    first = spi.xyz(0.0556)
    assert spi.xyz(0.0556 + 2e-6) == first  # too soon: the next has not moved up yet
    assert [spi.xyz(0.0556 + k * 1e-5)[0] for k in range(1, 5)] == [2, 3, 4, 5]
    assert (
        spi.read(0x39, 1, 0.0559)[0] == 0
        and spi.read(0x39, 1, 1.0)[0] == 32
        and spi.sensor.overruns > 50
    )


def test_fast_rates_lose_the_lowest_bit_and_ranges_saturate():
    fast = started(rate_code=15)
    assert all(value % 2 == 0 for k in range(50) for value in fast.xyz(0.01 + k * 0.0004))
    assert started(format_=0x08).xyz(20.0)[0] == 511  # +-2 g: 512 counts
    assert started(format_=0x03).xyz(2.0)[0] == 199 >> 3  # 10 bit at +-16 g


def test_self_test_and_broken_sensors():
    spi = started(format_=0x8B)
    assert spi.xyz(0.02)[1:] == [7 - 230, -250 + 330]
    spi.sensor.state = "dead"
    assert spi.read(0, 1, 0.05) == b"\xff"
    spi.sensor.state = "wrong-id"
    assert spi.read(0, 1, 0.05) == b"\x00"
    stuck = started()
    before = stuck.xyz(0.05)
    stuck.sensor.state = "stuck"
    assert stuck.xyz(0.5) == before and stuck.read(0x30, 1, 0.6)[0] & DATA_READY


def test_faults_are_parsed_or_refused_with_what_is_wanted():
    assert parse_fault("sensor-dead@12:sensor=3") == Fault("sensor-dead", 12.0, sensor=2)
    assert parse_fault("uart-stall@20:s=1.5").seconds == 1.5
    for text in (
        "meteor@3",
        "sensor-dead@x",
        "sensor-dead@1:sensor=5",
        "uart-stall@2",
        "brown-out@3:colour=red",
    ):
        with pytest.raises(FaultError, match="want one of .*uart-stall@SECONDS"):
            parse_fault(text)
