"""Who is there: what tokens and beats (beating.py) say of every process of every place.

A process whose beats end while its token stands is frozen; one whose token went without its last
word is gone; one that beats and whose main work stands (turning.py) hangs. Time is counted by the
looks of whoever watches, at most LOOK_S from one to the next: a watcher that was frozen itself, or
had no router, blames nobody for it. Nor is a machine without time taken for a frozen process: the
others of its place must have beaten PACE times since its last beat.
"""

import statistics
import threading
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from enum import Enum

import zenoh

from messages.bus.claimants import Claimants
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import GATEWAY, check_name

FROZEN_S = 1.5  # without a beat, of which there are two a second, ...
PACE = 3  # ... while others of its place beat so often
SETTLE_S = 5.0  # after a router came back, for all others to find it too
QUIET_S = 0.75  # without a beat of anybody of a place, of several: the way there is stuck
AGAIN_S = 1.0  # after that, for the next beat of each
LOOK_S = 0.25  # the longest time between two looks that counts
OUT_S = 3.0  # without a beat of anybody of another place
ENDED_S = 10.0  # one that ended as it should is listed for so long
GONE_S = 3600.0  # and one that went without a word
MOST = 512  # processes
ROUTER = "router"  # role


class State(Enum):
    """Of a process, as whoever watches sees it."""

    RUNNING = "running"
    HUNG = "hung"  # it beats, and its main work stands
    FROZEN = "frozen"
    GONE = "gone"
    ENDED = "ended"
    UNKNOWN = "not known"  # the router does not answer us


@dataclass
class Process:
    """What is known of one process."""

    place: str
    name: str  # among those of its place
    beat: pb.Beat = field(default_factory=pb.Beat)
    token: bool = False
    held: bool = False  # a token, at some time: without one, beats are anybody's
    beats: int = 0  # that were heard
    heard_s: float = 0.0  # when the last one was, by the watch
    newest: deque[float] = field(default_factory=lambda: deque(maxlen=PACE))  # likewise, the last
    state: State = State.RUNNING
    since_s: float = 0.0  # that it is in this state, by the watch
    froze: bool = False  # before it went
    alone: bool = False  # nobody of its place beats whose pace it could be measured by

    @property
    def role(self) -> str:
        """From its name: a process that never beat has one, too."""
        return self.beat.role or self.name.rpartition("-")[0] or self.name

    @property
    def lives(self) -> bool:
        """Does it beat?"""
        return self.state in (State.RUNNING, State.HUNG)

    @property
    def stands(self) -> bool:
        """Does it say that a loop of its own has not turned for longer than it may?"""
        return self.beat.turn_ago_s > self.beat.turn_most_s > 0.0


@dataclass(frozen=True)
class Change:
    """A process turned to another state."""

    process: Process
    before: State


class Presence:
    """All processes; beats and looks come from one thread, tokens from Zenoh's."""

    def __init__(self, at: str = "") -> None:
        """at: our own place; empty: what our own beats say, if we have any."""
        self._at = at
        self.own = ""  # id of our own session
        self.processes: dict[tuple[str, str], Process] = {}
        self.claimants = Claimants()
        self.refused = 0  # processes beyond what is remembered
        self.now_s = 0.0  # by the watch
        self._looked: float | None = None
        self._settled_s = -SETTLE_S  # since when there is a router
        self._connected = True
        self._quiet: dict[str, float] = {}  # places of which nobody is heard; until when, by now
        self._mine: Process | None = None  # as of the last look
        self._paces: dict[str, float] = {}  # places: since when half of those who live beat PACE
        self._lock = threading.RLock()

    # --- what is heard

    def beat(self, place: str, name: str, beat: pb.Beat) -> None:
        """A beat came in."""
        with self._lock:
            one = self._process(place, name)
            if one is not None:
                one.beat, one.heard_s, one.beats = beat, self.now_s, one.beats + 1
                one.newest.append(self.now_s)

    def token(self, key: str, there: bool) -> None:
        """Zenoh's thread: a token of a process (alive_key) came or went."""
        parts = key.split("/")
        with self._lock:
            known = len(parts) == 4 and (there or (parts[1], parts[3]) in self.processes)
            one = self._process(parts[1], parts[3]) if known else None
            if one is not None:
                if there and not one.token:
                    one.heard_s = self.now_s  # the first beat is given its time
                one.token, one.held = there, one.held or there

    def _process(self, place: str, name: str) -> Process | None:
        known = self.processes.get((place, name))
        if known is None:
            if len(self.processes) >= MOST:
                self.refused += 1
                return None
            known = self.processes[place, name] = Process(place, name, heard_s=self.now_s)
            known.since_s = self.now_s
        return known

    # --- what that comes to

    def look(self, monotonic_s: float, connected: bool = True) -> list[Change]:
        """Judge all, after what waited has been taken in; what turned to another state."""
        with self._lock:
            passed = 0.0 if self._looked is None else monotonic_s - self._looked
            self._looked = monotonic_s
            if connected and not self._connected:
                self._settled_s = self.now_s
            self._connected = connected
            if connected:
                self.now_s += min(max(passed, 0.0), LOOK_S)
            self._listen()
            self._measure()
            changes = []
            for key, one in list(self.processes.items()):
                state = self._judge(one)
                if state is not one.state:
                    changes.append(Change(one, one.state))
                    one.froze = state is State.GONE and one.state is State.FROZEN
                    one.state, one.since_s = state, self.now_s
                if self._done_with(one):
                    del self.processes[key]
            return changes

    def _is_near(self, one: Process) -> bool:
        """Ourselves, or our router: what they say says nothing of what passes it."""
        own = bool(self.own) and one.beat.session == self.own
        return own or (one.role, one.place) == (ROUTER, self.here)

    def _listen(self) -> None:
        """Of which places nothing is heard at all: none of their several services is to blame."""
        heard: dict[str, list[float]] = {}
        for one in self.processes.values():
            if one.state not in (State.GONE, State.ENDED) and not self._is_near(one):
                heard.setdefault(one.place, []).append(one.heard_s)
        for place, times in heard.items():
            if len(times) > 1 and self.now_s - max(times) > QUIET_S:
                self._quiet[place] = self.now_s + AGAIN_S
        for place in [p for p, until_s in self._quiet.items() if until_s < self.now_s]:
            del self._quiet[place]

    def _measure(self) -> None:
        """How slowly those beat who live, by place: of a machine without time all are slow."""
        since: dict[str, list[float]] = {}
        self._mine = self.mine
        for one in self.processes.values():
            alive = one.lives and self.now_s - one.heard_s <= FROZEN_S
            if alive and len(one.newest) == PACE:
                since.setdefault(one.place, []).append(one.newest[0])
        self._paces = {place: statistics.median(times) for place, times in since.items()}

    def _is_silent(self, one: Process) -> bool:
        """Longer than a process that runs can be? Our own beats tell of our own time alone."""
        if one is self._mine or self.now_s - one.heard_s <= FROZEN_S:
            return False
        pace_s = self._paces.get(one.place)
        one.alone = pace_s is None
        if pace_s is None:
            return self._mine is None or one.place != self._mine.place
        return one.heard_s < pace_s

    def _is_untold(self, one: Process) -> bool:
        """Another process speaks for it, which says nothing itself."""
        teller = self.processes.get((one.place, one.beat.told_by)) if one.beat.told_by else one
        return teller is None or (teller is not one and not teller.lives)

    def _judge(self, one: Process) -> State:
        if not self._connected:
            return State.UNKNOWN if one.state is not State.ENDED else State.ENDED
        if one.beat.leaving:
            return State.ENDED
        if not self._is_silent(one):
            return State.HUNG if one.stands else State.RUNNING
        stuck = one.place in self._quiet and not self._is_near(one)
        back = one.heard_s > self._settled_s  # after a router was gone each finds it in its time
        settling = self.now_s - self._settled_s < SETTLE_S * (1 if back else 2)
        if stuck or settling or self._is_untold(one):
            return State.UNKNOWN if one.lives else one.state
        return State.FROZEN if one.token else State.GONE

    def _done_with(self, one: Process) -> bool:
        for_s = self.now_s - one.since_s
        if one.state is State.ENDED:
            return for_s > ENDED_S
        if one.state is not State.GONE and (one.state is not State.UNKNOWN or one.token):
            return False
        replaced = any(
            other.place == one.place and other.role == one.role and other.lives
            for other in self.processes.values()
        )
        return replaced or for_s > GONE_S or not (one.beats and one.held)

    # --- what is asked

    @property
    def sees(self) -> bool:
        """Can it be told now who is there?"""
        own_quiet = self.here in self._quiet
        return self._connected and not own_quiet and self.now_s - self._settled_s >= SETTLE_S

    def all(self) -> list[Process]:
        """By place and role."""
        with self._lock:
            found = list(self.processes.values())
        return sorted(found, key=lambda one: (one.place, one.role, one.name))

    def places(self) -> list[str]:
        """Their names."""
        return sorted({one.place for one in self.all()})

    def by_session(self, session: str) -> Process | None:
        """The process with this session; None where none has said so."""
        return next((one for one in self.all() if session and one.beat.session == session), None)

    @property
    def mine(self) -> Process | None:
        """Our own."""
        return self.by_session(self.own)

    @property
    def here(self) -> str:
        """Our own place; empty where that is not known."""
        mine = self.mine
        return self._at or (mine.place if mine is not None else "")

    def out_of_reach(self, place: str) -> bool:
        """Is every process of another place silent? Then it is the way there that is cut, or the
        whole place.
        """
        there = [one for one in self.all() if one.place == place and one.state is not State.ENDED]
        silent = all(self.now_s - one.heard_s > OUT_S for one in there)
        return bool(there) and silent and self._connected and self.here not in ("", place)

    def gateway_of(self, device: str) -> Process | None:
        """Whose gateway publishes a board: the one that claimed it, else the one that names it."""
        serving = self.claimants.serving(device)
        named = [one for one in self.all() if device in one.beat.devices]
        return next((one for one in named if one.beat.session in serving), None) or next(
            iter(named), None
        )

    def twins(self) -> dict[str, str]:
        """Boards that several gateways want, and who they are, in words."""
        return {
            device: " and ".join(self._called(id_, device) for id_ in ids)
            for device, ids in self.claimants.contested().items()
        }

    def _called(self, session: str, device: str) -> str:
        one = self.by_session(session)
        where = f"{one.role} at {one.place}" if one is not None else f"session {session[:8]}"
        doing = "publishes" if session in self.claimants.serving(device) else "waits"
        return f"{where} ({doing})"


class Watching:
    """Subscribes a presence to tokens; beats come through whoever listens to the bus, or through
    `beats`.
    """

    def __init__(self, session: zenoh.Session, prefix: str, presence: Presence) -> None:
        check_name(prefix)
        presence.own = str(session.zid())

        def on(heard: Callable[[str, bool], None]) -> Callable[[zenoh.Sample], None]:
            return lambda sample: heard(str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT)

        wanted = (
            (f"{prefix}/*/alive/*", on(presence.token)),
            (f"{prefix}/*/{GATEWAY}/*", on(presence.claimants.heard)),
        )
        self._parts = [
            session.liveliness().declare_subscriber(pattern, handler, history=True)
            for pattern, handler in wanted
        ]

    def undeclare(self) -> None:
        """End."""
        for part in self._parts:
            part.undeclare()


def viewers(processes: Iterable[Process]) -> dict[str, int]:
    """People who look, by role, of processes that run."""
    found: dict[str, int] = {}
    for one in processes:
        for many in one.beat.viewers if one.lives else ():
            found[many.role] = found.get(many.role, 0) + many.count
    return found
