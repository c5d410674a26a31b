"""The estimator and what others put on its bus: nothing ends it, and a good board's estimates are
the very ones that it has alone.
"""

import threading
import time

import pytest

from estimator.inbox import Inbox
from estimator.kinds.cube import Cube
from estimator.pipeline import Pipeline
from estimator.settings import EstimatorSettings
from estimator.stream import FARTHEST, Stream
from estimator.worker import Worker
from inertial.simulation.table import TableTest
from messages.contract import gyrofree_pb2 as pb
from messages.contract.checks import MESSAGE_BYTES
from messages.contract.door import Door
from messages.contract.topics import ACCEL, ESTIMATOR, IMU, PIPELINE_INPUTS, RATE
from messages.history.mending_state import Arrival
from tests.support import hostile_bus

UTC_NS = 1_700_000_000 * 10**9
DT = 0.01


def batches(device: str, count: int, **changed) -> list[pb.AccelBatch]:
    """Batches of two samples of a table at rest."""
    readings = TableTest(1).block(0).readings
    return [
        pb.AccelBatch(
            header=pb.Header(
                device=device,
                sequence=k + 1,
                epoch=1,
                device_us=round(2 * k * DT * 1e6),
                utc_ns=UTC_NS + round(2 * k * DT * 1e9),
                run=7,
            ),
            first_index=2 * k,
            period_s=DT,
            axes=12,
            f_mps2=readings[2 * k % 500 : 2 * k % 500 + 2].ravel().tolist(),
        )
        for k in range(count)
    ]


def arrival(message, device: str, topic=ACCEL) -> Arrival:
    payload = message if isinstance(message, bytes) else message.SerializeToString()
    return Arrival(topic, device, "", payload, UTC_NS)


class Desk:
    """A worker, what it says, and whether it lives."""

    def __init__(self, **settings):
        self.out = []
        pipeline = Pipeline(EstimatorSettings(**(dict(rate=["least-squares"]) | settings)))
        self.worker = Worker(pipeline, self.out.append, door=Door("estimator", most_devices=20))
        self.stop = threading.Event()
        self.thread = threading.Thread(target=self.worker.work, args=(self.stop,))
        self.thread.start()

    def end(self) -> None:
        self.worker.finish()
        self.thread.join(60)
        assert not self.thread.is_alive() and self.worker.failure is None

    def rates(self, device: str) -> list[bytes]:
        return [o.message.SerializeToString() for o in self.out if o[:2] == (RATE, device)]

    def give(self, key: str, payload: bytes) -> None:
        """As the service does with what the bus brings."""
        address = self.worker.door.address(key)
        if address is None or address.topic not in PIPELINE_INPUTS:
            return
        if self.worker.door.admit(key, address, len(payload)):
            self.worker.offer(
                Arrival(address.topic, address.device, address.estimator, payload, UTC_NS)
            )


def alone(count: int) -> list[bytes]:
    desk = Desk()
    for batch in batches("table", count):
        desk.give("t/table/accel", batch.SerializeToString())
    desk.end()
    return desk.rates("table")


@pytest.mark.parametrize("seed", range(3))
def test_a_good_board_among_nonsense_has_the_estimates_that_it_has_alone(seed):
    good, desk = iter(batches("table", 150)), Desk()
    for n, (key, payload) in enumerate(hostile_bus.messages(seed, 3000)):
        desk.give(key, payload)
        if n % 20 == 0:
            desk.give("t/table/accel", next(good).SerializeToString())
    desk.end()
    assert desk.rates("table") == alone(150) != []
    counts = desk.worker.door.counts()
    assert "failure" not in counts and sum(counts.values()) > 500


@pytest.mark.parametrize(
    ("topic", "message", "kind"),
    [
        (ACCEL, bytes(MESSAGE_BYTES + 1), "size"),
        (ACCEL, pb.AccelBatch(axes=12, period_s=DT, f_mps2=[9.8] * 12 * 5000), "length"),
        (ACCEL, pb.AccelBatch(axes=2**31, period_s=DT, f_mps2=[9.8] * 12), "range"),
        (ACCEL, pb.AccelBatch(axes=12, period_s=DT, f_mps2=[1e300] * 12), "range"),
        (ACCEL, pb.AccelBatch(header=pb.Header(device="other"), axes=12), "device"),
        (ACCEL, b"\xff", "bytes"),
        (IMU, pb.ImuBatch(period_s=DT, f_b_mps2=[float("nan")] * 3), "number"),
    ],
)
def test_what_may_not_come_in_is_named_in_the_health_of_its_device(topic, message, kind):
    desk = Desk()
    good = batches("cube", 120)
    for batch in good[:60]:
        desk.worker.offer(arrival(batch, "cube"))
    desk.worker.offer(arrival(message, "cube", topic))
    for batch in good[60:]:
        desk.worker.offer(arrival(batch, "cube"))
    desk.end()
    newest = [o.message for o in desk.out if o.topic is ESTIMATOR][-1]
    assert dict(newest.refused) == {kind: 1} and newest.gaps == 0
    assert len(desk.rates("cube")) == 120


def imu(first_index: int, sequence: int, period_s: float) -> pb.ImuBatch:
    header = pb.Header(device="car", sequence=sequence, epoch=1, utc_ns=UTC_NS, run=7)
    header.device_us = sequence * 10_000
    return pb.ImuBatch(
        header=header,
        first_index=first_index,
        period_s=period_s,
        f_b_mps2=[0.0, 0.0, -9.8],
        omega_ib_b_radps=[0.0] * 3,
    )


def test_no_loop_runs_as_long_as_an_index_says():
    desk = Desk()
    for n, (index, period_s) in enumerate(
        [(0, DT), (2**52, DT), (5, DT), (2**31, 1e-5), (2**31 + 9000, 1e-5), (2**50, 1e-300)]
    ):
        desk.worker.offer(arrival(imu(index, n + 1, period_s), "car", IMU))
    began = time.monotonic()
    desk.end()
    assert time.monotonic() - began < 30.0  # and not the hours of 2**52 steps


def test_a_fault_in_one_devices_estimators_begins_that_one_anew(monkeypatch, caplog):
    sound = Cube.take

    def take(cube, batch):
        if cube._device == "sick" and batch.header.sequence == 50:
            raise ZeroDivisionError
        return sound(cube, batch)

    monkeypatch.setattr(Cube, "take", take)
    desk = Desk()
    for table, sick in zip(batches("table", 100), batches("sick", 100), strict=True):
        desk.worker.offer(arrival(table, "table"))
        desk.worker.offer(arrival(sick, "sick"))
    desk.end()
    assert desk.rates("table") == alone(100) and len(desk.rates("sick")) == 99
    assert desk.worker.door.of("sick") == {"failure": 1} and not desk.worker.door.of("table")
    assert "ZeroDivisionError" in caplog.text and "begin anew" in caplog.text


def test_an_order_that_fails_is_answered(monkeypatch):
    desk, answers = Desk(), []
    monkeypatch.setattr(desk.worker.pipeline, "order", lambda command: 1 / 0)
    desk.worker.order(pb.EstimatorCommand(device="cube"), answers.append)
    desk.end()
    assert not answers[0].ok and "ZeroDivisionError" in answers[0].message


def test_a_device_that_made_room_is_forgotten_and_may_come_again():
    desk = Desk()
    good = batches("table", 40)
    for batch in good[:20]:
        desk.give("t/table/accel", batch.SerializeToString())
    desk.worker.forget("table")
    for batch in good[20:]:
        desk.give("t/table/accel", batch.SerializeToString())
    desk.end()
    assert len(desk.rates("table")) == 40 and not desk.worker.door.counts()


def test_devices_take_turns():
    inbox = Inbox(100_000, 1 << 30)
    for k in range(5000):
        inbox.offer("flood", arrival(b"%d" % k, "flood"))
    inbox.offer("table", arrival(b"one", "table"))
    inbox.offer("table", arrival(b"two", "table"))
    turns = [inbox.get() for _ in range(6)]
    assert [lane for lane, _ in turns] == ["flood", "table", "flood", "table", "flood", "flood"]
    assert [item.payload for lane, item in turns if lane == "table"] == [b"one", b"two"]
    inbox.end()
    left = iter(inbox.get, None)
    assert [item.payload for _, item in left] == [b"%d" % k for k in range(4, 5000)]


@pytest.mark.parametrize(("most", "most_bytes"), [(100, 1 << 30), (10**6, 1000)])
def test_a_flood_drops_its_own_and_nobody_elses(most, most_bytes):
    inbox, told = Inbox(most, most_bytes), []
    for k in range(1000):
        told.append(inbox.offer("flood", arrival(bytes(10), "flood")))
        if k % 100 == 0:
            inbox.offer("table", arrival(b"0123456789", "table"))
            inbox.put("flood", "an order")
    assert told.count(False) > 800 and inbox.dropped > 800
    inbox.end()
    items = [item for _, item in iter(inbox.get, None)]
    assert sum(isinstance(item, Arrival) and item.device == "table" for item in items) == 10
    assert items.count("an order") == 10 and len(items) <= 120


def test_a_gap_that_is_none_is_a_new_beginning():
    stream = Stream()
    stream.admit(1, 0, 10)
    assert stream.admit(1, 20, 10).missing == 10
    jump = stream.admit(1, 30 + FARTHEST + 1, 10)
    assert jump.restart and jump.missing == 0 and "went from 30" in jump.reason
