"""Analogue accelerometer and gyro boards: converter counts to specific force and rate. Pure
functions.

Equations E-77 to E-79 of docs/equations-attitude.md (tilt-filter, section 1; Starlino's guide,
equations 2 and 3). The article's frame reads +1 g on z when the board lies level: x_a = x_b, y_a =
-y_b, z_a = -z_b, so that RateAxz, positive while x's reading rises, is the rate about +y_b, and
RateAyz is the rate about +x_b.
"""

import math

from pydantic import BaseModel, ConfigDict

from firmware_protocol.frames import Adc
from inertial.constants import GRAVITY
from messages.setting import setting


class AnalogueChannel(BaseModel):
    """One output of a sensor on one input of the converter."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    channel: int = setting(..., "input of the converter", ge=0, le=7)
    invert: bool = setting(False, "the output falls where the quantity rises")


class AnalogueSettings(BaseModel):
    """[gateway.devices.analogue]: which input carries what. Defaults: the Acc_Gyro board (LIS331AL,
    LPR550AL).

    The guided axis detection of the dashboard finds channels and signs.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    bits: int = setting(
        12, "of the converter: full scale, the frame's reference, is 2^bits - 1", ge=8, le=16
    )
    accel_x: AnalogueChannel = setting(AnalogueChannel(channel=0), "accelerometer, x")
    accel_y: AnalogueChannel = setting(AnalogueChannel(channel=1), "accelerometer, y")
    accel_z: AnalogueChannel = setting(AnalogueChannel(channel=2), "accelerometer, z")
    gyro_xz: AnalogueChannel = setting(
        AnalogueChannel(channel=3, invert=True), "pin GX4: rate of the angle in the xz plane"
    )
    gyro_yz: AnalogueChannel = setting(
        AnalogueChannel(channel=4, invert=True), "pin GY4: rate of the angle in the yz plane"
    )
    gyro_z: AnalogueChannel | None = setting(
        None, "rate about z of the body; boards with five axes have none, and read 0"
    )
    zero_g_v: float = setting(1.65, "output at 0 g", unit="V", ge=0.0, le=10.0)
    accel_v_per_g: float = setting(0.4785, "of the accelerometers", unit="V/g", gt=0.0, le=10.0)
    zero_rate_v: float = setting(1.23, "output at rest", unit="V", ge=0.0, le=10.0)
    gyro_v_per_dps: float = setting(
        0.002, "of the gyroscopes, as data sheets give it", unit="V/(deg/s)", gt=0.0, le=1.0
    )

    def needed(self) -> set[int]:
        """Inputs that a frame must hold."""
        gyros = [self.gyro_xz, self.gyro_yz] + ([self.gyro_z] if self.gyro_z else [])
        return {c.channel for c in [self.accel_x, self.accel_y, self.accel_z, *gyros]}


def volt_per_count(vref_mv: int, bits: int) -> float:
    """V per count of a converter with this reference (E-77)."""
    return vref_mv * 1e-3 / (2**bits - 1)


def force_g(count: float, volt: float, zero_g_v: float, v_per_g: float) -> float:
    """Acceleration that an output shows, g; volt: V per count (E-78)."""
    return (count * volt - zero_g_v) / v_per_g


def rate_dps(count: float, volt: float, zero_rate_v: float, v_per_dps: float) -> float:
    """Rate that an output shows, deg/s (E-79)."""
    return (count * volt - zero_rate_v) / v_per_dps


def channels(mask: int) -> list[int]:
    """Inputs in a frame's rows, in their order."""
    return [i for i in range(8) if mask >> i & 1]


def figures(s: AnalogueSettings) -> tuple[float, float, float, float]:
    """V at 0 g, V per m/s^2, V at rest, V per rad/s."""
    return (
        s.zero_g_v,
        s.accel_v_per_g / GRAVITY,
        s.zero_rate_v,
        math.degrees(s.gyro_v_per_dps),
    )


def missing(frame: Adc, s: AnalogueSettings) -> list[int]:
    """Inputs that the settings want and the frame does not hold."""
    return sorted(s.needed() - set(channels(frame.channel_mask)))


def imu_of(frame: Adc, s: AnalogueSettings) -> tuple[list[float], list[float]]:
    """Specific force m/s^2 and rate rad/s in b, each n x 3, flat. The frame must hold every input
    needed.
    """
    volt = volt_per_count(frame.vref_mv, s.bits)
    column = {channel: k for k, channel in enumerate(channels(frame.channel_mask))}

    def g(row: tuple[int, ...], c: AnalogueChannel) -> float:
        return _signed(force_g(row[column[c.channel]], volt, s.zero_g_v, s.accel_v_per_g), c)

    def dps(row: tuple[int, ...], c: AnalogueChannel | None) -> float:
        return (
            0.0
            if c is None
            else _signed(rate_dps(row[column[c.channel]], volt, s.zero_rate_v, s.gyro_v_per_dps), c)
        )

    f_b, omega_b = [], []
    for row in frame.counts:
        f_b += [GRAVITY * v for v in (g(row, s.accel_x), -g(row, s.accel_y), -g(row, s.accel_z))]
        omega_b += [math.radians(dps(row, c)) for c in (s.gyro_yz, s.gyro_xz, s.gyro_z)]
    return f_b, omega_b


def _signed(value: float, channel: AnalogueChannel) -> float:
    return -value if channel.invert else value
