"""Whose number is believed: real sessions over a real router."""

import contextlib
import functools
import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import pytest
import zenoh
from support.stack import free_port

from messages.bus import claiming
from messages.bus.claiming import FAR_NS, Claim, Claimant, alive, claim
from messages.bus.fencing import Fence, heard_of, packed
from messages.bus.session import BusSettings, connected, open_client, open_router
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import GATEWAY, claim_key
from messages.history import answers
from messages.history.answers import ask, together

KEY, BASE = "t/cube/accel", claim_key("t", GATEWAY, "cube")
HOUR_NS = 3600 * 10**9


@pytest.fixture
def settings():
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    return BusSettings(prefix="t", router=endpoint, listen=[endpoint])


@pytest.fixture
def bus(settings):
    with open_router(settings), open_client(settings) as a, open_client(settings) as b:
        with open_client(settings) as onlooker:
            yield Claimant(a, onlooker), Claimant(b, onlooker)


class Listener:
    """A consumer's fence, and what it refused."""

    def __init__(self, session: zenoh.Session) -> None:
        self.refused: list[str] = []
        self.fence = Fence(lambda key, why, device: self.refused.append(why.kind))
        self.declared = self.fence.declare(session, "t")

    def hears(self, number: int) -> bool:
        return self.fence.admit(KEY, zenoh.ZBytes(packed(number)))

    def knows(self, *numbers: int) -> None:
        """Wait until these are the claimed ones."""
        while self.fence.claims.numbers(KEY) != set(numbers):
            time.sleep(0.005)


def test_a_number_that_nobody_claimed_silences_nobody(bus):
    mine, other = bus
    listener, number = Listener(other.session), time.time_ns()
    serving = Claim(mine, [BASE], number)
    listener.knows(number)
    assert listener.hears(number)
    for forged in (number + 1, number + HOUR_NS, number + FAR_NS, 2**63, 2**64 - 1):
        assert not listener.hears(forged)
        assert listener.hears(number)
    assert listener.refused == ["claim"] * 5
    listener.declared.undeclare()
    serving.release()


def test_a_number_forged_before_anybody_serves_is_outdone(bus):
    mine, other = bus
    listener, number = Listener(other.session), time.time_ns()
    assert listener.hears(number + 10 * HOUR_NS)
    made = claim(
        mine,
        [BASE],
        number,
        threading.Event(),
        lambda other: None,
        lambda: heard_of(mine.session, "t", "cube", GATEWAY),
    )
    assert made.number == number + 10 * HOUR_NS + 1
    listener.knows(made.number)
    assert listener.hears(made.number) and not listener.hears(number)
    assert listener.refused == ["stale"]
    listener.declared.undeclare()
    made.release()


ROUTER = """
import sys
from messages.bus.session import BusSettings, open_router
with open_router(BusSettings(prefix="t", router=sys.argv[1], listen=[sys.argv[1]])):
    print("ready", flush=True)
    sys.stdin.read()
"""


def test_nobody_is_taken_for_gone_while_the_router_does_not_answer(monkeypatch):
    """A machine without time for its router is no reason to take over: both would serve in turn."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    router = subprocess.Popen(
        [sys.executable, "-c", ROUTER, endpoint], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    try:
        assert router.stdout.readline() == b"ready\n"
        settings = BusSettings(prefix="t", router=endpoint, listen=[], lease_ms=500)
        clients = [open_client(settings) for _ in range(3)]
        with clients[0] as session, clients[1] as onlooker, clients[2] as other:
            own = session.liveliness().declare_token(f"{BASE}/waiting-one")
            look = functools.partial(alive, onlooker, [BASE], "waiting-one")
            with other.liveliness().declare_token(f"{BASE}/1-other"):
                while look() is None or look().serving != [(1, "other")]:
                    time.sleep(0.01)
                router.send_signal(signal.SIGSTOP)
                os.waitpid(router.pid, os.WUNTRACED)  # until it has stopped
                while connected(onlooker):  # also at the moment when the connection is given up
                    assert look() is None
                assert look() is None
            monkeypatch.setattr(claiming, "RETRY_S", 0.01)
            stop, ended = threading.Event(), []
            args = Claimant(session, onlooker), [BASE], time.time_ns(), stop, ended.append
            waiting = threading.Thread(target=lambda: ended.append(claim(*args)))
            waiting.start()
            waiting.join(2.5)
            assert waiting.is_alive() and not ended
            router.send_signal(signal.SIGCONT)
            waiting.join(60.0)
            assert ended[0].number == args[2]
            router.kill()
            router.wait()
            while connected(onlooker):
                time.sleep(0.01)
            assert look() is None and not ended[0].look()
            assert not ended[0].lost.is_set()
            own.undeclare()
    finally:
        router.kill()
        router.communicate()


def test_one_that_claims_more_takes_over_and_when_it_is_gone_the_other_is_heard_again(bus):
    mine, other = bus
    listener, number = Listener(other.session), time.time_ns()
    serving = Claim(mine, [BASE], number)
    serving.watch()
    foreign = Claim(other, [BASE], number + HOUR_NS)
    listener.knows(number, number + HOUR_NS)
    assert listener.hears(number) and listener.hears(number + HOUR_NS)
    assert not listener.hears(number)
    assert serving.lost.wait(60.0)
    foreign.release()
    listener.knows(number)
    assert listener.hears(number) and not listener.hears(number + HOUR_NS)
    listener.declared.undeclare()
    serving.release()


def test_a_claim_is_raised_to_the_number_of_its_messages(bus):
    mine, other = bus
    listener, number = Listener(other.session), time.time_ns()
    serving = Claim(mine, [BASE], number)
    serving.watch()
    serving.raise_to(number + 5)
    listener.knows(number + 5)
    assert serving.number == number + 5 and not serving.lost.is_set()
    assert listener.hears(number + 5) and not listener.hears(number)
    listener.declared.undeclare()
    serving.release()


def test_who_watches_and_publishes_can_still_ask_who_is_there(bus):
    """A session answers a query partly itself, with what it has heard as a subscriber: a gateway
    that was stopped for a second never published again.
    """
    mine, other = bus
    number = time.time_ns()
    serving = Claim(mine, [BASE], number)
    serving.watch()
    listener = Listener(mine.session)
    assert all(serving.look() for _ in range(20))
    foreign = Claim(other, [BASE], number + 1)
    assert not serving.look() and serving.lost.is_set()
    listener.declared.undeclare()
    foreign.release()
    serving.release()


def test_of_many_that_start_in_one_moment_one_serves_and_the_others_never_did(
    bus, settings, monkeypatch
):
    """In every round all begin at once; who is refused waits, and is next when the one has gone."""
    monkeypatch.setattr(claiming, "RETRY_S", 0.02)
    served, refused, serving = [], [], []
    start = threading.Barrier(6)

    def begin(k: int, mine: Claimant) -> None:
        start.wait()
        got = claim(mine, [BASE], time.time_ns(), threading.Event(), lambda _: refused.append(k))
        serving.append(got)
        assert len(serving) == 1 and not got.lost.is_set()
        served.append(k)
        time.sleep(0.05)
        serving.remove(got)
        got.release()

    with contextlib.ExitStack() as stack:
        all_of_them = [
            Claimant(stack.enter_context(open_client(settings)), bus[0].onlooker) for _ in range(6)
        ]
        with ThreadPoolExecutor(6) as pool:
            for done in [pool.submit(begin, k, one) for k, one in enumerate(all_of_them)]:
                done.result()
    assert len(set(served)) == 6 and not serving
    assert served[0] not in refused and len(set(refused)) == len(refused) > 0


def reply_of(run: int, *sequences: int) -> pb.HistoryReply:
    reply = pb.HistoryReply()
    for sequence in sequences:
        reply.items.add(topic="accel", run=run, sequence=sequence)
    return reply


def test_of_two_answers_the_older_processs_messages_come_first():
    old, new = reply_of(5, 8, 9), reply_of(7, 1, 2)
    old.items.add(topic="log")  # without a run: it stays behind what it came with
    for order in ([old, new], [new, old]):
        found = together(order)
        rows = [(item.run, item.sequence) for item in found.items]
        assert rows == [(5, 8), (5, 9), (0, 0), (7, 1), (7, 2)]
    assert together([]) is None and together([new]) is new


def test_answers_without_end_are_read_up_to_a_limit(bus, monkeypatch, caplog):
    mine, other = bus

    def flood(query: zenoh.Query) -> None:
        for k in range(200):
            query.reply("t/cube/published/gateway", reply_of(7, k + 1).SerializeToString())

    lying = other.session.declare_queryable("t/cube/published/gateway", flood)
    while (found := ask(mine.session, "t", "cube", GATEWAY, pb.HistoryQuery())) is None:
        time.sleep(0.01)
    assert len(found.items) == answers.MOST_REPLIES
    assert "the rest is left out" in caplog.text
    lying.undeclare()
