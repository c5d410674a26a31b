"""Device time to host time."""

import random

import pytest

from gateway.time.clock import Continued, DeviceClock, lower_hull, unwrap


def receipts(
    seconds: float,
    ppm: float,
    delay,
    seed: int = 1,
    start_us: int = 5_000_000,
    rate: int = 100,
    scale=1.0,
):
    """(device us, host ns) of a device whose clock is ppm fast and whose frames come `delay(draw)`
    late.
    """
    draw = random.Random(seed)
    for k in range(int(seconds * rate)):
        t = k / rate
        yield (
            start_us + round(t * scale * (1 + ppm * 1e-6) * 1e6),
            round((1000.0 + t + delay(draw)) * 1e9),
        )


def usb(draw: random.Random) -> float:
    """A 16 ms latency timer."""
    return 0.001 + draw.uniform(0.0, 0.016)


@pytest.mark.parametrize("ppm", [-200.0, 0.0, 80.0])
def test_skew_and_offset_under_a_usb_latency_timer(ppm):
    clock = DeviceClock()
    for device, host in receipts(60, ppm, usb):
        clock.add(device, host)
    assert clock.skew_ppm == pytest.approx(ppm, abs=8.0)
    at_50_s = clock.host_ns(5_000_000 + round(50e6 * (1 + ppm * 1e-6)))
    assert (at_50_s - 1050_000_000_000) / 1e9 == pytest.approx(
        0.001, abs=0.0006
    )  # the fixed delay stays
    assert clock.residual_s < 0.002 and clock.span_s == pytest.approx(60.0, abs=1.0)


def test_the_envelope_is_below_every_receipt():
    clock = DeviceClock(window_s=1000)
    seen = list(receipts(30, 50.0, usb))
    for device, host in seen:
        clock.add(device, host)
        assert clock.host_ns(device) <= host + 1000  # rounding


def test_there_and_back():
    clock = DeviceClock()
    for device, host in receipts(40, -120.0, usb):
        clock.add(device, host)
    for device in (5_000_000, 30_123_456, 90_000_000):
        assert clock.device_us(clock.host_ns(device)) == pytest.approx(device, abs=2)


def test_a_jump_of_the_device_clock_is_noticed():
    clock = DeviceClock()
    for device, host in receipts(20, 0.0, usb):
        clock.add(device, host)
    for device, host in receipts(20, 0.0, usb, seed=2):
        clock.add(device - 3_000_000, host + 20_000_000_000)
    assert clock.jumps == 1
    assert clock.host_ns(5_000_000 + 19_000_000 - 3_000_000) == pytest.approx(
        1039_001_000_000, abs=2_000_000
    )


def test_a_played_log_at_four_times_its_speed():
    clock = DeviceClock(time_scale=4.0)
    for device, host in receipts(30, 0.0, usb, scale=4.0):
        clock.add(device, host)
    assert abs(clock.skew_ppm) < 20.0
    unscaled = DeviceClock()
    for device, host in receipts(30, 0.0, usb, scale=4.0):
        unscaled.add(device, host)
    assert unscaled.skew_ppm == pytest.approx(
        3e6, rel=0.01
    )  # found and reported, for the message to name


def test_reset_forgets():
    clock = DeviceClock()
    for device, host in receipts(5, 0.0, usb):
        clock.add(device, host)
    clock.reset()
    assert clock.host_ns(123) == 0
    clock.add(1_000, 77_000_000)
    assert clock.host_ns(1_000) == 77_000_000


def test_lower_hull_has_every_point_on_or_above_it():
    draw = random.Random(4)
    points = sorted((draw.random(), draw.random()) for _ in range(200))
    hull = lower_hull(points)
    assert hull[0] == points[0] and hull[-1] == points[-1]
    for (x0, y0), (x1, y1) in zip(hull, hull[1:], strict=False):
        line = [(y - y0) * (x1 - x0) - (y1 - y0) * (x - x0) for x, y in points if x0 <= x <= x1]
        assert min(line) >= -1e-12


@pytest.mark.parametrize("bits", [8, 32])
def test_unwrap_is_invisible(bits):
    whole = 1 << bits
    true, seen = whole - 3, whole - 3
    for step in (1, 1, 1, 5, whole // 2 - 1, -2, 1):
        true += step
        seen = unwrap(seen, true % whole, bits)
        assert seen == true


def fed(seconds: float = 30.0) -> DeviceClock:
    """A clock that knows its device: 100 Hz, 1 ms late, device time 5 s at host time 1000 s."""
    clock = DeviceClock()
    for device, host in receipts(seconds, 0.0, lambda draw: 0.001):
        clock.add(device, host)
    return clock


def test_what_waited_for_a_stopped_process_moves_no_time_stamp():
    """Stopped for 20 s: its port held the first 3 s of them, and all come at once."""
    clock = fed()
    for k in range(300):
        clock.add(35_000_000 + 10_000 * k, 1_050_000_000_000 + 50_000 * k, late=True)
        assert clock.host_ns(35_000_000 + 10_000 * k) == pytest.approx(
            1_030_001_000_000 + 10_000_000 * k, abs=1_000_000
        )
    assert clock.jumps == 0 and clock.sigma_s < 0.001
    clock.add(55_100_000, 1_050_101_000_000)
    assert clock.jumps == 0 and clock.sigma_s < 0.001


def test_a_backlog_that_is_caught_up_with_is_no_jump():
    """Somebody else on the line was stopped for 8 s, and now sends ten times as fast: whatever is
    said of UTC meanwhile is not said with a small sigma.
    """
    clock = fed()
    for k in range(880):
        device, host = 35_000_000 + 10_000 * k, 1_038_001_000_000 + 1_000_000 * k
        clock.add(device, host)
        true_ns = 1_030_001_000_000 + 10_000_000 * k
        assert abs(clock.host_ns(device) - true_ns) < 3e9 * clock.sigma_s + 2e6
    for k in range(100):
        clock.add(43_800_000 + 10_000 * k, 1_038_801_000_000 + 10_000_000 * k)
    assert clock.jumps == 0 and clock.sigma_s < 0.2  # the last of the backlog is scatter


@pytest.mark.parametrize("jump_s", [-3000.0, -3.0, 3.0, 3000.0])
def test_a_jump_is_doubted_until_it_is_believed(jump_s):
    clock = fed()
    for k in range(1000):
        device, host = 35_000_000 + 10_000 * k, 1_030_001_000_000 + 10_000_000 * k
        clock.add(device + round(jump_s * 1e6), host)
        wrong_s = abs(clock.host_ns(device + round(jump_s * 1e6)) - host) * 1e-9
        assert wrong_s < 3.0 * clock.sigma_s + 0.002
    assert clock.jumps == 1 and wrong_s < 0.001


@pytest.mark.parametrize("start_us", [5_000_000, (1 << 32) - 1_000_000])
@pytest.mark.parametrize("bits", [32, 64])
def test_a_counter_of_32_bits_goes_on_over_its_wrap(bits, start_us):
    time = Continued()
    for k in range(3000):
        true_us = start_us + 1000 * k
        assert time.take(true_us % (1 << bits)) == true_us
        if k % 7 == 6:  # a frame that overtook another
            assert time.take((true_us - 1500) % (1 << bits)) == true_us - 1500


def test_a_clock_that_really_goes_back_is_not_continued():
    time = Continued()
    for t_us in (3_000_000_000, 3_000_010_000, 7_000_000, 7_010_000):
        assert time.take(t_us) == t_us
