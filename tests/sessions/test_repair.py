"""What the bus lost is filled in from what the publisher kept: the same bytes, in their order, none
twice.
"""

import random
import sys
import threading
import time

import pytest
from support.bus_cut import Cable
from support.waiting import until

from messages.bus.session import BusSettings, Publishers, open_client, open_router
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import ACCEL, LOCATION, STATUS, TACHO, parse
from messages.history.answers import declare
from messages.history.mending import Mender
from messages.history.mending_state import Arrival
from messages.history.spool import Spool
from sessions.library.catalogue import Catalogue
from sessions.recording import service as recorder
from sessions.recording.mcap_log import read
from sessions.recording.settings import RecorderSettings

PATIENCE = 30.0  # s; generous, the tests wait for states
# ns, of the first header; set for each test: a message is published a moment after the time in its
# header
T0 = 0


@pytest.fixture(autouse=True)
def t0(monkeypatch):
    monkeypatch.setattr(sys.modules[__name__], "T0", time.time_ns() - 3_500_000_000)


def publish(publishers: Publishers, n: int, run: int = 5, first: int = 0) -> None:
    """n accelerometer batches; after every third a tachometer rate and a position, which has no
    header.
    """
    for k in range(first, first + n):
        header = pb.Header(device="cube", run=run, utc_ns=T0 + k * 10_000_000)
        publishers.put(ACCEL, "cube", pb.AccelBatch(header=header, first_index=10 * k, axes=12))
        if k % 3 == 0:
            publishers.put(TACHO, "cube", pb.TachoRate(header=header, omega_radps=k))
            fix = LOCATION.type(latitude=k)
            fix.timestamp.FromNanoseconds(T0 + k * 10_000_000)
            publishers.put(LOCATION, "cube", fix)


def kept(spool: Spool) -> list[Arrival]:
    """Everything in a spool, as it would arrive live."""
    items, query = [], pb.HistoryQuery(max_bytes=2000)
    while True:
        reply = spool.answer(query, "cube")
        items += reply.items
        if not reply.next:
            break
        query.position = reply.next
    return [
        Arrival(parse(f"p/cube/{i.topic}").topic, "cube", "", i.payload, i.published_ns)
        for i in items
    ]


def test_spool_answers_by_sequence_time_and_overview_also_after_a_restart(tmp_path):
    spool = Spool(tmp_path / "spool", segment_bytes=1 << 13)
    publish(Publishers(None, "p", spool), 300)
    spool.close()
    spool = Spool(tmp_path / "spool", segment_bytes=1 << 13)
    publish(Publishers(None, "p", spool), 30, run=6, first=300)
    assert len(list((tmp_path / "spool").glob("*.gfj"))) > 5
    everything = kept(spool)
    assert len(everything) == 330 + 2 * 110

    def sequences(**fields) -> list[tuple[int, int]]:
        reply = spool.answer(pb.HistoryQuery(topics=["accel"], **fields), "cube")
        return [(item.run, item.sequence) for item in reply.items]

    middle = sequences(of="accel", after_run=5, after_sequence=100, until_run=5, until_sequence=200)
    assert middle == [(5, n) for n in range(101, 200)]
    across = sequences(of="accel", after_run=5, after_sequence=298, until_run=6, until_sequence=3)
    assert across == [(5, 299), (5, 300), (6, 1), (6, 2)]
    assert sequences(from_utc_ns=T0 + 500_000_000, until_utc_ns=T0 + 600_000_000) == [
        (5, n) for n in range(51, 62)
    ]
    assert sequences(of="accel", after_run=99, after_sequence=3) == []
    until(lambda: len(sequences(every_s=1.0)) >= 4, "the overview of what the first process wrote")
    glance = spool.answer(pb.HistoryQuery(topics=["accel"], every_s=1.0), "cube")
    times = [item.utc_ns for item in glance.items]
    assert times == sorted(times) and times[-1] - times[0] >= 2e9 and len(times) <= 5
    assert spool.answer(pb.HistoryQuery(), "another").items == []
    assert (
        Publishers(None, "p", spool)._sequence == {}
        and spool.last_sequences()["accel", "cube"] == 30
    )
    spool.close()


@pytest.mark.parametrize(("hold", "max_held"), [(True, 60_000), (True, 5), (False, 60_000)])
@pytest.mark.parametrize("seed", range(12))
def test_random_losses_are_mended_in_order_and_nothing_comes_twice(tmp_path, hold, max_held, seed):
    """The answers come at random moments, in small pages; messages are also delivered twice and
    late.
    """
    chance = random.Random(seed)
    spool = Spool(tmp_path / "spool", segment_bytes=1 << 13)
    publishers = Publishers(None, "p", spool)
    publish(publishers, 60)
    publish(
        publishers if seed % 2 else Publishers(None, "p", spool), 60, run=6, first=60
    )  # it counts on, or anew
    everything = kept(spool)
    questions, got = [], []
    mender = Mender(questions.append, hold=hold, max_held=max_held)

    def reply_one() -> None:
        question = questions.pop(0)
        question.query.max_bytes = 500
        got.extend(mender.answer(question, spool.answer(question.query, question.stream[0])))

    keep = [chance.random() > 0.4 for _ in everything]
    for k, arrival in enumerate(
        everything
    ):  # alone, the loss of a message without a header cannot be noticed
        keep[k] = keep[k - 1] if arrival.topic is LOCATION else keep[k]
    keep[0] = keep[1] = keep[2] = keep[-1] = keep[-2] = keep[-3] = keep[-4] = keep[-5] = True
    for arrival, here in zip(everything, keep, strict=True):
        if here:
            got += mender.take(arrival)
        while questions and chance.random() < 0.3:
            reply_one()
    while questions:
        reply_one()
    for _ in range(10):  # what was not taken because too much waited shows when the next ones come
        n = len(everything)
        publish(publishers, 3, run=6, first=120 + n)
        everything = kept(spool)
        for arrival in everything[n:]:
            got += mender.take(arrival)
            while questions:
                reply_one()
    payloads = [arrival.payload for arrival in got]
    assert len(payloads) == len(set(payloads)) == len(everything)
    assert set(payloads) == {arrival.payload for arrival in everything}
    assert not mender.held and not any(lost for _, lost in mender.counts().values())
    assert sum(arrival.late for arrival in got) >= keep.count(False)
    if hold:
        accel = [p for a, p in zip(got, payloads, strict=True) if a.topic is ACCEL]
        assert accel == [arrival.payload for arrival in everything if arrival.topic is ACCEL]
    spool.close()


def test_what_nobody_kept_is_counted_as_lost_and_the_rest_goes_on():
    questions = []
    mender = Mender(questions.append)

    def arrival(n: int) -> Arrival:
        batch = pb.AccelBatch(header=pb.Header(device="cube", run=1, sequence=n))
        return Arrival(ACCEL, "cube", "", batch.SerializeToString(), 0)

    assert (
        len(mender.take(arrival(1))) == 1
        and mender.take(arrival(5)) == []
        and mender.take(arrival(6)) == []
    )
    assert mender.held == 2
    assert mender.answer(questions.pop(), None) == [arrival(5), arrival(6)]
    assert mender.counts() == {"cube/accel": (0, 3)} and not mender.asking
    assert len(mender.take(arrival(7))) == 1


@pytest.fixture
def bus(free_port):
    endpoint = f"tcp/127.0.0.1:{free_port}"
    settings = BusSettings(prefix="t", router=endpoint, listen=[endpoint])
    with open_router(settings):
        yield settings


def test_a_cut_link_leaves_no_hole_in_the_recording(bus, tmp_path, free_port):
    """The publisher's link to the router is cut three times; what it said meanwhile is in the file,
    in its place.
    """
    cable = Cable(free_port)
    spool = Spool(tmp_path / "spool")
    stop = threading.Event()
    settings = RecorderSettings(root=tmp_path / "root", auto_start=True)
    thread = threading.Thread(target=recorder.run, args=(settings, bus, stop))
    thread.start()
    with open_client(bus) as watcher, open_client(cable.bus(bus)) as session:
        answering = declare(session, "t", "cube", "gateway", spool)
        state = [pb.RecorderStatus()]
        seen = watcher.declare_subscriber(
            f"t/recorder/{STATUS.name}",
            lambda s: state.__setitem__(0, pb.RecorderStatus.FromString(s.payload.to_bytes())),
        )
        until(lambda: state[0].recording, "the recorder")
        publishers = Publishers(session, "t", spool)
        sent = 0

        def send(n: int) -> None:
            nonlocal sent
            for _ in range(n):
                publish(publishers, 1, first=sent)
                sent += 1
                time.sleep(0.002)

        for _ in range(3):
            send(50)
            cable.cut()
            send(100)
            cable.mend()

            def mended() -> bool:
                send(1)  # what is not followed by anything is not missed by anybody
                time.sleep(0.08)
                return state[0].messages >= spool.journal.last_seq - 60 and not state[0].repairing

            until(mended, "the gap to be filled")
        send(10)
        until(lambda: state[0].messages >= spool.journal.last_seq - 3, "the last messages")
        stop.set()
        thread.join(PATIENCE)
        seen.undeclare()
        answering.undeclare()
    cable.close()
    everything = [arrival.payload for arrival in kept(spool)]
    spool.close()
    (info,) = Catalogue(settings.root).list()
    rows = [row for row in read(info.path) if row.key.startswith("t/cube/")]
    first = everything.index(rows[0].payload)
    assert [row.payload for row in rows] == everything[first:] and first <= 3
    assert all(a.log_ns <= b.log_ns for a, b in zip(rows, rows[1:], strict=False))
    topic = Catalogue(settings.root).manifest(info.id).certificate["cube"]["topics"]["accel"]
    assert (
        topic["lost"] == 0 and topic["repaired"] >= 200 and topic["received"] == topic["expected"]
    )
