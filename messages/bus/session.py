"""One Zenoh session, opened the same way by every process.

Clients connect to explicit endpoints in client mode; scouting is off, so nothing is found or
announced on the network by itself. A client may start before its router: open_client keeps trying,
and once open a session finds a router that comes back by itself. (Zenoh 1.10 has no background
first connect in client mode: zenoh.open blocks or raises.)
"""

import json
import logging
import threading
import time
from collections.abc import Callable, Iterable
from typing import Any, TypeVar

import zenoh
from google.protobuf.message import Message

from messages.bus import attending, tls
from messages.bus.faults import BusUnavailable
from messages.bus.fencing import Fence, packed
from messages.bus.settings import BusSettings, configuration
from messages.contract.door import read
from messages.contract.topics import REPLAY_SUFFIX, Topic
from messages.history.spool import Spool

PATIENCE_S = 3.0  # for a router that starts together with its clients
CLOSING_S = 5.0

log = logging.getLogger(__name__)

M = TypeVar("M", bound=Message)


def _config(settings: BusSettings, mode: str, mesh: Iterable[str] = ()) -> zenoh.Config:
    config = zenoh.Config()
    for key, value in configuration(settings, mode, mesh).items():
        config.insert_json5(key, json.dumps(value))
    return config


def open_router(
    settings: BusSettings, access: dict[str, Any] | None = None, mesh: Iterable[str] = ()
) -> zenoh.Session:
    """A session that routes for all others, by the rules of `access` where there are any, and
    keeps calling the routers of `mesh`. Raises zenoh.ZError when an endpoint cannot be bound,
    IdentityError without a certificate.
    """
    config = _config(settings, "router", mesh)
    if access is not None:
        config.insert_json5("access_control", json.dumps(access))
    return attending.opened(zenoh.open(config), settings)


def open_client(
    settings: BusSettings,
    stop: threading.Event | None = None,
    timeout_s: float | None = None,
    further: bool = False,
) -> zenoh.Session:
    """A connected client session; waits for the router, for ever by default. further: one beside
    the process's own; nothing goes along with it, and that it waits is not said.

    Raises BusUnavailable after timeout_s or when `stop` is set first.
    """
    stop = stop or threading.Event()
    end = None if timeout_s is None else time.monotonic() + timeout_s
    start, said = time.monotonic(), further
    while True:
        try:
            session = zenoh.open(_config(settings, "client"))
            return session if further else attending.opened(session, settings)
        except zenoh.ZError:
            if stop.is_set() or (end is not None and time.monotonic() > end):
                raise BusUnavailable(
                    f"[bus] router {settings.router}: nobody answers; start one with `gyrofree"
                    f" router`{_why(settings)}"
                ) from None
        if not said and time.monotonic() - start > PATIENCE_S:
            log.warning(
                "router %s does not answer yet: trying on%s", settings.router, _why(settings)
            )
            said = True
        stop.wait(0.25)


def _why(settings: BusSettings) -> str:
    """What is wrong with this process's certificate, where that may be why nobody answers."""
    wrong = tls.trouble(settings.tls, settings.role) if settings.tls is not None else ""
    return f" ({wrong})" if wrong else ""


def connected(session: zenoh.Session) -> bool:
    """True when the session has a router."""
    return bool(list(session.info.routers_zid()))


class LateSession:
    """A client session that comes when the router does; until then what would be said has nobody to
    hear it.
    """

    def __init__(
        self,
        settings: BusSettings,
        opened: Callable[[zenoh.Session], object],
        further: bool = False,
    ) -> None:
        """`opened` gets the session, on a thread of its own; what it returns is kept as long as
        this is. further: see open_client.
        """
        self._settings, self._opened, self._further = settings, opened, further
        self._session: zenoh.Session | None = None
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._open, name="late session", daemon=True)
        self._thread.start()

    def _open(self) -> None:
        try:
            self._session = open_client(self._settings, self._closing, further=self._further)
        except BusUnavailable:
            return
        self._kept = self._opened(self._session)

    def close(self) -> None:
        """Leave the bus, before the process ends: no thread may be inside Zenoh when the
        interpreter goes.
        """
        self._closing.set()
        self._thread.join(CLOSING_S)
        if self._session is not None:
            self._session.close()


class Publishers:
    """Declared publishers of one session, made at first use. DROP: a slow link never stalls the
    caller.

    With a spool, every message is kept there before it goes out, and its sequences go on where the
    spool's end; a session may then come later (`attach`): until it does, messages are only kept.
    """

    heard: Callable[[Topic, str, str, Message], None] | None = None  # gets each, for figures

    def __init__(
        self, session: zenoh.Session | None, prefix: str, spool: Spool | None = None
    ) -> None:
        self._session = session
        self._prefix = prefix
        self._keys: dict[tuple[str, str, str], str] = {}  # checked names cost more than the message
        self._spool = spool
        self._by_key: dict[str, zenoh.Publisher] = {}
        self._sequence: dict[str, int] = {}
        self._published: dict[str, int] = {}  # by an earlier life of this process
        self.number = 0  # that fences these messages (messages/bus/fencing.py); 0: none does

    def resume(self) -> None:
        """Count on from what the spool holds, for a publisher whose run goes on over its
        restarts.
        """
        for (topic, device), sequence in (
            self._spool.last_sequences() if self._spool else {}
        ).items():
            self._sequence["/".join((self._prefix, device, topic))] = sequence

    def repeat(self, sequences: dict[str, int]) -> None:
        """The publisher goes back to an earlier state: what it published since then comes again and
        is passed over.
        """
        self._published = dict(self._sequence)
        self._sequence.update(sequences)

    def sequences(self) -> dict[str, int]:
        """Newest sequence of each key, for `repeat`."""
        return dict(self._sequence)

    def attach(self, session: zenoh.Session) -> None:
        """Publish from now on."""
        self._session = session

    def hold(self) -> None:
        """Only keep from now on, until the next `attach`."""
        self._session = None

    def put(self, topic: Topic[M], device: str, message: M, estimator: str = "") -> None:
        """Publish; a message with a header gets this key's next sequence unless the caller set
        one.
        """
        key = self._keys.get((topic.name, device, estimator))
        if key is None:
            key = self._keys[topic.name, device, estimator] = topic.key(
                self._prefix, device, estimator
            )
        header = message.header if "header" in message.DESCRIPTOR.fields_by_name else None
        if header is None or not header.sequence:
            self._sequence[key] = self._sequence.get(key, 0) + 1
            if header is not None:
                header.sequence = self._sequence[key]
            if self._sequence[key] <= self._published.get(key, 0):
                return
        if Publishers.heard is not None:
            Publishers.heard(topic, device, estimator, message)
        payload = message.SerializeToString()
        if self._spool is not None and not device.endswith(REPLAY_SUFFIX):
            name = key.split("/", 2)[2]
            if header is not None:
                self._spool.append(
                    name, device, header.run, header.sequence, header.utc_ns, payload
                )
            else:
                self._spool.append(
                    name, device, 0, self._sequence[key], message.timestamp.ToNanoseconds(), payload
                )
        session = self._session
        if session is None:
            return
        if key not in self._by_key:
            self._by_key[key] = session.declare_publisher(
                key, congestion_control=zenoh.CongestionControl.DROP
            )
        self._by_key[key].put(payload, attachment=packed(self.number))


def decode(topic: Topic[M], payload: bytes) -> M | None:
    """The message, or None (and a log line) for bytes that are not one of the contract: a foreign
    publisher must not stop whoever listens.
    """
    message, refusal = read(topic, payload)
    if refusal is not None:
        log.warning("%s: ignored: %s", topic.name, refusal)
    return message


def subscribe(
    session: zenoh.Session,
    topic: Topic[M],
    prefix: str,
    handler: Callable[[str, M], None],
    device: str = "*",
    fence: Fence | None = None,
) -> zenoh.Subscriber:
    """Call handler(key, message) on Zenoh's thread for each message; handlers only append to a
    queue. With a fence, for those of the process that serves.
    """

    def on_sample(sample: zenoh.Sample) -> None:
        if fence is not None and not fence.admit(str(sample.key_expr), sample.attachment):
            return
        message = decode(topic, sample.payload.to_bytes())
        if message is not None:
            handler(str(sample.key_expr), message)

    return session.declare_subscriber(topic.pattern(prefix, device), on_sample)
