"""Raw to physical: sign, range, both ends; and what the settings refuse."""

import math
from dataclasses import replace

import pytest
from pydantic import ValidationError

from estimator.convert.samples import fix_of
from firmware_protocol.codec import FLAG_SIMULATED
from firmware_protocol.frames import Hello, Imu6, SensorInfo, Status
from gateway.gnss.fix import Fix
from gateway.gnss.nmea import AUTONOMOUS
from gateway.samples import convert
from gateway.samples.batch import Batch, Index, Joiner
from gateway.settings import DeviceSettings, GatewaySettings
from messages.contract import gyrofree_pb2 as pb
from messages.contract.checks import check

SENSORS = tuple(SensorInfo(model=1, scale_ng=ng) for ng in (3_900_000, 4_000_000, 0, 1_000_000))


def hello(board_id: int = 0) -> Hello:
    return Hello(
        1,
        board_id,
        15,
        12,
        1_000_000,
        10_000_000,
        1,
        sensors=SENSORS,
        version=(1, 2, 3),
        firmware="name",
    )


def test_counts_keep_sign_and_both_ends():
    scales = convert.axis_scales(hello())
    counts = [-32768, 0, 32767] * 4
    f = convert.specific_force(counts * 2, scales)
    assert f[:3] == pytest.approx([-32768 * 3.9e-3 * 9.80665, 0.0, 32767 * 3.9e-3 * 9.80665])
    assert f[3] == pytest.approx(-32768 * 4.0e-3 * 9.80665)
    assert f[6] == pytest.approx(f[0])  # a sensor without a scale: the nominal one
    assert f[12:] == f[:12]
    assert convert.axis_scales(None) == [convert.ADXL345_SCALE] * 12


def test_imu_counts():
    f_b, omega_b = convert.imu_si(Imu6(0, 10, 10, 1000, ((1, -2, -980_665, 3, -4, 5), (0,) * 6)))
    assert f_b == pytest.approx([1e-5, -2e-5, -9.80665, 0, 0, 0]) and omega_b == pytest.approx(
        [3e-6, -4e-6, 5e-6, 0, 0, 0]
    )


@pytest.mark.parametrize(
    ("board", "flags", "source"),
    [
        (None, 0, pb.SOURCE_UNKNOWN),
        (None, FLAG_SIMULATED, pb.SOURCE_SIMULATED),
        (0, 0, pb.SOURCE_HARDWARE),
        (0, FLAG_SIMULATED, pb.SOURCE_SIMULATED),
        (1, 0, pb.SOURCE_SIMULATED),
        (2, 0, pb.SOURCE_PLAYED),
        (3, FLAG_SIMULATED, pb.SOURCE_EMULATED),
        (77, 0, pb.SOURCE_UNKNOWN),
    ],
)
def test_source_is_never_better_than_it_is(board, flags, source):
    assert convert.source(None if board is None else hello(board), flags) == source


def test_board_info_names_every_status_counter():
    info = convert.board_info(hello(), Status(built=5, spi_errors=(1, 2, 3, 4)))
    assert (info.firmware, info.axes, info.sample_period_s) == (
        "1.2.3 name",
        12,
        pytest.approx(0.01),
    )
    assert (
        info.status["built"] == 5
        and info.status["spi_errors_3"] == 4
        and info.status["last_seq"] == 0
    )


def test_fix_without_geoid_says_how_little_it_knows_of_its_height():
    fix = Fix(
        "GP",
        quality=AUTONOMOUS,
        latitude_deg=1.0,
        longitude_deg=2.0,
        height_msl_m=50.0,
        sigma_ned_m=(1, 1, 2),
    )
    message = convert.gnss_fix(fix)
    assert message.position_sigma_ned_m[:2] == [1, 1] and message.position_sigma_ned_m[2] > 110.0
    assert message.height_reference == pb.HEIGHT_REFERENCE_SEA_LEVEL and message.height_m == 50.0
    assert math.isnan(convert.location_fix(message, "car").altitude)
    silent = convert.gnss_fix(replace(fix, sigma_ned_m=None))
    assert silent.position_sigma_ned_m[2] > 110.0 and silent.position_sigma_ned_m[0] == 1.6
    taken = fix_of(message, 1, 0.0)
    assert taken.datum == 110.0 and taken.sigma_p[2] == pytest.approx(2.0)


def test_what_a_receiver_does_not_say_is_no_zero():
    nothing = convert.gnss_fix(Fix("GP", quality=AUTONOMOUS))
    assert nothing.quality == pb.GnssFix.QUALITY_NONE and math.isnan(nothing.latitude_deg)
    flat = Fix("GP", quality=AUTONOMOUS, latitude_deg=1.0, longitude_deg=2.0, sigma_ned_m=(1, 1, 2))
    message = convert.gnss_fix(flat)
    assert math.isnan(message.height_m) and math.isnan(message.height_msl_m)
    assert message.height_reference == pb.HEIGHT_REFERENCE_UNKNOWN
    assert not message.v_n_mps and math.isnan(message.position_sigma_ned_m[2])
    location = convert.location_fix(message, "car")
    assert math.isnan(location.altitude) and location.position_covariance[8] >= 1e8
    taken = fix_of(message, 1, 0.0)
    assert not taken.has_height and taken.v_n is None and taken.sigma_p[0] == 1.0
    assert check(message) == [] == check(nothing)


def test_a_fix_of_an_older_version_had_zeros_for_what_it_did_not_know():
    old = {"latitude_deg": 49.0, "longitude_deg": 11.0, "quality": AUTONOMOUS}
    assert math.isnan(fix_of(pb.GnssFix(talker="GP", **old), 1, 0.0).height)
    assert fix_of(pb.GnssFix(talker="UBX", **old), 1, 0.0).height == 0.0
    measured = fix_of(pb.GnssFix(talker="GP", height_m=357.6, height_msl_m=310.5, **old), 1, 0.0)
    assert measured.height == 357.6 and measured.datum == 0.0


def batch(index: int, period_ns: int, n: int = 1, lost: int = 0) -> Batch:
    return Batch(
        index, 0, period_ns, n, lost, index, index, 0, columns=([index] * n, [float(index)] * n)
    )


def test_joining_above_200_hz_only_and_never_over_a_gap():
    slow, fast = Joiner(), Joiner()
    assert [len(slow.add(batch(i, 5_000_000))) for i in range(3)] == [1, 1, 1]
    out = [b for i in range(25) for b in fast.add(batch(i, 1_000_000))]
    assert [(b.first_index, b.n) for b in out] == [(0, 10), (10, 10)] and fast.waiting
    out = fast.add(batch(30, 1_000_000, lost=5))
    assert [(b.first_index, b.n, b.columns[0]) for b in out] == [(20, 5, [20, 21, 22, 23, 24])]
    assert [(b.first_index, b.lost) for b in fast.flush()] == [(30, 5)]


def test_index_unwraps_and_counts_gaps():
    index = Index()
    assert index.take(2**32 - 4, 2) == (2**32 - 4, 0)
    assert index.take(2**32 - 2, 4) == (2**32 - 2, 0)
    assert index.take(5, 1) == (2**32 + 5, 3)


@pytest.mark.parametrize(
    "wrong",
    [
        {"name": "Upper"},
        {"name": "a/b"},
        {"baud": 5},
        {"speed": 9600},
        {"time_scale": 0.0},
        {"gnss_latency_s": -1.0},
    ],
)
def test_settings_refuse(wrong):
    with pytest.raises(ValidationError):
        DeviceSettings(**({"name": "cube", "port": "/dev/ttyUSB0"} | wrong))


def test_two_boards_need_two_names():
    board = DeviceSettings(name="cube", port="/dev/ttyUSB0")
    with pytest.raises(ValidationError, match="stands twice"):
        GatewaySettings(devices=[board, board])
