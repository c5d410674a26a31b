"""The last step of a byte's way: a message gets its header and is handed to the publisher."""

from collections.abc import Callable

from google.protobuf.message import Message

from gateway.board.state import BoardState
from gateway.samples.batch import Batch
from gateway.time.clock import DeviceClock
from gateway.time.wall import WallClock
from messages.contract.checks import check
from messages.contract.door import Door
from messages.contract.topics import Topic

FULL = (1 << 63) - 1  # what a field can hold; whether it is a time, the contract says
Put = Callable[[Topic, str, Message], None]
Known = Callable[[type, int, Batch], bool]  # frame's kind, boot, batch: has it been published?


class Outgoing:
    """Messages of one board. Before `direct` there is nobody to hand them to."""

    def __init__(
        self,
        device: str,
        run: int,
        state: BoardState,
        clock: DeviceClock,
        wall: WallClock,
        door: Door,
    ) -> None:
        """run: of the journal that has the bytes the messages are made of; door: counts what may
        not leave.
        """
        self._door = door
        self._device, self.run = device, run
        self._state, self._clock, self._wall = state, clock, wall
        self._put: Put | None = None
        self._known: Known | None = None

    def direct(self, put: Put | None, known: Known | None = None) -> None:
        """What comes from here on goes to `put`, or nowhere, but samples that are `known`."""
        self._put, self._known = put, known

    @property
    def live(self) -> bool:
        """True while somebody takes what is published."""
        return self._put is not None

    def known(self, kind: type, batch: Batch) -> bool:
        """Whether samples of this boot were published by an earlier life of the gateway."""
        return self._known is not None and self._known(kind, self._state.epoch or 0, batch)

    def publish(
        self, topic: Topic, message: Message, device_us: int, utc_ns: int | None = None
    ) -> None:
        """Fill the header and put; utc_ns None: from device time."""
        header = message.header
        header.device = self._device
        header.epoch = self._state.epoch or 0
        header.device_us = min(max(device_us, 0), FULL)  # a clock just learnt may reach below boot
        if utc_ns is None:
            utc_ns = self._wall.utc_ns(self._clock.host_ns(device_us))
        header.utc_ns = min(max(utc_ns, -FULL), FULL)
        # once the wall clock was set, which of its times was UTC is not known
        header.utc_sigma_s = self._clock.sigma_s + abs(self._wall.offset_s)
        header.source = self._state.source
        header.run = self.run
        wrong = check(message)
        if wrong:  # frames, each of which may be believed, can make together what may not be
            key = f"{self._device}/{topic.name}"
            self._door.refuse(key, wrong[0]._replace(kind="unsent"), self._device)
            return
        self.send(topic, message)

    def send(self, topic: Topic, message: Message) -> None:
        """Put as it is."""
        if self._put is not None:
            self._put(topic, self._device, message)
