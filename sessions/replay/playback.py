"""A recording played back under a person's hands: pause, seek, step, speed, loop, with the
estimates made anew.

Inputs go out as in replay.py, under `<device>-replay`. Estimates come from a pipeline of this
process that is given every input from the recording's beginning, in order, also those before the
moment a person jumps to; so at any moment they are the very ones of a run without jumps. What lies
before is run through without being published, from the nearest of the states that are kept every
KEEP_S of recording (states.py).

Orders are ReplayCommands (`order`); the state is a ReplayStatus (`status`).
"""

import threading
import time
from collections import deque
from collections.abc import Callable, Iterable
from pathlib import Path

from google.protobuf.message import Message

from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import ACCEL, IMU, NOTE, PIPELINE_INPUTS, REPLAY_SUFFIX, Address
from sessions.replay.replay import INPUTS, LONGEST_NAME, Input, rename, renamed
from sessions.replay.reproduce import ESTIMATES, Pipeline, first_used, give_orders
from sessions.replay.source import Source
from sessions.replay.states import KeptStates

PLAYED = (*INPUTS, NOTE)
# put behind an estimator's name when its recorded estimates are shown beside the new ones
RECORDED = "-recorded"
SLOWEST, FASTEST = 0.1, 100.0
BEFORE_S = 10.0  # published at once before the moment jumped to, so that charts are not empty, s
STATUS_S = 0.2
BEGINNING_S = 10.0  # of recording in which the estimators' first inputs are looked for
LOOK_EVERY = 200  # inputs between two looks at the orders while running through
BATCHES = 1024  # more than are published before the moment jumped to

Put = Callable[[Address, str, Message], None]


class Playback:
    """One recording being played; `order` may be called from any thread, the rest is for the one
    that runs it.
    """

    def __init__(
        self,
        path: Path,
        put: Put,
        make_pipeline: Callable[[], Pipeline] | None = None,
        *,
        speed: float = 1.0,
        at_s: float = 0.0,
        paused: bool = False,
        show_recorded: bool = False,
        suffix: str = REPLAY_SUFFIX,
    ) -> None:
        """`show_recorded` puts the recorded estimates beside the new ones. Raises what Source
        raises, and ValueError for a speed outside 0.1 to 100."""
        self.source = Source(
            path, PLAYED + (ESTIMATES if show_recorded or make_pipeline is None else ())
        )
        self.session, self._path = path.parent.name, path
        self._put, self._make, self._suffix = put, make_pipeline, suffix
        self._recorded = RECORDED if make_pipeline is not None else ""
        self.paused, self.message = paused, ""
        self.position_s = 0.0
        self._loop = (0.0, 0.0)
        self._set_speed(speed)
        self._orders: deque[tuple[pb.ReplayCommand, Callable[[pb.ReplayStatus], None] | None]] = (
            deque()
        )
        self._wake = threading.Event()
        self._sequence: dict[str, int] = {}
        self._states = KeptStates()
        self._steps = 0
        self._batches: deque[float] = deque(
            maxlen=BATCHES
        )  # positions of the newest batches, for steps back
        self._first = first_used(path, BEGINNING_S) if make_pipeline is not None else {}
        self._begin(self.source.start_ns, self._fresh())
        self._target: float | None = min(at_s, self.source.length_s) if at_s > 0.0 else None
        self._ended = False

    def order(
        self, command: pb.ReplayCommand, answer: Callable[[pb.ReplayStatus], None] | None = None
    ) -> None:
        """Queue an order; `answer` gets the state after it, from the playing thread."""
        self._orders.append((command, answer))
        self._wake.set()

    def status(self) -> pb.ReplayStatus:
        """Where it stands."""
        return pb.ReplayStatus(
            header=pb.Header(device="replay", utc_ns=time.time_ns()),
            session=self.session,
            position_s=self.position_s,
            length_s=self.source.length_s,
            speed=self.speed,
            paused=self.paused,
            loop_from_s=self._loop[0],
            loop_until_s=self._loop[1],
            message=self.message,
        )

    def run(
        self,
        stop: threading.Event,
        say: Callable[[pb.ReplayStatus], None] | None = None,
        stay: bool = False,
    ) -> None:
        """Play until the end, `stop` or an order to end; with `stay` the end is a pause. `say` gets
        the state 5 Hz.
        """
        said = 0.0
        while not stop.is_set() and not self._ended:
            self._wake.clear()
            self._obey()
            if say is not None and time.monotonic() - said >= STATUS_S:
                said = time.monotonic()
                say(self.status())
            if self._target is not None:
                self._seek(stop, say)
            elif self.paused and not self._steps:
                self._wake.wait(STATUS_S / 2)
            elif not self._play() and not self._at_end(stay):
                break
        if say is not None:
            say(self.status())

    # --- orders

    def _obey(self) -> None:
        while self._orders:
            command, answer = self._orders.popleft()
            self._carry_out(command)
            if answer is not None:
                answer(self.status())

    def _carry_out(self, command: pb.ReplayCommand) -> None:
        kind = pb.ReplayCommand
        self.message = ""
        if command.action == kind.ACTION_PAUSE:
            self.paused, self._steps = True, 0
        elif command.action == kind.ACTION_RESUME:
            self.paused = False
            if self._next is None and self._target is None:
                self._target = self._loop[0]
            self._anchor()
        elif command.action == kind.ACTION_SEEK:
            self._target = min(max(command.value, 0.0), self.source.length_s)
        elif command.action == kind.ACTION_SPEED:
            try:
                self._set_speed(command.value)
            except ValueError as error:
                self.message = str(error)
        elif command.action == kind.ACTION_STEP:
            self.paused = True
            if command.value >= 0:
                self._steps += int(command.value) or 1
            else:
                before = [at for at in self._batches if at < self.position_s]
                self._target = before[max(int(command.value), -len(before))] if before else 0.0
        elif command.action == kind.ACTION_LOOP:
            begin, end = command.value, command.until
            if not 0.0 <= begin <= end <= self.source.length_s + 1e-3:
                self.message = (
                    f"loop {begin:g} to {end:g} s: want a stretch within 0 to"
                    f" {self.source.length_s:.1f} s"
                )
            else:
                self._loop = (begin, end)
        elif command.action == kind.ACTION_END:
            self._ended = True

    def _set_speed(self, speed: float) -> None:
        if not SLOWEST <= speed <= FASTEST:
            raise ValueError(f"speed {speed:g}: want {SLOWEST:g} to {FASTEST:g} times real time")
        self.speed = speed
        self._anchor()

    # --- playing

    def _anchor(self) -> None:
        """From now on, positions go with the clock from here."""
        self._from = (time.monotonic(), self.position_s)

    def _play(self) -> bool:
        """The next message when it is due, else a short wait; False at the end."""
        if self._loop[1] > self._loop[0] and self.position_s >= self._loop[1]:
            self._target = self._loop[0]
            return True
        if self._next is None:
            return False
        wait = (
            self._from[0]
            + (self._seconds(self._next) - self._from[1]) / self.speed
            - time.monotonic()
        )
        if wait > 0.0 and not self._steps:
            self._wake.wait(min(wait, STATUS_S / 2))
            return True
        if self._next.address.topic in (ACCEL, IMU) and self._steps:
            self._steps -= 1
        self._advance(publish=True)
        return True

    def _at_end(self, stay: bool) -> bool:
        """What to do at the end: True to go on."""
        self._steps = 0
        if self._loop[1] > self._loop[0]:
            self._target = self._loop[0]
            return True
        self.paused, self.message = True, "the end of the recording"
        return stay

    def _seconds(self, item: Input) -> float:
        return (item.log_ns - self.source.start_ns) / 1e9

    def _fresh(self) -> Pipeline | None:
        """A pipeline that has taken nothing yet but what people ordered."""
        return give_orders(self._path, self._make()) if self._make is not None else None

    def _begin(self, from_ns: int, pipeline: Pipeline | None) -> None:
        self._items = self.source.items(from_ns)
        self._pipeline = pipeline
        self._batches.clear()
        self._next = next(self._items, None)
        self._states.go_on_from((from_ns - self.source.start_ns) / 1e9)

    def _advance(self, publish: bool) -> None:
        """Take the next message: pipeline first, then the bus."""
        item = self._next
        self._next = next(self._items, None)
        self.position_s = self._seconds(item)
        outputs: Iterable = ()
        if item.address.topic in (ACCEL, IMU):
            self._batches.append(self.position_s)
        if (
            self._pipeline is not None
            and item.address.topic in PIPELINE_INPUTS
            and self._used(item)
        ):
            try:
                outputs = self._pipeline.on(item.address.topic, item.message)
            except ValueError:
                outputs = ()  # refused when it was live, too
        if publish:
            self._publish(item, outputs)
        due = self._pipeline is not None and self._states.due(self.position_s)
        if due and self._next is not None and self._next.log_ns > item.log_ns:
            self._states.keep(self.position_s, self._next.log_ns, self._pipeline)

    def _publish(self, item: Input, outputs: Iterable) -> None:
        device = renamed(item.address.device, self._suffix)
        for topic, _, estimator, message in outputs:
            rename(message, item.address.device, device)
            address = Address(item.address.prefix, device, topic, estimator)
            if "header" in message.DESCRIPTOR.fields_by_name:
                name = f"{device}/{topic.name}/{estimator}"
                message.header.sequence = self._sequence[name] = self._sequence.get(name, 0) + 1
            self._put(address, device, message)
        rename(item.message, item.address.device, device)
        address = item.address
        if address.topic in ESTIMATES and self._recorded:
            estimator = address.estimator[: LONGEST_NAME - len(self._recorded)] + self._recorded
            address = address.__class__(address.prefix, device, address.topic, estimator)
            item.message.estimator = estimator
        self._put(address, device, item.message)

    # --- seeking

    def _seek(self, stop: threading.Event, say: Callable[[pb.ReplayStatus], None] | None) -> None:
        """Go to the target; run through what lies before it. A newer order to seek ends it
        early.
        """
        target, self._target = self._target, None
        publish_from = max(0.0, target - BEFORE_S)
        if self._pipeline is None:
            self._begin(self.source.start_ns + int(publish_from * 1e9), None)
        else:
            self._restore(publish_from)
        said = time.monotonic()
        count = 0
        while self._next is not None and self._seconds(self._next) <= target:
            self._advance(publish=self._seconds(self._next) >= publish_from)
            count += 1
            if count % LOOK_EVERY == 0:
                if stop.is_set():
                    return
                self._obey()
                if self._target is not None:
                    return
                if say is not None and time.monotonic() - said >= STATUS_S:
                    said = time.monotonic()
                    self.message = f"estimating up to {target:.0f} s"
                    say(self.status())
        self.position_s = target
        self.message = ""
        self._anchor()

    def _restore(self, publish_from: float) -> None:
        """The kept state nearest before a moment, unless the present one is as near."""
        kept = self._states.before(publish_from)
        if (
            self._next is not None
            and self.position_s <= publish_from
            and (kept is None or kept <= self.position_s)
        ):
            return
        if kept is None:
            self._begin(self.source.start_ns, self._fresh())
        else:
            self._begin(*self._states.at(kept))
            self._states.go_on_from(kept)

    # --- where the estimators began

    def _used(self, item: Input) -> bool:
        """False for batches from before the recorded estimators' first one: they did not have them
        either.
        """
        if item.address.topic is not ACCEL:
            return True
        header = item.message.header
        return header.sequence >= self._first.get((item.address.device, header.run), 0)
