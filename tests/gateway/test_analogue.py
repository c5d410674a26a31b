"""Analogue boards: the article's worked examples, and counts to the bus's frame."""

import math

import pytest

from firmware_protocol.frames import Adc
from gateway.samples.analogue import (
    AnalogueChannel,
    AnalogueSettings,
    force_g,
    imu_of,
    missing,
    rate_dps,
    volt_per_count,
)

TEN_BITS = volt_per_count(3300, 10)


@pytest.mark.parametrize(
    ("count", "volts", "g"), [(586, 1.89, 0.5), (630, 2.03, 0.79), (561, 1.81, 0.33)]
)
def test_the_articles_accelerometer(count, volts, g):
    assert round(count * TEN_BITS, 2) == volts
    assert (
        math.floor(100 * (volts - 1.65) / 0.4785) / 100 == g
    )  # the article goes on with the rounded volts, and cuts
    assert force_g(count, TEN_BITS, 1.65, 0.4785) == pytest.approx(g, abs=0.01)


@pytest.mark.parametrize(("count", "dps"), [(571, 306), (323, -94)])
def test_the_articles_gyro(count, dps):
    assert round(rate_dps(count, TEN_BITS, 1.23, 0.002)) == dps


def level_counts(**changes: int) -> tuple[int, ...]:
    """Twelve-bit counts of the Acc_Gyro board lying level at rest, with changes by input name."""
    zero_g, one_g, zero_rate = 2047.5, 0.4785 / 3.3 * 4095, 1.23 / 3.3 * 4095
    row = {"x": zero_g, "y": zero_g, "z": zero_g + one_g, "gx": zero_rate, "gy": zero_rate}
    return tuple(round(row[name] + changes.get(name, 0)) for name in ("x", "y", "z", "gx", "gy"))


def frame(*rows: tuple[int, ...], mask: int = 0b11111) -> Adc:
    return Adc(first_index=0, period_ns=10_000_000, channel_mask=mask, vref_mv=3300, counts=rows)


def test_a_level_board_feels_one_g_upwards():
    f_b, omega_b = imu_of(frame(level_counts(), level_counts()), AnalogueSettings())
    assert f_b == pytest.approx([0.0, 0.0, -9.80665] * 2, abs=0.02)
    assert omega_b == pytest.approx([0.0] * 6, abs=math.radians(0.3))


def test_directions_of_the_acc_gyro_board():
    """x's reading rises when the nose rises: +y_b rate; both gyro pins of this board read the other
    way round.
    """
    nose_up = imu_of(frame(level_counts(x=200, gx=-100)), AnalogueSettings())
    assert nose_up[0][0] > 1.0
    assert nose_up[1][1] > math.radians(30.0)
    left_up = imu_of(frame(level_counts(y=200, gy=-100)), AnalogueSettings())
    assert (
        left_up[0][1] < -1.0
    )  # y_b is to the right, so the left side rising is a roll to the right, about +x_b
    assert left_up[1][0] > math.radians(30.0)


def test_other_wiring():
    settings = AnalogueSettings(
        accel_x=AnalogueChannel(channel=7, invert=True),
        gyro_z=AnalogueChannel(channel=6),
        zero_rate_v=1.5,
    )
    row = (*level_counts(), 3000, 2500)  # channels 0 to 4, 6, 7
    f_b, omega_b = imu_of(frame(row, mask=0b11011111), settings)
    assert f_b[0] == pytest.approx(-9.80665 * force_g(2500, volt_per_count(3300, 12), 1.65, 0.4785))
    assert omega_b[2] == pytest.approx(
        math.radians(rate_dps(3000, volt_per_count(3300, 12), 1.5, 0.002))
    )


def test_inputs_that_a_frame_lacks_are_named():
    assert missing(frame(level_counts()[:4], mask=0b1111), AnalogueSettings()) == [4]
    assert missing(frame(level_counts()), AnalogueSettings()) == []
