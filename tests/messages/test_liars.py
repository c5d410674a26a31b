"""Queryables that lie or say nothing beside those that serve: real sessions over a real router."""

import contextlib
import threading
import time

import pytest
import zenoh
from support.stack import free_port

from messages.bus import orders
from messages.bus.claiming import Claim, Claimant, newest
from messages.bus.fencing import Fence
from messages.bus.session import (
    BusSettings,
    Publishers,
    connected,
    open_client,
    open_router,
)
from messages.bus.settings import LARGEST
from messages.contract import gyrofree_pb2 as pb
from messages.contract.checks import Refusal
from messages.contract.topics import (
    ACCEL,
    GATEWAY,
    RECORDER,
    claim_key,
    published_key,
    recorder_control_key,
)
from messages.history import answers
from messages.history.answers import Asker, declare
from messages.history.mending import Mender
from messages.history.mending_state import MOST_IDLE, Arrival, Question
from messages.history.spool import Spool

NEVER = 3600.0  # s; a test that waits for it hangs
KEY = published_key("t", "cube", GATEWAY)
STREAM = ("cube", GATEWAY)


def accel(run: int, sequence: int, device: str = "cube", utc_ns: int = 0) -> bytes:
    header = pb.Header(device=device, run=run, sequence=sequence, utc_ns=utc_ns or time.time_ns())
    return pb.AccelBatch(header=header).SerializeToString()


def reply_with(*rows: tuple[int, int, bytes], more: int = 0, at_ns: int = 0) -> pb.HistoryReply:
    reply = pb.HistoryReply(next=more)
    for run, sequence, payload in rows:
        reply.items.add(
            topic="accel", run=run, sequence=sequence, payload=payload, published_ns=at_ns
        )
    return reply


class Bench:
    """One that serves, one that lies, and a consumer; each with a session of its own."""

    def __init__(self, stack: contextlib.ExitStack, folder) -> None:
        endpoint = f"tcp/127.0.0.1:{free_port()}"
        bus = BusSettings(prefix="t", router=endpoint, listen=[endpoint])
        stack.enter_context(open_router(bus))
        self.honest, self.liar, self.consumer = (
            stack.enter_context(open_client(bus)) for _ in range(3)
        )
        self._onlooker = self.asker = stack.enter_context(open_client(bus))
        self.refused: list[tuple[str, Refusal]] = []
        self.fence = Fence(lambda key, why, device: self.refused.append((key, why)))
        self.fence.declare(self.consumer, "t")
        self.spool = Spool(folder, 1 << 24, 3600.0)
        self.publishers = Publishers(self.honest, "t", self.spool)
        self.run = self.spool.journal.run
        stack.callback(self.spool.close)

    def serve(self) -> Claim:
        for _ in range(20):
            message = pb.AccelBatch(header=pb.Header(device="cube", run=self.run))
            message.header.utc_ns = time.time_ns()
            self.publishers.put(ACCEL, "cube", message)
        declare(self.honest, "t", "cube", GATEWAY, self.spool)
        claimed = Claim(
            Claimant(self.honest, self._onlooker), [claim_key("t", GATEWAY, "cube")], self.run
        )
        while self.fence.claims.publisher(*STREAM) != str(self.honest.zid()):
            time.sleep(0.005)
        return claimed

    def lie(self, says) -> None:
        """says(query) answers, or keeps the query and so never does."""
        self.liar.declare_queryable(KEY, says)

    def mended(self) -> list[int]:
        """Sequences that a consumer that missed 2 to 9 is given on."""
        got, end = [], threading.Event()

        def answered(question, reply):
            got.extend(mender.answer(question, reply))
            if not mender.asking:
                end.set()

        asker = Asker(self.consumer, "t", answered, self.fence)
        mender = Mender(
            lambda q: asker.ask(q, *q.stream, q.query),
            refuse=lambda key, why, device: self.refused.append((key, why)),
        )
        for sequence in (1, 10):
            payload = accel(self.run, sequence)
            got.extend(mender.take(Arrival(ACCEL, "cube", "", payload, time.time_ns())))
        assert end.wait(60.0)
        asker.close()
        return [ACCEL.type.FromString(one.payload).header.sequence for one in got]


@pytest.fixture
def bench(tmp_path, monkeypatch):
    monkeypatch.setattr(answers, "ANSWER_S", NEVER)
    with contextlib.ExitStack() as stack:
        yield Bench(stack, tmp_path)


def lies_about(run: int) -> dict[str, pb.HistoryReply]:
    """Answers to a question for 2 to 9 of a run."""
    late = time.time_ns() + 50 * 365 * 86400 * 10**9
    future = reply_with(*[(run, k, accel(run, k, utc_ns=late)) for k in range(2, 10)], at_ns=late)
    return {
        "of another device": reply_with(*[(run, k, accel(run, k, "other")) for k in range(2, 10)]),
        "another number": reply_with(*[(run, k, accel(run, k + 100)) for k in range(2, 10)]),
        "another run": reply_with(*[(run + 1, k, accel(run + 1, k)) for k in range(2, 10)]),
        "without end": reply_with((run, 1, accel(run, 1)), more=(1 << 63) - 1),
        "of the future": future,
        "forged": reply_with(*[(run, k, accel(run, k, utc_ns=1)) for k in range(2, 10)]),
        "garbage": reply_with((run, 2, b"\xff\xff")),
    }


def test_one_that_never_answers_is_not_waited_for(bench):
    kept = []
    bench.lie(kept.append)
    claimed = bench.serve()
    assert bench.mended() == list(range(1, 11))
    assert kept  # it was asked, and still owes the answer
    claimed.release()


@pytest.mark.parametrize("lie", lies_about(7))
def test_the_one_who_has_claimed_it_is_believed_and_no_liar(bench, lie):
    claimed = bench.serve()
    said = lies_about(bench.run)[lie].SerializeToString()

    def says(query: zenoh.Query) -> None:
        for _ in range(3):
            query.reply(KEY, said)

    bench.lie(says)
    assert bench.mended() == list(range(1, 11))
    assert all(
        why.kind == "claim" and str(bench.liar.zid()) in why.found for _, why in bench.refused
    )
    claimed.release()


def test_who_never_answers_is_given_up_where_nobody_serves(bench, monkeypatch):
    """It is not taken for a publisher that is late, for which a consumer waits half an hour."""
    monkeypatch.setattr(answers, "ANSWER_S", 0.2)
    monkeypatch.setattr(Asker, "RETRY_S", 0.01)
    kept = []
    bench.lie(kept.append)
    assert bench.mended() == [1, 10]


def test_an_answer_without_end_ends_where_it_brings_nothing():
    asked: list[Question] = []
    refused: list[Refusal] = []
    mender = Mender(asked.append, refuse=lambda key, why, device: refused.append(why))
    got = []
    for sequence in (1, 10):
        got += mender.take(Arrival(ACCEL, "cube", "", accel(7, sequence), 0))
    parts = 0
    while asked:
        parts += 1
        got += mender.answer(asked.pop(), reply_with((7, 1, accel(7, 1)), more=parts))
    assert parts == MOST_IDLE + 1 and [why.kind for why in refused] == ["answer"]
    assert len(got) == 2 and mender.counts() == {"cube/accel": (0, 8)}


def test_an_order_is_answered_by_the_one_who_serves(bench, caplog):
    key, base = recorder_control_key("t"), claim_key("t", RECORDER)

    def lies(query: zenoh.Query) -> None:
        query.reply(key, pb.RecorderStatus(session="a-lie", recording=True).SerializeToString())

    bench.liar.declare_queryable(key, lies)
    claimed = Claim(Claimant(bench.honest, bench.asker), [base], time.time_ns())
    orders.take(
        bench.honest, "t", orders.RECORDER, lambda order: (time.sleep(0.3), order.answer(quiet))
    )
    quiet = pb.RecorderStatus(session="true")
    while newest(bench.asker, base) != str(bench.honest.zid()):
        time.sleep(0.005)
    command = pb.RecorderCommand(action=pb.RecorderCommand.ACTION_STATUS)
    told = orders.give(bench.asker, "t", orders.RECORDER, command)
    while "is refused" not in caplog.text:  # the liar may not have been known yet
        assert (told.session, told.recording) == ("true", False)
        told = orders.give(bench.asker, "t", orders.RECORDER, command)
    assert told.session == "true" and str(bench.liar.zid()) in caplog.text
    claimed.release()


def test_a_huge_message_is_put_together_nowhere(bench):
    """Zenoh would take a gigabyte for one, in every process that listens. Others go on."""
    heard: list[int] = []
    bench.consumer.declare_subscriber("t/**", lambda sample: heard.append(len(sample.payload)))
    end = time.monotonic() + 60.0
    while 1 not in heard:  # until the router knows who listens
        assert time.monotonic() < end
        bench.honest.put("t/cube/accel", b"x")
        time.sleep(0.01)
    wait = zenoh.CongestionControl.BLOCK
    bench.liar.put("t/cube/accel", bytes(LARGEST + 1), congestion_control=wait)
    bench.liar.put("t/cube/accel", b"xx", congestion_control=wait)
    while (
        LARGEST // 2 not in heard
    ):  # a link that makes no way for seconds is given up, and made anew
        assert time.monotonic() < end, heard
        bench.honest.put("t/cube/accel", bytes(LARGEST // 2), congestion_control=wait)
        time.sleep(0.5)
    assert max(heard) == LARGEST // 2 and connected(bench.consumer) and connected(bench.honest)


def test_many_gaps_of_a_name_that_nobody_has_are_not_asked_for_again_and_again(monkeypatch):
    asked: list[str] = []
    monkeypatch.setattr(
        answers, "ask", lambda session, prefix, device, *_, **__: asked.append(device)
    )
    monkeypatch.setattr(Asker, "RETRY_S", 0.0)
    done = threading.Event()
    fence = Fence(lambda *_: None)
    asker = Asker(None, "t", lambda token, _: done.set() if token == "last" else None, fence)
    for number in range(200):
        asker.ask(number, "made-up", GATEWAY, pb.HistoryQuery())
    asker.ask("last", "cube", GATEWAY, pb.HistoryQuery())
    assert done.wait(60.0)
    asker.close()
    assert asked.count("made-up") == 199 + Asker.RETRIES and asked.count("cube") == Asker.RETRIES
