"""One gateway per device name.

Two gateways with one name would interleave their messages on the same keys and every consumer would
see losses and jumps. Each gateway holds a Zenoh liveliness token
<prefix>/<device>/gateway/<run>-<id>; of several the oldest run serves, the others wait. A killed
gateway's token goes with its connection, so the waiting one takes over.
"""

import logging
import threading
import time
from collections.abc import Callable

import zenoh

from messages.contract.topics import check_name

log = logging.getLogger(__name__)

QUERY_S = 1.0  # how long to wait for other tokens; a router answers in milliseconds
RETRY_S = 2.0


def claim(
    session: zenoh.Session,
    prefix: str,
    device: str,
    stop: threading.Event,
    on_refused: Callable[[], None],
) -> zenoh.LivelinessToken | None:
    """Wait until this gateway may serve the device; the token to undeclare at the end, None when
    `stop` came first.

    on_refused() is called once, before waiting, when another gateway has the name.
    """
    base = f"{check_name(prefix)}/{check_name(device)}/gateway"
    said = False
    while not stop.is_set():
        mine = f"{base}/{time.time_ns():020d}-{session.zid()}"
        token = session.liveliness().declare_token(mine)
        older = [key for key in alive(session, base) if key < mine]
        if not older:
            if said:
                log.warning("%s: the other gateway is gone, this one serves it now", device)
            return token
        token.undeclare()
        if not said:
            log.error(
                "%s: another gateway serves this device name (%s); refused. Stop the other one, or"
                " give this board another `name` in [[gateway.devices]]; here it is neither read"
                " nor journalled until the name is free",
                device,
                older[0].rsplit("-", 1)[1],
            )
            said = True
            on_refused()
        stop.wait(RETRY_S)
    return None


def alive(session: zenoh.Session, base: str) -> list[str]:
    """Keys of the tokens below base."""
    replies = session.liveliness().get(f"{base}/*", timeout=QUERY_S)
    return sorted(str(reply.ok.key_expr) for reply in replies if reply.ok is not None)
