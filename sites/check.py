"""Does the router do what its rules mean? Tried with the real certificates on a router of its own.

Zenoh says nothing to who is denied; so each certificate of this place tries each thing once, on a
router with the same rules at a free port of the loopback, and what arrives is held against the
table below, which is written down here apart from the rules. The running bus is not touched.
"""

import socket
import time
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import zenoh

from messages.bus import orders
from messages.bus.session import BusSettings, open_client, open_router
from messages.contract import topics as tp
from messages.previews.frames import RATES, frame_key
from sites.place import Place

WAIT_S = 1.0  # for what was sent to arrive
OTHER = "not-of-this-place"  # a board that no gateway here has
SERVING = ("estimator", "recorder", "procedures", "alarms", "dashboard")
PEOPLE = ("dashboard", "operator", "procedures")  # who may order, at home


@dataclass(frozen=True)
class Deed:
    """Something that a process may or may not do."""

    text: str
    key: str
    may: tuple[str, ...]  # roles
    kind: str = "put"  # or "token", "order"


@dataclass(frozen=True)
class Verdict:
    """What came of one try."""

    role: str
    deed: str
    allowed: bool
    wanted: bool

    @property
    def good(self) -> bool:
        return self.allowed == self.wanted

    @property
    def text(self) -> str:
        """In words, with what to do where it is not as it should be."""
        done = "may" if self.allowed else "may not"
        line = f"{self.role} {done} {self.deed}"
        if self.good:
            return line
        if self.allowed:
            return f"{line}, but must not: keep this router from the network and report it"
        return (
            f"{line}, but should: its messages are dropped without a word. Is its certificate one"
            " that `gyrofree certs list` calls good, and the board in gyrofree.toml?"
        )


def deeds(place: Place, device: str) -> list[Deed]:
    """Everything that is tried. device: one of this place's boards."""
    site, orders_by = place.site, PEOPLE if place.seat == "operator" else ()
    served = SERVING if place.seat == "operator" else ()
    noting = ("gateway", *served, "operator") if place.seat == "operator" else ()
    return [
        Deed("publish samples of its board", tp.ACCEL.key(site, device), ("gateway",)),
        Deed("publish samples of another board", tp.ACCEL.key(site, OTHER), ()),
        Deed("publish estimates", tp.RATE.key(site, device, "any"), ("estimator",)),
        Deed("say how the recording stands", tp.STATUS.key(site, tp.RECORDER), ("recorder",)),
        Deed("say how a test stands", tp.PROCEDURE.key(site, device), ("procedures",)),
        Deed("say what is wrong", tp.ALARM.key(site, device), ("alarms",)),
        Deed("leave a note", tp.NOTE.key(site, device), noting),
        Deed(
            "say that the gateway runs", tp.BEAT.key(site, place.place, "gateway-1"), ("gateway",)
        ),
        Deed(
            "say that the dashboard runs",
            tp.BEAT.key(site, place.place, "dashboard-1"),
            ("dashboard",),
        ),
        Deed("say that another place runs", tp.BEAT.key(site, OTHER, "dashboard-1"), ()),
        Deed(
            "claim to be the gateway",
            f"{tp.claim_key(site, tp.GATEWAY, device)}/1-check",
            ("gateway",),
            "token",
        ),
        Deed(
            "claim to be the estimator",
            f"{tp.claim_key(site, tp.ESTIMATES)}/1-check",
            ("estimator",),
            "token",
        ),
        Deed(
            "publish previews",
            frame_key(site, device, RATES[0]),
            ("authority",) if place.at_home else (),
        ),
        Deed("say who has the command", tp.HOLDER.key(site, tp.COMMAND), ("procedures",)),
        Deed("say what was ordered here", tp.ORDER.key(site, place.place), orders_by),
        Deed("say what another place ordered", tp.ORDER.key(site, OTHER), ()),
        Deed("order the recorder", orders.RECORDER.key(site, ""), orders_by, "order"),
        Deed(
            "change what a service logs",
            orders.LOG_LEVEL.key(site, tp.RECORDER),
            orders_by,
            "order",
        ),
        Deed("order the board", orders.BOARD.key(site, device), orders_by, "order"),
    ]


def try_all(
    folder: Path, place: Place, access: dict[str, Any], roles: Iterable[str], device: str
) -> list[Verdict]:
    """Try every deed with every certificate; raises zenoh.ZError, IdentityError, BusUnavailable."""
    address = f"tls/127.0.0.1:{_free_port()}"
    bus = BusSettings(prefix=place.site, router=address, listen=[address], tls=folder)
    heard: set[str] = set()
    roles, tried = [role for role in roles if role not in ("router", "join")], deeds(place, device)
    with open_router(bus.acting_as("router"), access) as router:
        # the router's own session hears all that passed the rules on their way in
        watches = [
            router.declare_subscriber(key, lambda sample: heard.add(sample.payload.to_string()))
            for key in (f"{place.site}/**", frame_key(place.site, "*", "*"))
        ]
        alive = router.liveliness().declare_subscriber(
            f"{place.site}/**", lambda sample: heard.add(f"token {sample.key_expr}")
        )
        answers = [
            router.declare_queryable(deed.key, _note(heard))
            for deed in tried
            if deed.kind == "order"
        ]
        with ExitStack() as open_ones:
            sessions = {
                role: open_ones.enter_context(open_client(bus.acting_as(role), timeout_s=10.0))
                for role in roles
            }
            kept = [_try(session, role, tried) for role, session in sessions.items()]
            time.sleep(WAIT_S)
        for one in (*watches, alive, *answers):
            one.undeclare()
        del kept
    return [
        Verdict(role, deed.text, _mark(role, number, deed) in heard, role in deed.may)
        for role in roles
        for number, deed in enumerate(tried)
    ]


def _try(session: zenoh.Session, role: str, tried: list[Deed]) -> list[zenoh.LivelinessToken]:
    """What one process tries, one thing after the other; keeps what it claimed."""
    kept = []
    for number, deed in enumerate(tried):
        mark = _mark(role, number, deed)
        if deed.kind == "put":
            session.put(deed.key, mark)
        elif deed.kind == "token":
            kept.append(session.liveliness().declare_token(mark.removeprefix("token ")))
        else:
            session.get(deed.key, lambda _: None, payload=mark, timeout=WAIT_S)
    return kept


def _mark(role: str, number: int, deed: Deed) -> str:
    """By what a try is known again where it arrives."""
    return f"token {deed.key}-{role}" if deed.kind == "token" else f"{role} {number}"


def _note(heard: set[str]) -> Callable[[zenoh.Query], None]:
    def on_query(query: zenoh.Query) -> None:
        heard.add(query.payload.to_string() if query.payload is not None else "")
        query.reply(str(query.key_expr), b"")

    return on_query


def _free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]
