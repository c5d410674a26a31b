"""The firmware image, the gateway's link and the estimator as one chain, in emulated time; once
through pty and bus.
"""

import threading
import time
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from support.emulated_rig import Rig
from support.firmware_support import firmware_image

from emulator.board import Board
from emulator.load import load
from firmware_protocol.codec import Deframer, Frame, encode
from firmware_protocol.frames import Acc12, Command, Hello
from firmware_protocol.ledger import Ledger
from gateway import service
from gateway.board.orders import SETTINGS
from gateway.settings import DeviceSettings, GatewaySettings
from gyrofree.running import emulated
from inertial.simulation.table import TableTest
from messages.bus import orders
from messages.bus.session import BusSettings, open_client, open_router, subscribe
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import ACCEL, BOARD, TRUTH


@pytest.fixture(scope="module")
def image(tmp_path_factory) -> Path:
    return firmware_image(tmp_path_factory.mktemp("image")) / "gyrofree.bin"


@pytest.fixture
def rig(image, tmp_path):
    made: list[Rig] = []

    def make(**options) -> Rig:
        made.append(Rig(image, tmp_path / str(len(made)), **options))
        return made[-1]

    yield make
    for each in made:
        each.close()


def setting(name: str, value: int, token: int = 1) -> bytes:
    """The bytes of a CMD that sets something."""
    return encode(
        Command(SETTINGS[name], token, value.to_bytes(4, "little")), epoch=0, seq=token, t_us=0
    )


def ledger_of(wire: bytes) -> tuple[Ledger, list[Frame]]:
    ledger, deframer = Ledger(), Deframer()
    ledger.received(len(wire))
    events = deframer.feed(wire)
    for event in events:
        ledger.count(event)
    assert ledger.unaccounted(deframer.pending) == 0
    return ledger, [event for event in events if isinstance(event, Frame)]


def test_the_image_boots_says_who_it_is_and_two_runs_are_byte_identical(image):
    def wire() -> bytes:
        board = Board(image)
        board.run(0.3)
        board.feed(setting("rate_hz", 500))
        return bytes(board.run(1.2)) + str((board.core.instructions, board.core.idle)).encode()

    first = wire()
    assert wire() == first
    ledger, frames = ledger_of(first[: first.rindex(b"\0") + 1])
    assert ledger.bad_chunks == 0 and ledger.lost_frames == 0
    rows = [row for frame in frames if frame.type == Acc12.TYPE for row in frame.payload.counts[2:]]
    assert len(rows) > 100 and set(rows) == {(0, 0, 256, 0, 0, 256, 0, 0, -256, 0, 0, -256)}


@pytest.mark.parametrize("profile", ["published"])
def test_the_rate_of_the_table_through_image_gateway_and_estimator(rig, profile):
    chain = rig(test=TableTest(seed=1, profile=profile), rate=["products-ekf"])
    chain.run(18.0)
    error = np.degrees(chain.rate_error("products-ekf", since_s=5.0))
    assert error[2] < 1.4 and error.max() < 3.7, f"RMS {error} deg/s"
    assert Counter(m.header.source for m in chain.seen["accel"]) == {
        pb.SOURCE_EMULATED: len(chain.seen["accel"])
    }
    tacho = max(abs(m.omega_radps) for m in chain.seen["tacho"])
    assert np.degrees(tacho) == pytest.approx(171.0, rel=0.01)
    assert chain.seen["gnss"] and chain.seen["gnss"][-1].satellites == 9
    assert chain.link.pps.span_s > 10 and abs(chain.link.pps.skew_ppm) < 1.0
    assert not chain.faults(), chain.faults()
    assert chain.seen["accel"][-1].axis_offset_s == pytest.approx(
        [0] * 3 + [17e-6] * 3 + [0] * 3 + [17e-6] * 3
    )
    assert (
        chain.link.decoder.ledger.lost_frames
        == chain.link.decoder.ledger.bad_chunks
        == chain.link.decoder.ledger.lost_samples
        == 0
    )


def test_faults_of_the_world_have_names_on_the_bus_and_the_ledger_balances(rig):
    world = (
        "sensor-dead@3:sensor=3",
        "uart-stall@5:s=1.5",
        "sensor-good@7:sensor=3",
        "brown-out@8.5",
    )
    chain = rig(test=TableTest(seed=2, profile="still"), faults=world)
    chain.run(8.4)
    ledger = chain.link.decoder.ledger
    faults = chain.faults()
    assert {"sensor-3-dead", "uart-stall"} <= faults.keys() and "reboot" not in faults
    dead = [m for m in chain.seen["accel"] if 4.0 < m.header.device_us * 1e-6 < 5.0]
    assert dead and all(m.stale_mask & 0b111_000_000 == 0b111_000_000 for m in dead)
    back = [m for m in chain.seen["accel"] if m.header.device_us * 1e-6 > 8.2]
    assert back and all(
        m.stale_mask == 0 for m in back
    )  # started anew within a second, and used again
    status = chain.link.state.status
    assert status.dropped > 50 and ledger.device_dropped == status.dropped == ledger.lost_frames
    assert ledger.link_lost == 0
    assert (
        status.built
        == ledger.good_frames + ledger.lost_frames - (ledger.seq - status.last_seq - 1) - 1
    )
    chain.run(10.0)
    assert "reboot" in chain.faults() and ledger.reboots == 1
    assert ledger.unaccounted(chain.link.decoder.pending) == 0


def test_a_clock_200_ppm_fast_is_found_by_the_pulses_and_by_the_host(rig):
    test = TableTest(seed=3, profile="still")
    fast = emulated.table_world(test, 3, clock_error=200e-6)
    chain = rig(test=test, world=fast)
    chain.run(6.0)
    assert chain.link.pps.skew_ppm == pytest.approx(200, abs=1)
    assert "+200 ppm" in chain.faults()["clock-skew"].text
    assert chain.link.pps.rejected == 0
    fast.pps = lambda: iter(())
    without = rig(test=test, world=fast, slice_s=0.001)
    without.run(24.0)
    assert without.link.pps.pulses == 0 and without.link.clock.skew_ppm == pytest.approx(
        200, abs=40
    )
    assert "clock-skew" in without.faults()


def test_orders_are_answered_after_their_ack(rig):
    chain = rig()
    chain.run(0.3)
    assert chain.order("rate_hz", ask=True) == pb.Reply(ok=True, message="rate_hz is 100 Hz")
    assert chain.order("rate_hz", 400).ok
    chain.run(0.6)
    assert chain.seen["accel"][-1].period_s == 0.0025
    refused = chain.order("rate_hz", 3333)
    assert (
        not refused.ok
        and "out of range" in refused.message
        and "rate_hz is 400 Hz" in refused.message
    )
    assert "knows hello, status" in chain.order("dance").message
    assert not chain.order("self_test").ok  # it is sampling
    assert chain.order("stop").ok
    tested = chain.order("self_test")
    assert tested.ok and tested.message.count("passed") == 4, tested
    assert chain.order("start").ok and "board's clock shows" in chain.order("time").message
    chain.board.sensors[1].state = "stuck"
    assert chain.order("stop").ok
    assert "triad 2 FAILED" in chain.order("self_test").message


def test_an_order_that_nobody_answers_ends(rig):
    chain = rig()
    chain.run(0.2)
    chain.link.readers[0].write = lambda data: None  # the receive line is cut
    reply = chain.order("hello")
    assert not reply.ok and "no ACK to hello" in reply.message and chain.link.orders.timeouts == 1


def test_3200_hz_over_3_mbaud_keeps_the_processor_below_60_percent(image):
    found = load(
        image,
        commands=setting("baud", 3_000_000),
        seconds=0.3,
        follow_up=lambda board: (board.run(0.2), board.feed(setting("rate_hz", 3200, 2))),
    )
    assert (
        found.busy < 0.60 and found.host_bytes_per_s > 80_000 and 200 < found.stack_bytes < 8192
    ), found


def test_through_a_real_pty_the_gateway_and_the_bus(image, tmp_path, free_port):
    endpoint = f"tcp/127.0.0.1:{free_port}"
    bus, port = BusSettings(router=endpoint, listen=[endpoint]), tmp_path / "board"
    seen: dict[str, list] = {"accel": [], "board": [], "truth": []}
    stop = threading.Event()
    options = emulated.Options(image, port, None, "published", 1, 1.0, 0.0)
    settings = GatewaySettings(
        devices=[DeviceSettings(name="cube", port=str(port))], journal=tmp_path / "journal"
    )
    with open_router(bus):
        session = open_client(bus, timeout_s=20)
        keep = [
            subscribe(
                session,
                topic,
                bus.prefix,
                lambda _, message, name=topic.name: seen[name].append(message),
            )
            for topic in (ACCEL, BOARD, TRUTH)
        ]
        threads = [
            threading.Thread(target=emulated.run, args=(options, bus, stop)),
            threading.Thread(target=service.run, args=(settings, bus, stop)),
        ]
        for thread in threads:
            thread.start()
        end = time.monotonic() + 60
        while (len(seen["accel"]) < 20 or len(seen["truth"]) < 20) and time.monotonic() < end:
            time.sleep(0.05)
        order = pb.BoardCommand(name="batch", value=4, user="test")
        answer = orders.give(session, bus.prefix, orders.BOARD, order, "cube", timeout_s=20)
        stop.set()
        for thread in threads:
            thread.join(20)
        keep.clear()
        session.close()
    assert answer == pb.Reply(ok=True, message="batch is 4")
    assert seen["accel"][-1].header.source == pb.SOURCE_EMULATED and seen["board"][-1].board_id == 3
    by_index = {m.for_index: m for m in seen["truth"]}
    shared = [m for m in seen["accel"] if m.first_index in by_index]
    assert shared and by_index[shared[0].first_index].header.device_us == shared[0].header.device_us


def test_hello_names_four_sensors_and_the_emulator(rig):
    chain = rig()
    chain.run(0.2)
    hello = chain.link.state.hello
    assert (
        isinstance(hello, Hello)
        and hello.board_id == 3
        and [s.bus for s in hello.sensors] == [0, 0, 1, 1]
    )
    assert hello.uid == b"emulated lpc1768" and hello.tick_hz == 96_000_000
