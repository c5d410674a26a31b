"""Orders over a real router: every way in which one can end has its own words."""

import contextlib
import threading
import time

import pytest

from messages.bus import deadline, orders
from messages.bus.session import BusSettings, open_client, open_router
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import TopicError, control_key
from sessions.recording.recorder import Recorder
from sessions.recording.settings import RecorderSettings

PATIENCE = 20.0  # s; until the router knows of a queryable


@pytest.fixture
def bus(free_port):
    endpoint = f"tcp/127.0.0.1:{free_port}"
    settings = BusSettings(prefix="t", router=endpoint, listen=[endpoint])
    with open_router(settings):
        yield settings


@pytest.fixture
def asker(bus):
    with open_client(bus, timeout_s=PATIENCE) as session:
        yield session


@pytest.fixture
def taking(bus):
    """A service on a session of its own that takes orders; called with kind, handler, device."""
    with open_client(bus, timeout_s=PATIENCE) as session:
        yield lambda kind, handler, device="": orders.take(session, "t", kind, handler, device)


def known(asker, kind, device="", timeout_s=None, **fields):
    """Give an order as soon as somebody is there to take it."""
    end = time.monotonic() + PATIENCE
    while True:
        try:
            return orders.give(asker, "t", kind, kind.command(**fields), device, timeout_s)
        except orders.NoAnswer:
            assert time.monotonic() < end, "nobody took the order"
            time.sleep(0.02)


def test_the_answer_comes_to_who_asked_and_the_command_arrives_whole(asker, taking):
    taken = []

    def handler(order):
        taken.append((order.device, order.command))
        order.answer(pb.Reply(ok=True, message="done"))

    taking(orders.BOARD, handler, "cube")
    answer = known(asker, orders.BOARD, "cube", name="batch", value=4)
    assert answer == pb.Reply(ok=True, message="done")
    assert taken == [("cube", pb.BoardCommand(name="batch", value=4))]


def test_an_answer_may_come_later_from_another_thread(asker, taking):
    waiting = []
    taking(orders.ESTIMATOR, waiting.append, "*")

    def answer():
        end = time.monotonic() + PATIENCE
        while not waiting and time.monotonic() < end:
            time.sleep(0.01)
        order = waiting.pop()
        order.answer(pb.Reply(ok=True, message=f"for {order.device}"))

    thread = threading.Thread(target=answer)
    thread.start()
    assert known(asker, orders.ESTIMATOR, "car").message == "for car"
    thread.join(PATIENCE)


@pytest.mark.timeout(5 * PATIENCE)  # less than who asks has time for
@pytest.mark.parametrize("said", [pb.Reply(ok=True), None])
def test_an_answer_does_not_wait_until_the_order_is_forgotten(asker, taking, said):
    kept = []

    def handler(order):
        kept.append(order)  # a worker does until its next message
        order.answer(said) if said else order.refuse("not now")

    taking(orders.BOARD, handler, "cube")
    with contextlib.nullcontext() if said else pytest.raises(orders.Refused):
        assert known(asker, orders.BOARD, "cube", timeout_s=10 * PATIENCE) == said


def test_a_refusal_is_passed_on_as_it_was_said(asker, taking):
    taking(orders.REPLAY, lambda order: order.refuse("the recording is being closed"))
    with pytest.raises(orders.Refused, match=r"^the replay: the recording is being closed$"):
        known(asker, orders.REPLAY)


def test_a_recorder_that_stops_says_that_it_stops(asker, taking, bus, tmp_path):
    recorder = Recorder(RecorderSettings(root=tmp_path, auto_start=False), bus)

    def stop_with(order):
        recorder.on_order(order)
        recorder.close()

    taking(orders.RECORDER, stop_with)
    with pytest.raises(orders.Refused, match=r"^the recorder: it is stopping$"):
        known(asker, orders.RECORDER)


@pytest.mark.parametrize("kind", [orders.RECORDER, orders.ESTIMATOR, orders.BOARD, orders.REPLAY])
def test_where_nobody_is_the_words_say_what_to_look_at(asker, kind):
    with pytest.raises(orders.NoAnswer, match=f"{kind.who} does not answer: {kind.look}"):
        orders.give(asker, "t", kind, kind.command(), "cube")


def test_who_is_slow_did_not_answer_in_time(asker, taking):
    kept = []

    def handler(order):
        if kept:
            kept.append(order)  # as long as it is kept, its answer may still come
        else:
            kept.append(None)
            order.answer(pb.Reply(ok=True))

    taking(orders.BOARD, handler, "cube")
    known(asker, orders.BOARD, "cube", name="hello")
    with pytest.raises(orders.NoAnswer, match=r"the gateway did not answer within 0\.3 s"):
        orders.give(asker, "t", orders.BOARD, pb.BoardCommand(), "cube", timeout_s=0.3)


def test_bytes_that_are_no_command_and_orders_for_several_are_refused(asker, taking):
    taking(orders.BOARD, lambda order: order.answer(pb.Reply(ok=True)), "cube")
    known(asker, orders.BOARD, "cube", name="hello")
    replies = list(asker.get(control_key("t", "cube", "board-control"), payload=b"\xff\xff"))
    assert [r.err.payload.to_bytes() for r in replies] == [b"2 bytes are no BoardCommand"]
    with pytest.raises(orders.Refused, match="an order is for one device, not for t/\\*/"):
        orders.give(asker, "t", orders.BOARD, pb.BoardCommand(), "*")


def test_an_answer_of_another_make_is_said(asker, bus):
    with open_client(bus, timeout_s=PATIENCE) as session:
        key = control_key("t", "cube", "board-control")
        session.declare_queryable(key, lambda query: query.reply(key, b"\xff\xff\xff"))
        end = time.monotonic() + PATIENCE
        while True:
            with pytest.raises(orders.NoAnswer) as told:
                orders.give(asker, "t", orders.BOARD, pb.BoardCommand(), "cube")
            if "does not answer" not in str(told.value) or time.monotonic() > end:
                break
        assert "the gateway answered with 3 bytes that are no Reply" in str(told.value)


def test_without_a_router_or_with_a_strange_name_nothing_is_sent(bus):
    with pytest.raises(orders.NoAnswer, match="no connection to the router yet"):
        orders.give(None, "t", orders.RECORDER, pb.RecorderCommand())
    session = open_client(bus, timeout_s=PATIENCE)
    with pytest.raises(TopicError):
        orders.give(session, "t", orders.BOARD, pb.BoardCommand(), "../x")
    session.close()
    with pytest.raises(orders.NoAnswer, match="the order cannot be sent"):
        orders.give(session, "t", orders.BOARD, pb.BoardCommand(), "cube")


def test_an_order_that_waited_until_its_giver_had_given_up_is_not_carried_out(asker, bus):
    """As of a service that was stopped by a signal: what was ordered meanwhile waits for it."""
    taken, held = [], threading.Event()

    def handler(order):
        taken.append(order.command.name or order.command.ask)
        held.wait(PATIENCE)  # the first one stops it
        order.answer(pb.Reply(ok=True))

    with open_client(bus, timeout_s=PATIENCE) as session:
        deadline.heard(0, 0.0)
        orders.take(session, "t", orders.BOARD, handler, "cube")
        while not taken:
            with contextlib.suppress(orders.NoAnswer):
                orders.give(
                    asker, "t", orders.BOARD, pb.BoardCommand(name="start"), "cube", timeout_s=0.2
                )
        with pytest.raises(orders.NoAnswer):
            order = pb.BoardCommand(name="self_test")
            orders.give(asker, "t", orders.BOARD, order, "cube", timeout_s=0.2)
        with pytest.raises(orders.NoAnswer):  # who only asks does no harm
            order = pb.BoardCommand(ask=True)
            orders.give(asker, "t", orders.BOARD, order, "cube", timeout_s=0.2)
        time.sleep(1.0)
        held.set()
        again = known(asker, orders.BOARD, "cube", timeout_s=PATIENCE, name="batch", value=4)
        assert again.ok and "batch" in taken and True in taken and "self_test" not in taken


def test_a_deadline_that_is_none_spoils_no_order():
    deadline.heard(0, 0.0)
    for said in (None, "", "x", "-5", "9" * 40, "\u0663", "1e9"):
        assert deadline.late_s(said) == 0.0
    assert deadline.late_s("0") > 1.0
    deadline.heard(0, 3e9)  # a comparison that may be off by more than an order lasts
    assert deadline.until(8.0) == "" and deadline.late_s("0") == 0.0
