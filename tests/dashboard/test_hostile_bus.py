"""The dashboard's data and what others put on its bus: nothing ends the feed, memory has a bound,
and a good board's picture stays.
"""

import threading
import time

import numpy as np
import pytest
import zenoh
from support.waiting import until

from dashboard.data.device import HISTORY_S
from dashboard.data.feed import MESSAGE_BYTES, Feed
from dashboard.data.ring import FIRST_ROWS, Ring
from dashboard.data.store import DEVICES, GONE_S, SHARE, Store
from messages.bus.session import BusSettings, open_client, open_router
from messages.contract import gyrofree_pb2 as pb
from messages.contract import topics as tp
from tests.support import hostile_bus

UTC_NS = 1_700_000_000 * 10**9
MB = 1 << 20


def accel(n: int, device: str = "table", axes: int = 12, rows: int = 2) -> pb.AccelBatch:
    header = pb.Header(device=device, sequence=n + 1, epoch=1, run=7)
    header.utc_ns = UTC_NS + n * rows * 10_000_000
    f_mps2 = [float(n)] * axes * rows
    return pb.AccelBatch(header=header, axes=axes, period_s=0.01, f_mps2=f_mps2)


def memory(store: Store) -> int:
    return sum(device.nbytes for device in store.devices.values())


@pytest.fixture
def bus(free_port):
    endpoint = f"tcp/127.0.0.1:{free_port}"
    settings = BusSettings(prefix="t", router=endpoint, listen=[endpoint])
    with open_router(settings), open_client(settings) as session:
        yield session


@pytest.fixture
def feed(bus):
    watched = threading.Event()
    watched.set()
    feed = Feed(bus, "t", Store(), watched)
    yield feed
    feed.stop()


def test_a_good_board_on_a_real_bus_full_of_nonsense(bus, feed):
    block = zenoh.CongestionControl.BLOCK
    store, sent = feed._store, 0

    def seen():
        bus.put("t/table/accel", accel(0).SerializeToString(), congestion_control=block)
        return store.device("table")

    until(seen, "the good board")
    for n, (key, payload) in enumerate(hostile_bus.messages(7, 4000)):
        if "//" in key or " " in key:
            continue
        bus.put(key, payload, congestion_control=block)
        if n % 10 == 0:
            sent += 1
            good = accel(sent).SerializeToString()
            bus.put("t/table/accel", good, congestion_control=block)
    bus.put("t/table/accel", bytes(MESSAGE_BYTES + 1), congestion_control=block)
    until(lambda: feed._received - feed._refused == feed.taken, "all to be taken in")
    rows = store.device("table").rings["accel", ""].rows()
    assert len(rows) == 2 * (sent + 1) and (rows["f"][-1] == sent).all()
    counts = store.door.counts()
    assert feed._thread.is_alive() and "failure" not in counts and counts["size"] >= 1
    assert store.door.of("table") == {"size": 1} and store.dropped == 0
    assert len(store.devices) <= DEVICES and memory(store) < 64 * MB


@pytest.mark.parametrize("seed", range(3))
def test_anything_that_the_contract_allows_is_taken_in_without_a_fault(feed, seed):
    store = feed._store
    for key, payload in hostile_bus.messages(seed, 3000):
        feed._queue.append((key, payload, time.monotonic()))
    until(lambda: not feed._queue, "all to be taken in")
    feed.stop()
    assert "failure" not in store.door.counts()
    for device in store.devices.values():
        for ring in device.rings.values():
            t = ring.rows()["t"]
            assert np.isfinite(t).all() and (np.diff(t) > 0.0).all()


def test_many_devices_cost_little_and_a_silent_one_makes_room():
    store = Store(devices=64)
    for k in range(200):
        store.put(tp.ACCEL, f"d{k}", "", accel(0, f"d{k}"), arrived=float(k) / 1000)
    assert len(store.devices) == 64 and memory(store) < 4 * MB
    assert store.door.counts() == {"many": 136}
    store.put(tp.ACCEL, "late", "", accel(0, "late"), arrived=GONE_S + 1.0)
    assert store.device("late") and store.device("d0") is None and len(store.devices) == 64


def test_sixty_four_axes_are_within_the_bound_and_a_thousand_are_none():
    store = Store(most_bytes=32 * MB)
    for n in range(300):
        store.put(tp.ACCEL, "wide", "", accel(n, "wide", axes=64, rows=1000))
    ring = store.device("wide").rings["accel", ""]
    assert memory(store) <= 32 * MB // SHARE and ring.count > 1000
    assert ring.rows()["f"][-1, 0] == 299.0 and (np.diff(ring.rows()["t"]) > 0.0).all()
    for k in range(100):
        for n in range(20):
            store.put(tp.ACCEL, f"d{k}", "", accel(n, f"d{k}", axes=64, rows=1000))
    assert memory(store) <= 33 * MB + DEVICES * FIRST_ROWS * 2 * 65 * 8


def test_a_ring_grows_and_holds_the_same_as_a_full_one():
    rng = np.random.default_rng(1)
    dtype = np.dtype([("t", float), ("x", float)])
    ring, t = Ring(dtype, 1000), 0.0
    rows = np.empty(0)
    for _ in range(300):
        times = t + np.cumsum(rng.uniform(0.1, 1.0, rng.integers(1, 40)))
        t = times[-1]
        ring.append(times, x=times * 2.0)
        rows = np.append(rows, times)[-1000:]
        assert (ring.rows()["t"] == rows).all() and (ring.rows()["x"] == 2.0 * rows).all()
    assert ring.count == 1000 and len(ring._rows) == 1250


def test_one_message_of_another_time_does_not_move_the_picture():
    store = Store()
    for n in range(100, 150):
        store.put(tp.ACCEL, "table", "", accel(n), arrived=100.0 + n * 0.02)
    for utc_ns in (4 * 10**18, UTC_NS - 10**15, 1):
        far = accel(150)
        far.header.utc_ns = utc_ns
        store.put(tp.ACCEL, "table", "", far, arrived=103.0)
        store.put(tp.ACCEL, "table", "", accel(151), arrived=103.0)
    device = store.device("table")
    assert device.generation == 0 and device.rings["accel", ""].count == 102
    assert store.door.of("table") == {"time": 3}
    for n in range(2):  # two that agree are another beginning
        store.put(tp.ACCEL, "table", "", accel(n), arrived=104.0)
    assert store.device("table").generation == 1
    later = accel(40_000)  # after a silence of as long
    store.put(tp.ACCEL, "table", "", later, arrived=104.0 + 800.0)
    assert store.door.of("table") == {"time": 4} and HISTORY_S < 800.0


def test_an_answer_about_the_past_that_never_ends_is_left(feed):
    from dashboard.data.feed import Past
    from messages.history.mending_state import Question

    asked = []
    feed._asker.ask = lambda *question: asked.append(question[0])
    store = feed._store
    store.put(tp.ACCEL, "table", "", accel(0))
    past = Past(Question(("table", "gateway"), pb.HistoryQuery()))
    item = pb.HistoryItem(topic="accel", run=7, sequence=1, payload=accel(0).SerializeToString())
    for reply in (
        pb.HistoryReply(items=[item], next=3),
        pb.HistoryReply(items=[item], next=3),
    ):
        feed._take_answer(past, reply)
        past = asked[-1]
    assert len(asked) == 1 and store.door.of("table") == {"answer": 1}
    wrong = pb.HistoryItem(topic="accel", run=7, sequence=9, payload=b"\xff" * 9)
    feed._take_answer(past, pb.HistoryReply(items=[wrong, item]))
    assert store.door.of("table")["answer"] == 1 and feed._thread.is_alive()
