"""The gateway process: one thread per board, one Zenoh session for all."""

import json
import logging
import threading

import zenoh

from gateway.device import DeviceLink
from gateway.identity import claim
from gateway.journal import Journal
from gateway.settings import DeviceSettings, GatewaySettings
from messages.bus import BusSettings, BusUnavailable, Publishers, open_client
from messages.topics import history_key

log = logging.getLogger(__name__)

HISTORY_BYTES = 4 << 20  # of records in one reply; who wants more asks on from where it ended


def run(settings: GatewaySettings, bus: BusSettings, stop: threading.Event) -> None:
    """Serve all boards of the settings until `stop` is set. Waits for the router when there is none yet."""
    if not settings.devices:
        log.warning("[gateway] has no [[gateway.devices]]: nothing to read; name a board and its port")
    try:
        session = open_client(bus, stop)
    except BusUnavailable:
        return  # stopped before a router came
    try:
        links: list[DeviceLink] = []
        threads = [
            threading.Thread(target=_serve, args=(device, settings, bus, session, stop, links), name=device.name)
            for device in settings.devices
        ]
        for thread in threads:
            thread.start()
        stop.wait()
        for link in links:
            link.wake()
        for thread in threads:
            thread.join()
    finally:
        session.close()


def _serve(
    device: DeviceSettings,
    settings: GatewaySettings,
    bus: BusSettings,
    session: zenoh.Session,
    stop: threading.Event,
    links: list[DeviceLink],
) -> None:
    token = claim(session, bus.prefix, device.name, stop)
    if token is None:
        return
    link = DeviceLink(device, settings, Publishers(session, bus.prefix).put)
    key = history_key(bus.prefix, device.name)
    history = session.declare_queryable(key, lambda query: answer_history(query, key, link.journal))
    log.info("%s: %s, journal %s, run %d", device.name, device.port, link.journal.folder, link.journal.run)
    links.append(link)
    try:
        link.run(stop)
    except Exception:  # a bug of ours: end the process, so that its supervisor starts a sound one
        log.exception("%s: the gateway failed and stops", device.name)
        stop.set()
        raise
    finally:
        history.undeclare()
        token.undeclare()


def answer_history(query: zenoh.Query, key: str, journal: Journal) -> None:
    """Answer `first` and `last` (sequences, both included) with verbatim journal records in one payload.

    The attachment is JSON: first_kept, last, durable, run. A range that retention has removed comes back without its
    records and first_kept says so; a malformed one gets an error reply.
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
