"""The board's logic and drivers against models of what is wired to it, faults included; compiled
with sanitizers.
"""

import struct

import pytest
from support.firmware_support import RESULTS, World, compiled
from support.protocol_support import ROOT

from firmware_protocol.codec import FLAG_CONFIG, FLAG_DROPPED, FLAG_SIMULATED
from firmware_protocol.frames import Acc12, Ack, Adc, Gps, Hello, Pps, SensorInfo, Status, Tacho

SECOND = "run 1000000"


@pytest.fixture(scope="module")
def program(tmp_path_factory):
    return compiled(
        tmp_path_factory.mktemp("world") / "gf_world",
        ROOT / "tests" / "firmware_protocol" / "c" / "gf_world.c",
    )


@pytest.fixture
def world(program) -> World:
    return World(program)


def u32(ack: Ack) -> int:
    return int.from_bytes(ack.echo, "little")


def stale_of(world: World) -> list[int]:
    return [row.stale_mask for row in world.of(Acc12)]


def test_a_board_says_who_it_is_and_samples_from_boot(world):
    world.say("run 2100000").play()
    [hello] = world.of(Hello)
    assert world.frames[0].payload == hello and all(
        f.flags & FLAG_SIMULATED and f.epoch == 7 for f in world.frames
    )
    assert (hello.board_id, hello.sensor_mask, hello.n_axes, hello.tick_hz) == (
        3,
        15,
        12,
        96_000_000,
    )
    assert (hello.sample_period_ns, hello.batch, hello.uid[0], hello.firmware[0]) == (
        10_000_000,
        1,
        0xAB,
        0xCD,
    )
    assert [s.bus for s in hello.sensors] == [0, 0, 1, 1] and hello.sensors[0] == SensorInfo(
        1, 0, 3, 0x0A, 3_900_000
    )
    rows = world.of(Acc12)
    assert len(rows) >= 200 and [row.first_index for row in rows] == list(range(len(rows)))
    assert {row.period_ns for row in rows} == {10_000_000} and {
        row.sensor_mask for row in rows
    } == {15}
    assert all(abs(rows[50].counts[0][3 * i + 2] - 256) <= 2 for i in range(4))
    assert rows[50].counts[0][1::3] == (-20, -21, -22, -23)
    times = [f.t_us for f in world.frames if f.type == Acc12.TYPE]
    assert {b - a for a, b in zip(times, times[1:], strict=False)} == {10_000}


def test_status_counts_what_happened(world):
    world.say("run 3050000").play()
    status = world.of(Status)
    at = world.frames.index(next(f for f in world.frames if f.payload == status[-1]))
    assert (
        len(status) == 3
        and status[-1].built == at == status[-1].sent
        and status[-1].last_seq == at - 1
    )
    assert (
        299 <= status[-1].samples <= 301 and status[-1].missed_ticks == status[-1].sample_drops == 0
    )
    assert (status[-1].free_stack, status[-1].cpu_permille) == (4321, 250)
    assert world.ledger.lost_frames == world.ledger.lost_samples == 0


@pytest.mark.parametrize("fault", ["dead", "low", "refused", "wrong-id"])
def test_a_sensor_that_is_not_there_is_missing_and_counted(world, fault):
    world.script.insert(0, f"fault 2 {fault}")
    world.say("run 2500000").play()
    assert world.of(Hello)[0].sensor_mask == 0b1011
    assert {row.sensor_mask for row in world.of(Acc12)} == {0b1011}
    assert {mask & 0b0100 for mask in stale_of(world)} == {0b0100}
    status = world.of(Status)[-1]
    assert status.init_errors[2] >= 2 and (status.init_errors[0], status.init_errors[1]) == (0, 0)


@pytest.mark.parametrize("fault", ["dead", "low", "refused", "reset"])
def test_a_sensor_that_dies_is_taken_out_and_comes_back(world, fault):
    world.say(SECOND, f"fault 1 {fault}", "run 2500000", "fault 1 none", "run 2500000").play()
    masks = [row.sensor_mask for row in world.of(Acc12)]
    assert masks[0] == 15 and 0b1101 in masks and masks[-1] == 15
    status = world.of(Status)[-1]
    assert 8 <= status.spi_errors[1] <= 16 and status.init_errors[1] >= 1
    assert status.spi_errors[0] == status.spi_errors[2] == status.spi_errors[3] == 0
    rows = world.of(Acc12)
    assert all(row.stale_mask & 2 for row in rows if row.sensor_mask == 0b1101)
    assert world.ledger.lost_samples == 0


def test_a_sensor_without_a_new_value_is_stale(world):
    world.say(SECOND, "fault 3 silent", SECOND).play()
    assert stale_of(world)[:99].count(0) > 95 and set(stale_of(world)[-90:]) == {0b1000}
    assert world.of(Acc12)[-1].sensor_mask == 15


def test_a_sensor_whose_value_never_moves_is_stale(world):
    world.say(SECOND, "fault 0 stuck", "run 3000000").play()
    assert stale_of(world)[-1] == 0b0001 and stale_of(world)[150] == 0


def test_a_fast_sensor_overruns_and_a_slow_one_repeats(world):
    """Their clocks are their own: 2 % fast loses 2 samples a second at 100 Hz, 2 % slow repeats
    2.
    """
    world.say("ppm 0 20000", "ppm 1 -20000", "run 10000000").play()
    status = world.of(Status)[-1]
    assert 18 <= status.fifo_overruns[0] <= 22 and status.fifo_overruns[2] == 0
    assert 18 <= sum(mask & 2 != 0 for mask in stale_of(world)) <= 22


def test_the_fifo_keeps_every_value(world):
    """A late instant costs the newest-value mode samples, the FIFO none: 20 ripples of 5 follow on
    each other.
    """
    world.command("fifo", 1).say("run 500000", "late 45000", SECOND).play()
    rows = world.of(Acc12)[10:]
    ripples = [row.counts[0][2] - 254 for row in rows if not row.stale_mask & 1]
    steps = [(b - a) % 5 for a, b in zip(ripples, ripples[1:], strict=False)]
    assert (
        steps.count(1) >= len(steps) - 4
    )  # after the gap it takes the oldest away until it is at the newest
    assert world.of(Status)[-1].fifo_overruns == (0, 0, 0, 0)
    assert world.ledger.lost_samples == world.of(Status)[-1].missed_ticks == 4


def test_a_fifo_that_is_not_read_overruns(world):
    world.command("fifo", 1).say("run 100000", "late 700000", "run 2000000").play()
    assert all(count >= 1 for count in world.of(Status)[-1].fifo_overruns)


def test_late_instants_are_missed_and_leave_a_gap(world):
    world.say("run 500000", "late 35000", "run 600000").play()
    assert (
        world.of(Status)[-1].missed_ticks == 3 == world.ledger.lost_samples
        and world.ledger.lost_frames == 0
    )
    frames = [f for f in world.frames if f.type == Acc12.TYPE]
    assert {f.t_us - 10_000 * f.payload.first_index for f in frames} == {
        frames[0].t_us
    }  # index and time agree


@pytest.mark.parametrize(
    ("rate", "batch", "code"), [(50, 1, 9), (200, 1, 11), (1000, 8, 14), (3200, 16, 15)]
)
def test_rate_and_batch(world, rate, batch, code):
    world.command("rate_hz", rate).say("run 1200000").play()
    ack, hello = world.acks()[0], world.of(Hello)[-1]
    assert ack.status == 0 and u32(ack) == rate
    assert (hello.sample_period_ns, hello.batch, hello.sensors[3].rate_code) == (
        1_000_000_000 // rate,
        batch,
        code,
    )
    rows = [row for row in world.of(Acc12) if row.period_ns == 1_000_000_000 // rate]
    assert {len(row.counts) for row in rows} == {batch} and sum(
        len(r.counts) for r in rows
    ) > rate * 0.9
    assert world.of(Hello)[0].config_crc != hello.config_crc


def test_a_batch_of_ones_own_and_a_range(world):
    world.command("batch", 5).command("range_g", 4).say("run 500000").play()
    assert [a.status for a in world.acks()] == [0, 0]
    hello = world.of(Hello)[-1]
    assert (
        hello.batch == 5
        and hello.sensors[0].range_code == 1
        and hello.sensors[0].scale_ng == 3_900_000
    )
    assert {len(row.counts) for row in world.of(Acc12)[1:]} == {5}


def test_the_configuration_flag_lasts_until_the_next_hello(world):
    world.command("batch", 2).say("run 100000").play()
    at = next(i for i, f in enumerate(world.frames) if f.type == Ack.TYPE)
    assert world.frames[at].flags & FLAG_CONFIG and world.frames[at + 1].type == Hello.TYPE
    assert not any(f.flags & FLAG_CONFIG for f in world.frames[at + 2 :])


@pytest.mark.parametrize(
    ("name", "arguments", "result"),
    [
        ("rate_hz", struct.pack("<I", 3201), "value"),
        ("rate_hz", struct.pack("<I", 0), "value"),
        ("rate_hz", struct.pack("<I", 300), "value"),
        ("rate_hz", b"\1\2", "length"),
        ("batch", struct.pack("<I", 20), "value"),
        ("range_g", struct.pack("<I", 3), "value"),
        ("fifo", struct.pack("<I", 2), "value"),
        ("adc_mask", struct.pack("<I", 64), "value"),
        ("baud", struct.pack("<I", 1_234_567), "value"),
        ("gnss_baud", struct.pack("<I", 1), "value"),
        (0x7777, b"", "unknown"),
        (0x0108, b"", "unknown"),
        ("time", b"\0", "length"),
        ("self_test", b"", "busy"),
    ],
)
def test_what_cannot_be_done_is_refused_and_changes_nothing(world, name, arguments, result):
    world.command(name, arguments=arguments).command("hello").say("run 100000").play()
    assert (world.acks()[0].status, world.acks()[0].token) == (RESULTS[result], 1)
    first, last = world.of(Hello)[0], world.of(Hello)[-1]
    assert first == last and world.other == []


def test_settings_are_asked_without_arguments(world):
    for name in ("rate_hz", "batch", "range_g", "fifo", "adc_mask", "baud", "gnss_baud"):
        world.command(name)
    world.say("run 50000").play()
    assert [u32(ack) for ack in world.acks()] == [100, 0, 16, 0, 0, 921600, 9600] and len(
        world.of(Hello)
    ) == 1


def test_lines_change_their_rate_after_the_answer(world):
    world.command("baud", 3_000_000).command("gnss_baud", 38400).say("run 50000").play()
    assert [a.status for a in world.acks()] == [0, 0] and world.other == ["B 3000000", "B 38400"]


def test_stop_start_and_time(world):
    world.say("run 200000").command("stop").say("run 300000").command("time").say("run 50000")
    world.command("start").say("run 200000").play()
    kinds = [f.type for f in world.frames]
    stop = kinds.index(Ack.TYPE)
    assert kinds[stop : stop + 3] == [
        Ack.TYPE,
        Status.TYPE,
        Ack.TYPE,
    ]  # nothing but the answer to `time` in between
    received, built = struct.unpack("<QQ", world.acks()[1].echo)
    assert 500_000 <= received <= built <= 520_000
    assert world.ledger.lost_samples == 0 and len(world.of(Acc12)) >= 38


def test_status_and_reboot_on_command(world):
    world.command("status").command("reboot").say("run 20000").play()
    assert (
        [a.status for a in world.acks()] == [0, 0]
        and len(world.of(Status)) == 1
        and world.other == ["R"]
    )


def test_self_test_deflects_and_judges(world):
    world.say("fault 3 stuck", "run 300000")
    world.command("stop").command("self_test").command("start").command("rate_hz", 200)
    world.say("run 1500000").command("start").say("run 500000").play()
    stop, start, rate, test, again = world.acks()
    assert [a.status for a in (stop, start, rate, test, again)] == [
        0,
        RESULTS["busy"],
        RESULTS["busy"],
        0,
        0,
    ]
    passed, tested, *change = struct.unpack("<BB12h", test.echo)
    assert tested == 15 and passed == 0b0111
    assert (
        all(abs(a - b) <= 2 for a, b in zip(change[:9], (300, -300, 400) * 3, strict=True))
        and change[9:] == [0] * 3
    )
    assert all(
        abs(row.counts[0][2] - 256) <= 2 for row in world.of(Acc12)[-40:]
    )  # undeflected again


def test_self_test_without_sensors_says_so(world):
    world.script[:0] = [f"fault {i} dead" for i in range(4)]
    world.command("stop").command("self_test").say("run 200000").play()
    assert [a.status for a in world.acks()] == [0, RESULTS["device"]]


def test_a_stalled_line_drops_frames_and_says_so(world):
    world.say("run 1500000", "stall 1", "run 730000", "stall 0", "run 1500000").play()
    dropped = world.of(Status)[-1].dropped
    assert dropped >= 73 and world.ledger.lost_frames == dropped == world.ledger.device_dropped
    assert (
        world.ledger.link_lost == 0 and sum(bool(f.flags & FLAG_DROPPED) for f in world.frames) == 1
    )


def test_damage_from_the_host_is_counted(world):
    wire = "00112233445566778899aabbccddeeff0011223344556677889900"
    world.say(f"host {wire}").command("hello").say("run 1100000").play()
    assert len(world.acks()) == 1
    status = world.of(Status)[-1]
    assert status.rx_ok == 1 and status.rx_bad >= 1 and status.uart_errors == 0


def test_a_full_receive_ring_is_counted(world):
    world.say(*["host " + "11" * 1000] * 2, "run 1100000").play()
    assert world.of(Status)[-1].uart_errors == 2000 - 1024


def test_pulses_become_frames_on_the_devices_clock(world):
    for _ in range(70):
        world.say("pulse 3", "run 3000")
    world.say("pulse 7", "run 50000").play()
    frames = [f for f in world.frames if f.type == Tacho.TYPE]
    pulses = [f.t_us * 100 + offset for f in frames for offset in f.payload.offsets_10ns]
    assert {b - a for a, b in zip(pulses, pulses[1:], strict=False)} == {300_000}
    assert [f.payload.first_pulse for f in frames][0] == 0 and world.ledger.lost_pulses == 0
    assert [f.payload.edge for f in frames][-1] == 7 and {f.payload.edge for f in frames[:-1]} == {
        3
    }


def test_lost_pulses_are_counted_where_they_were_lost(world):
    world.say("run 1000", *["pulse 1"] * 100, "run 30000", "pulse 1", "run 1100000").play()
    status = world.of(Status)[-1]
    assert (status.tacho_total, status.tacho_overflow) == (
        101,
        36,
    ) and world.ledger.lost_pulses == 36


def test_pulse_per_second(world):
    world.say("run 1001", "pps", SECOND, "pps", "run 1100000").play()
    pulses = world.of(Pps)
    assert [p.index for p in pulses] == [0, 1] and pulses[0].fraction_ns == 500
    assert world.of(Status)[-1].pps_total == 2


def test_bytes_of_the_receiver_pass_through(world):
    sentence = b"$GNGGA,120000.00,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47\r\n" * 12
    for i in range(0, len(sentence), 60):
        world.say("gnss " + sentence[i : i + 60].hex(), "run 1000")
    world.say("run 1100000").play()
    assert b"".join(frame.data for frame in world.of(Gps)) == sentence
    assert world.of(Status)[-1].gps_bytes == len(sentence)


def test_the_analogue_board(world):
    world.say("analog 0 100", "analog 2 4095", "analog 5 7").command("adc_mask", 0b100101).command(
        "rate_hz", 1000
    )
    world.say("run 300000").play()
    rows = world.of(Adc)
    assert rows[0].channel_mask == 0b100101 and rows[0].vref_mv == 3300
    assert {row for frame in rows for row in frame.counts} == {(100, 4095, 7)}
    acc, adc = (
        [f.t_us for f in world.frames if f.type == kind.TYPE and f.payload.period_ns == 1_000_000]
        for kind in (Acc12, Adc)
    )
    assert acc == adc and len(acc) >= 30


def test_hello_returns_every_ten_seconds(world):
    world.say("run 20100000").play()
    assert len(world.of(Hello)) == 3 and len(world.of(Status)) == 20
