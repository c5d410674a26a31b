"""The gateway process: one Zenoh session for all boards, per board a thread that serves it and one
that decodes.

Journal first: boards are read and journalled from the start, also with no router there. Publishing
begins when the router comes and the name on the bus is ours (messages/bus/claiming.py).
"""

import json
import logging
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future

import zenoh

from gateway.board.device import DeviceLink
from gateway.ports.keeper import Keeper
from gateway.settings import DeviceSettings, GatewaySettings
from messages.bus import orders
from messages.bus.claiming import Claim, Claimant, claim
from messages.bus.fencing import heard_of
from messages.bus.session import BusSettings, Publishers, connected
from messages.bus.turns import sessions
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import GATEWAY, claim_key, history_key
from messages.history.answers import declare
from messages.history.journal import Journal
from messages.history.journal_folder import JournalBusy

log = logging.getLogger(__name__)

HISTORY_BYTES = 4 << 20  # of records in one reply; who wants more asks on from where it ended
LOOK_S = 0.1  # a board that failed is noticed after so long ...
FIRST_PAUSE_S, LONGEST_PAUSE_S = 1.0, 30.0  # ... and begins anew after a pause that grows
BUSY_RETRY_S = 0.2  # a journal that another gateway has is asked for again after so long

REFUSED = (
    "%s: another gateway serves this device name (%s); refused. Stop the other one, or give this"
    " board another `name` in [[gateway.devices]]; here it is neither read nor journalled until the"
    " name is free"
)


def run(
    settings: GatewaySettings, bus: BusSettings, stop: threading.Event, keeper: Keeper | None = None
) -> None:
    """Serve all boards of the settings until `stop` is set; without a router they are read and
    journalled.

    `keeper` has the ports that an earlier life of this gateway left open, and holds those that this
    one opens.
    """
    if not settings.devices:
        log.warning(
            "[gateway] has no [[gateway.devices]]: nothing to read; name a board and its port"
        )
    opened: Future[Claimant | None] = Future()
    keeper, names = keeper or Keeper(), [device.name for device in settings.devices]
    threads = [
        threading.Thread(
            target=_serve,
            args=(device, settings, bus.prefix, opened, stop, keeper),
            name=device.name,
        )
        for device in settings.devices
    ]
    for thread in threads:
        thread.start()
    try:
        with sessions(bus, stop, names) as mine:  # waits for ever, while the other threads read
            opened.set_result(mine)
            try:
                stop.wait()
            finally:
                stop.set()
                for thread in threads:
                    thread.join()
    finally:
        stop.set()
        if not opened.done():
            opened.set_result(None)
        for thread in threads:
            thread.join()


class _Line:
    """A board's link on a thread of its own. Raises JournalBusy when another gateway has the
    journal.
    """

    def __init__(
        self,
        device: DeviceSettings,
        settings: GatewaySettings,
        prefix: str,
        keeper: Keeper,
    ) -> None:
        self.link = DeviceLink(device, settings, keeper)
        self.publishers = Publishers(
            None, prefix, self.link.spool
        )  # keeps what it is given until there is a bus
        self.link.go_live(self.publishers.put)
        self._halt = threading.Event()
        self.failed = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"link-{device.name}")
        self._thread.start()
        journal = self.link.journal
        log.info(
            "%s: %s, journal %s, run %d", device.name, device.port, journal.folder, journal.run
        )

    def _run(self) -> None:
        try:
            self.link.run(self._halt)
        except Exception:  # a fault of ours: this board begins anew, the others do not notice
            log.exception("%s: reading failed, and begins anew", self.link.name)
            self.failed.set()

    def serve(self, session: zenoh.Session, claimed: Claim, stop: threading.Event) -> None:
        """Publish under the claim's number until `stop`, a failure, or another's claim."""
        stopped = threading.Event()
        self.link.on_stopped = lambda: (self.publishers.hold(), stopped.set())
        self.link.outrun(claimed.number - 1)
        claimed.raise_to(self.link.journal.run)
        self.publishers.number = claimed.number
        self.publishers.attach(session)
        while not (stop.is_set() or self.failed.is_set() or claimed.lost.wait(LOOK_S)):
            # after a stop nothing is said before it is known that nobody took our place
            if stopped.is_set() and connected(session) and claimed.look():
                stopped.clear()
                self.publishers.attach(session)
        if claimed.lost.is_set():
            log.error(
                "%s: another gateway took this device while this process was stopped or cut off:"
                " stepping back",
                self.link.name,
            )

    def close(self) -> None:
        """Stop reading and close the journal; may be called again."""
        self._halt.set()
        self.link.wake()
        self._thread.join()


def _serve(
    device: DeviceSettings,
    settings: GatewaySettings,
    prefix: str,
    opened: "Future[Claimant | None]",
    stop: threading.Event,
    keeper: Keeper,
) -> None:
    """One board until `stop`: read it at once, publish when the session is there and the name is
    ours. What fails here is one board's, and begins anew after a pause.
    """
    pause_s = FIRST_PAUSE_S
    while not stop.is_set():
        line, began = None, time.monotonic()
        try:
            line = _open_line(device, settings, prefix, stop, keeper)
            while line is not None and not opened.done() and not line.failed.wait(LOOK_S):
                pass
            mine = opened.result() if opened.done() else None
            if line is not None and mine is not None:
                _publish(line, device, settings, prefix, mine, stop, keeper)
        except Exception:
            log.exception(
                "%s: this board's part of the gateway failed, and begins anew", device.name
            )
        finally:
            if line is not None:
                line.close()
        calm = time.monotonic() - began > LONGEST_PAUSE_S
        pause_s = FIRST_PAUSE_S if calm else min(2.0 * pause_s, LONGEST_PAUSE_S)
        stop.wait(pause_s)


def _open_line(
    device: DeviceSettings,
    settings: GatewaySettings,
    prefix: str,
    stop: threading.Event,
    keeper: Keeper,
) -> _Line | None:
    """Wait until no other gateway has the journal; None when `stop` came first."""
    said = False
    while not stop.is_set():
        try:
            return _Line(device, settings, prefix, keeper)
        except JournalBusy as busy:
            if not said:
                log.error(
                    "%s: refused: %s; the board is not read until the journal is free",
                    device.name,
                    busy,
                )
            said = True
        stop.wait(BUSY_RETRY_S)
    return None


def _publish(
    line: _Line,
    device: DeviceSettings,
    settings: GatewaySettings,
    prefix: str,
    claimant: Claimant,
    stop: threading.Event,
    keeper: Keeper,
) -> None:
    """Serve the name on the bus until `stop`, or until another gateway has it. Refused, the line is
    closed, and opened again when the name is free.
    """
    refused, session = threading.Event(), claimant.session

    def give_up(other: str) -> None:
        log.error(REFUSED, device.name, other)
        refused.set()
        line.close()

    claimed = claim(
        claimant,
        [claim_key(prefix, GATEWAY, device.name)],
        line.link.journal.run,
        stop,
        give_up,
        lambda: heard_of(session, prefix, device.name, GATEWAY),
    )
    if claimed is None:
        return
    if refused.is_set():
        log.warning("%s: the other gateway is gone, this one serves it now", device.name)
    queryables = []
    mine = _open_line(device, settings, prefix, stop, keeper) if refused.is_set() else line
    try:
        if mine is not None:
            link = mine.link
            key = history_key(prefix, device.name)
            queryables = [
                session.declare_queryable(
                    key, lambda query: answer_history(query, key, link.journal)
                ),
                declare(session, prefix, device.name, GATEWAY, link.spool),
                orders.take(session, prefix, orders.BOARD, take_order_of(link), device.name),
            ]
            mine.serve(session, claimed, stop)
    finally:
        if mine is not None:
            mine.close()
        for queryable in queryables:
            queryable.undeclare()
        claimed.release()


def take_order_of(link: DeviceLink) -> Callable[[orders.Order[pb.BoardCommand, pb.Reply]], None]:
    """Orders go to the board; the answer follows its ACK, or says why there was none."""

    def take_order(order: orders.Order[pb.BoardCommand, pb.Reply]) -> None:
        link.order(order.command).add_done_callback(lambda done: order.answer(done.result()))

    return take_order


def answer_history(query: zenoh.Query, key: str, journal: Journal) -> None:
    """Answer `first` and `last` (sequences, both included) with verbatim journal records in one
    payload.

    The attachment is JSON: first_kept, last, durable, run. A range that retention has removed comes
    back without its records and first_kept says so; a malformed one gets an error reply.
    """
    try:
        first = int(query.parameters.get("first") or 1)
        last = int(query.parameters.get("last") or journal.last_seq)
    except ValueError as error:
        query.reply_err(f"history: {error}; want ?first=<sequence>;last=<sequence>")
        return
    state = {
        "first_kept": journal.first_kept(),
        "last": journal.last_seq,
        "durable": journal.durable_seq,
        "run": journal.run,
    }
    payload = b"".join(journal.history(first, last, HISTORY_BYTES))
    query.reply(key, payload, attachment=json.dumps(state))
