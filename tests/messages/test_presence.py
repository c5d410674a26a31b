"""Who is there: real processes that are stopped, go on, end and are killed, over a real router."""

import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.one_thread import held
from support.stack import free_port

from messages.bus.beating import BEAT_S, HERE, Beating, tell_time
from messages.bus.presence import (
    FROZEN_S,
    LOOK_S,
    MOST,
    SETTLE_S,
    Presence,
    Process,
    State,
    Watching,
    viewers,
)
from messages.bus.session import BusSettings, connected, open_client, open_router, subscribe
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import BEAT, claim_key

BEATS = """
import sys, threading
from messages.bus.beating import Beating
from messages.bus.session import BusSettings, open_client
from messages.bus.turning import Loop
bus = BusSettings(prefix="t", router=sys.argv[1], listen=[]).acting_as("gateway")
stop = threading.Event()

def work():
    with Loop("link cube", 1.0) as loop:
        while not stop.wait(0.05):
            loop.turn()

thread = threading.Thread(target=work)
thread.start()
with open_client(bus) as session, Beating(session, bus, ["cube"]):
    print("ready", flush=True)
    sys.stdin.readline()
    stop.set()
    thread.join()
"""


class Watcher:
    """Looks, and waits."""

    def __init__(self, session, presence: Presence) -> None:
        self.session, self.presence, self.changes = session, presence, []

    def until(self, condition: Callable[[], object]) -> None:
        end = time.monotonic() + 120.0
        while not condition():
            assert time.monotonic() < end
            time.sleep(LOOK_S / 2)
            self.changes += self.presence.look(time.monotonic(), connected(self.session))

    def role(self, role: str) -> Process | None:
        return next((one for one in self.presence.all() if one.role == role), None)


@contextmanager
def watching(bus: BusSettings) -> Iterator[Watcher]:
    presence = Presence(HERE)
    with open_client(bus) as session:
        watch = Watching(session, "t", presence)

        def heard(key: str, beat: pb.Beat) -> None:
            _, place, _, name = key.split("/")
            presence.beat(place, name, beat)

        beats = subscribe(session, BEAT, "t", heard)
        yield Watcher(session, presence)
        beats.undeclare()
        watch.undeclare()


@pytest.fixture
def bus() -> BusSettings:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    return BusSettings(prefix="t", router=endpoint, listen=[endpoint])


@contextmanager
def beating(bus: BusSettings) -> Iterator[subprocess.Popen]:
    process = subprocess.Popen(
        [sys.executable, "-c", BEATS, bus.router], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    try:
        assert process.stdout.readline() == b"ready\n"
        yield process
    finally:
        process.kill()
        process.communicate()


def test_a_frozen_process_is_seen_goes_on_and_is_told_from_one_that_is_gone(bus):
    with open_router(bus) as router, watching(bus) as w, beating(bus) as process:
        telling = tell_time(router, "t")
        with open_client(bus) as session, Beating(session, bus, viewers=lambda: {"viewer": 2}):
            w.until(lambda: (one := w.role("gateway")) and one.beats > 2)
            frozen, live = w.role("gateway"), w.role("operator")
            process.send_signal(signal.SIGSTOP)
            at_s, heard = w.presence.now_s, live.beats
            w.until(lambda: frozen.state is State.FROZEN)
            # by the watch's own time, which does not run while it gets no processor
            assert w.presence.now_s - at_s <= FROZEN_S + BEAT_S and frozen.token
            beats = frozen.beats
            w.until(lambda: live.beats > heard + 2)
            assert frozen.beats == beats and live.state is State.RUNNING
            process.send_signal(signal.SIGCONT)
            w.until(lambda: frozen.state is State.RUNNING and frozen.beats > beats)
            assert viewers(w.presence.all()) == {"viewer": 2}
            assert w.presence.gateway_of("cube") is frozen
            w.until(lambda: live.beat.clock_bound_s > 0)
            assert abs(live.beat.clock_ahead_s) <= live.beat.clock_bound_s < 1.0
            process.kill()
            w.until(lambda: frozen.state is State.GONE)
            assert not frozen.token and not frozen.froze
        w.until(lambda: live.state is State.ENDED)
        telling.undeclare()
        with beating(bus) as other:  # one of its kind has taken its place
            w.until(lambda: w.role("gateway") not in (None, frozen))
            other.stdin.write(b"\n")
            other.stdin.flush()
            w.until(lambda: w.role("gateway").state is State.ENDED)


def test_a_process_whose_thread_that_works_is_stopped_hangs_while_it_beats(bus):
    with open_router(bus), watching(bus) as w, beating(bus) as process:
        w.until(lambda: (one := w.role("gateway")) and one.beats > 2)
        one = w.role("gateway")
        assert one.state is State.RUNNING and one.beat.loop == "link cube"
        with held(process.pid, "link cube"):
            beats = one.beats
            w.until(lambda: one.state is State.HUNG)
            # counted by beats, of which each adds half a second at most
            assert (one.beats - beats) * BEAT_S > one.beat.turn_most_s == 1.0
            beats = one.beats
            w.until(lambda: one.beats > beats + 1)
            assert one.state is State.HUNG and one.beat.turn_ago_s > 1.5
        w.until(lambda: one.state is State.RUNNING)


def test_without_a_router_nothing_is_known_and_nobody_is_blamed_when_it_comes_back(bus):
    with watching_after(bus) as (w, stop_router, start_router), open_client(bus) as session:
        with Beating(session, bus):
            w.until(lambda: (one := w.role("operator")) and one.beats > 1)
            one = w.role("operator")
            stop_router()
            w.until(lambda: one.state is State.UNKNOWN)
            assert not w.presence.sees
            start_router()
            w.until(lambda: one.state is State.RUNNING and w.presence.sees)
    assert not [
        change for change in w.changes if change.process.state in (State.FROZEN, State.GONE)
    ]


@contextmanager
def watching_after(bus: BusSettings) -> Iterator[tuple[Watcher, Callable, Callable]]:
    routers = [open_router(bus)]
    try:
        with watching(bus) as w:
            yield w, lambda: routers.pop().close(), lambda: routers.append(open_router(bus))
    finally:
        for one in routers:
            one.close()


# --- what is judged, without a bus


def beat(place: str = "lab", **fields: object) -> pb.Beat:
    one = pb.Beat(**fields)
    one.header.device = place
    return one


def looked(presence: Presence, seconds: float, connected: bool = True) -> None:
    """Time passes, and somebody looks often enough."""
    start = presence._looked or 0.0
    for k in range(1, int(seconds / LOOK_S) + 1):
        presence.look(start + k * LOOK_S, connected)


def test_a_watcher_that_was_frozen_itself_blames_nobody():
    presence = Presence()
    presence.look(0.0)
    presence.token("t/lab/alive/gateway-1", True)
    presence.beat("lab", "gateway-1", beat(role="gateway"))
    assert not presence.look(1000.0)
    assert presence.all()[0].state is State.RUNNING
    looked(presence, 2.0)
    assert presence.all()[0].state is State.FROZEN


def test_when_nobody_is_heard_it_is_the_router_and_nobody_else_is_blamed():
    """The router was stopped: its connections stand, and nothing passes."""
    presence, roles = Presence("lab"), ("router", "gateway", "recorder", "estimator")
    presence.look(0.0)

    def all_beat() -> None:
        for role in roles:
            presence.token(f"t/lab/alive/{role}-1", True)
            presence.beat("lab", f"{role}-1", beat(role=role))
        presence.look(presence._looked)

    all_beat()
    looked(presence, 4.0)
    states = {one.role: one.state for one in presence.all()}
    assert states.pop("router") is State.FROZEN and set(states.values()) == {State.UNKNOWN}
    assert not presence.sees
    presence.beat("lab", "gateway-1", beat(role="gateway"))  # the first that is heard again
    looked(presence, 0.5)
    assert not [one.role for one in presence.all() if one.state in (State.FROZEN, State.GONE)][1:]
    all_beat()
    assert {one.state for one in presence.all()} == {State.RUNNING}


def test_a_place_of_which_nothing_is_heard_is_out_of_reach_and_our_own_never():
    presence = Presence("lab")
    presence.look(0.0)
    for place in ("lab", "office"):
        for name in ("dashboard-1", "router-1"):
            presence.token(f"t/{place}/alive/{name}", True)
        presence.beat(place, "dashboard-1", beat(place, role="dashboard"))
        presence.beat(place, "router-1", beat(place, role="router"))
    looked(presence, SETTLE_S)
    assert presence.out_of_reach("office") and not presence.out_of_reach("lab")
    presence.beat("office", "router-1", beat("office", role="router"))
    presence.look(presence._looked + LOOK_S)
    assert not presence.out_of_reach("office")


def test_beats_without_a_token_are_forgotten_when_they_end():
    presence = Presence("lab")
    presence.look(0.0)
    presence.beat("lab", "gateway-1", beat(role="gateway"))
    looked(presence, 2.0)
    assert not presence.all()


def test_two_gateways_that_want_one_board_are_named():
    presence, key = Presence(), claim_key("t", "gateway", "cube")
    presence.beat("lab", "gateway-aa", beat(role="gateway", session="aa"))
    presence.beat("bench2", "gateway-bb", beat("bench2", role="gateway", session="bb"))
    presence.claimants.heard(f"{key}/7-aa", True)
    assert not presence.twins()
    presence.claimants.heard(f"{key}/waiting-9-bb", True)
    assert presence.twins() == {"cube": "gateway at lab (publishes) and gateway at bench2 (waits)"}
    presence.claimants.heard(f"{key}/8-aa", True)  # raised to another number: one and the same
    presence.claimants.heard(f"{key}/7-aa", False)
    presence.claimants.heard(f"{key}/waiting-9-bb", False)
    assert not presence.twins() and presence.claimants.serving("cube") == {"aa"}


@given(
    st.lists(st.tuples(st.sampled_from("btcl"), st.text(max_size=60), st.booleans()), max_size=60)
)
def test_whatever_is_heard_nothing_breaks_and_memory_is_bounded(said):
    presence, now = Presence(), 0.0
    for kind, text, flag in said:
        now += 0.3
        if kind == "b":
            presence.beat(text, text, beat(leaving=flag))
        elif kind == "t":
            presence.token(f"t/{text}/alive/{text}", flag)
        elif kind == "c":
            presence.claimants.heard(f"t/{text}/gateway/{text}", flag)
        else:
            presence.look(now, flag)
        assert presence.twins() == {} and presence.places() is not None
    for k in range(MOST + 5):
        presence.beat("lab", f"x-{k}", beat())
    assert len(presence.processes) <= MOST and presence.refused >= 5
