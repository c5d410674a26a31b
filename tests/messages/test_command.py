"""The command of a site: its rules as laws, and over a real router with several pages."""

import contextlib
import threading
from collections import deque

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.waiting import until

from dashboard.desk import Desk
from messages.bus import orders
from messages.bus.command import state
from messages.bus.command.history import KEPT, History, newest_of
from messages.bus.command.keeper import Keeper
from messages.bus.command.state import Held, Refusal, Seat
from messages.bus.session import BusSettings, Publishers, open_client, open_router
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import ORDER

SEATS = [Seat(f"s{n}", f"user{n}", "lab", admin=n == 2) for n in range(3)]
VERBS = {
    "take": state.taken,
    "force": state.forced,
    "ask": state.asked,
    "give": lambda held, seat, *now: state.granted(held, seat, "", *now),
    "deny": lambda held, seat, *now: state.denied(held, seat),
    "release": state.released,
    "keep": lambda held, seat, now_s, utc_ns: state.kept(held, seat, now_s),
    "wait": lambda held, seat, *now: state.ticked(held, *now),
}


@given(st.lists(st.tuples(st.sampled_from(list(VERBS)), st.integers(0, 2), st.floats(0, 40))))
def test_whatever_is_asked_one_has_it_and_nobody_loses_it_against_the_rules(steps):
    held, now = Held(), 0.0
    for verb, who, pause in steps:
        now += pause
        before, seat = held, SEATS[who]
        with contextlib.suppress(Refusal):
            held = VERBS[verb](held, seat, now, int(now * 1e9))
        assert held.epoch >= before.epoch
        assert held.asks is None or held.asks.id != (held.holder and held.holder.id)
        if held.holder == before.holder:
            continue
        assert held.epoch == before.epoch + 1
        if before.holder is None:
            assert held.holder == seat and verb in ("take", "force", "ask")
            continue
        silent = now - before.seen_s > state.AWAY_S
        unanswered = before.asks is not None and now - before.asked_s > state.ANSWER_S
        by_time = verb == "wait" and (silent or unanswered)
        by_himself = before.holder == seat and verb in ("give", "release")
        by_admin = verb == "force" and seat.admin
        assert by_time or by_himself or by_admin, verb


def test_who_asks_gets_it_without_an_answer_and_not_a_moment_before():
    otto, anna, _ = SEATS
    held = state.asked(state.taken(Held(), otto, 0.0, 0), anna, 1.0, 0)
    held = state.kept(state.kept(held, otto, 30.9), anna, 30.9)
    assert state.ticked(held, 1.0 + state.ANSWER_S, 0).holder == otto
    after = state.ticked(held, 1.1 + state.ANSWER_S, 0)
    assert after.holder == anna and "did not answer" in after.last
    with pytest.raises(Refusal, match="asks for it already"):
        state.asked(held, SEATS[2], 31.0, 0)


def test_the_history_is_bounded_found_again_and_survives_a_line_that_was_cut(tmp_path, monkeypatch):
    monkeypatch.setattr("messages.bus.command.history.LARGEST", 60_000)
    path = tmp_path / "orders.jsonl"
    kept = History(path)
    for number in range(1500):
        kept.add(pb.OrderGiven(user="otto", what=f"start {number}", seconds=0.5))
    kept.add(pb.OrderGiven(user="anna", what="stop", outcome=pb.OrderGiven.OUTCOME_NO_ANSWER))
    assert path.stat().st_size < 70_000 and len(list(tmp_path.iterdir())) == 2
    with path.open("a") as stream:
        stream.write('{"user": "ot')
    again = History(path)
    assert [one.what for one in again.find("", 2)] == ["stop", "start 1499"]
    assert [one.user for one in again.find("no answer", 5)] == ["anna"]
    assert len(again.find("otto", KEPT)) <= KEPT


@pytest.fixture
def bus(free_port):
    endpoint = f"tcp/127.0.0.1:{free_port}"
    settings = BusSettings(prefix="t", router=endpoint, listen=[endpoint])
    with open_router(settings):
        yield settings


class Site:
    """A keeper, a recorder, a table's procedures, and two places with a page each."""

    def __init__(self, bus, folder, stack):
        def client():
            return stack.enter_context(open_client(bus, timeout_s=20.0))

        self.folder, self.session = folder, client()
        self.taken: list[object] = []
        self.keeper = self.new_keeper()
        for kind in (orders.RECORDER, orders.PROCEDURES, orders.BOARD):
            device = "cube" if kind is orders.BOARD else "*" if kind is orders.PROCEDURES else ""
            orders.take(client(), "t", kind, self.on_order, device)
        self.alive = {"s-otto", "s-anna", "s-root"}
        self.pages = [Desk(client(), "t", place=place) for place in ("lab", "office")]
        self.otto = self.pages[0].of(pb.Seat(id="s-otto", user="otto"))
        self.anna = self.pages[1].of(pb.Seat(id="s-anna", user="anna"))
        self.root = self.pages[1].of(pb.Seat(id="s-root", user="root", admin=True))

    def new_keeper(self):
        return Keeper(self.session, "t", self.folder)

    def here(self, seat):
        return seat in self.alive

    def on_order(self, order):
        self.taken.append(order.command)
        status = pb.RecorderStatus(recording=True)
        recorder = isinstance(order.command, pb.RecorderCommand)
        order.answer(status if recorder else pb.Reply(ok=True, message="done"))

    def holder(self):
        return [page.status.holder.user for page in self.pages]


@pytest.fixture
def site(bus, tmp_path):
    with contextlib.ExitStack() as stack:
        made, ended = Site(bus, tmp_path, stack), threading.Event()

        def serve():
            while not ended.wait(0.05):
                made.keeper.step()

        running = [threading.Thread(target=serve)]
        running += [
            threading.Thread(target=page.keep, args=(ended, made.here)) for page in made.pages
        ]
        for thread in running:
            thread.start()
        try:
            until(lambda: all(page.status is not None for page in made.pages), "it is heard of")
            yield made
        finally:
            ended.set()
            for thread in running:
                thread.join()


START = pb.RecorderCommand(action=pb.RecorderCommand.ACTION_START, name="one")
HALT = pb.ProcedureCommand(action=pb.ProcedureCommand.ACTION_STOP, device="cube")


def test_one_commands_others_are_refused_by_name_and_everybody_may_stop(site):
    assert site.otto.barred() == site.anna.barred() == ""
    site.otto.recorder(START)  # it was free: taken without a word
    until(lambda: site.holder() == ["otto", "otto"], "both places know")
    assert "otto (lab) has the command" in site.anna.barred()
    with pytest.raises(orders.Refused, match="otto .lab. has the command"):
        site.anna.recorder(START)
    assert site.anna.procedure(HALT).ok and site.anna.barred()
    # whoever goes past his page is refused where it would be carried out
    client = site.session
    for by in (None, pb.OrderBy(seat=pb.Seat(id="s-anna", user="anna"))):
        with pytest.raises(orders.Refused, match="otto .lab. has the command"):
            orders.give(client, "t", orders.RECORDER, START, by=by)
    status = pb.RecorderCommand(action=pb.RecorderCommand.ACTION_STATUS)
    assert orders.give(client, "t", orders.RECORDER, status).recording
    # asked for and given
    site.anna.command(pb.SeatCommand.ACTION_ASK)
    until(lambda: site.otto.status.asks.user == "anna", "otto sees who asks")
    site.otto.command(pb.SeatCommand.ACTION_GRANT, to="s-anna")
    until(lambda: site.holder() == ["anna", "anna"], "it has passed")
    site.anna.recorder(START)
    with pytest.raises(orders.Refused, match="anna .office. has the command"):
        site.otto.board("cube", pb.BoardCommand(name="start"))
    # an admin takes it, nobody else does
    with pytest.raises(orders.Refused, match="role admin"):
        site.otto.command(pb.SeatCommand.ACTION_FORCE)
    site.root.command(pb.SeatCommand.ACTION_FORCE)
    until(lambda: site.holder() == ["root", "root"], "the admin has it")
    until(lambda: len(site.otto.history("", 20)[0]) >= 8, "all orders are kept")
    rows, why = site.otto.history("", 20)
    passed = [r.what for r in reversed(rows) if r.whom == "who keeps the command"]
    assert passed == [
        "otto (lab) took it, it was free",
        "otto (lab) gave it to anna (office)",
        "root (office) took it from anna (office), as admin",
    ]
    # of two places they may be heard of in either order (docs/command.md)
    rows = [r for r in rows if r.whom != "who keeps the command"]
    rows.sort(key=lambda r: r.at_utc_ns)
    said = [(r.user, r.place, r.what, r.outcome, r.seconds >= 0.0) for r in rows]
    done, refused = pb.OrderGiven.OUTCOME_DONE, pb.OrderGiven.OUTCOME_REFUSED
    assert not why and said == [
        ("otto", "lab", "start one", done, True),
        ("anna", "office", "start one", refused, True),
        ("anna", "office", "stop", done, True),
        ("anna", "office", "start one", done, True),
        ("otto", "lab", "set start 0", refused, True),
    ]


def test_a_sign_in_that_ends_lets_go_and_a_keeper_that_was_killed_knows_still(site):
    site.otto.recorder(START)
    until(lambda: site.holder() == ["otto", "otto"], "otto has it")
    site.keeper.close()
    site.keeper = site.new_keeper()
    epoch = site.otto.status.epoch
    site.otto.recorder(START)
    assert site.otto.status.epoch == epoch and site.otto.status.holder.user == "otto"
    with pytest.raises(orders.Refused, match="otto"):
        site.anna.recorder(START)
    site.alive.discard("s-otto")  # he signs out
    until(lambda: site.holder() == ["", ""], "nobody has it")
    assert "otto (lab) signed out" in site.anna.status.last
    site.anna.recorder(START)
    assert site.anna.status.holder.user == "anna"


def test_an_order_is_of_the_place_that_its_key_says_whatever_is_in_it(site):
    done = pb.OrderGiven.OUTCOME_DONE
    said = pb.OrderGiven(at_utc_ns=1, user="otto", place="lab", what="forged", outcome=done)
    Publishers(site.session, "t").put(ORDER, "office", said)
    until(lambda: site.otto.history("forged", 5)[0], "it is kept")
    assert [one.place for one in site.otto.history("forged", 5)[0]] == ["office"]


def test_without_a_keeper_everybody_orders_as_before(bus):
    with open_client(bus, timeout_s=20.0) as session:
        taken = []
        taking = orders.take(
            session,
            "t",
            orders.RECORDER,
            lambda o: (taken.append(1), o.answer(pb.RecorderStatus())),
        )
        desk = Desk(session, "t").of(pb.Seat(id="s-otto", user="otto"))
        desk.recorder(START)
        assert taken and desk.barred() == "" and desk.status is None
        rows, why = desk.history("otto", 5)
        assert [one.what for one in rows] == ["start one"] and "gyrofree procedures" in why
        taking.undeclare()


def test_an_order_that_is_given_while_the_history_is_read_disturbs_nobody():
    kept = deque([pb.OrderGiven(user="ada"), pb.OrderGiven(user="bob")])

    class Meanwhile(list):
        """Words; while one is compared another order comes, as from a second thread."""

        def __iter__(self):
            kept.append(pb.OrderGiven(user="eve"))
            return super().__iter__()

    class Asked(str):
        def lower(self):
            return self

        def split(self, *_):
            return Meanwhile(["ada"])

    assert [one.user for one in newest_of(kept, Asked(), 10)] == ["ada"]
