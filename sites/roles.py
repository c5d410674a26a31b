"""What each role may say on the bus, made from the table of topics: a new topic is in it at once.

Reading is for everybody of the site. What counts is who may publish, claim, answer and order: a
gateway for the boards it has, services what they are for, people through the dashboard's own
rights, and a viewer nothing at all.
"""

from collections.abc import Iterable
from dataclasses import dataclass

from messages.bus import orders
from messages.bus.pulse import UP
from messages.contract import topics as tp
from messages.contract.topics import GATEWAY, RECORDER, TOPICS, check_name
from messages.previews.frames import frame_key, lane_key, overview_key

SERVICES = (
    "router",
    "gateway",
    "estimator",
    "recorder",
    "procedures",
    "alarms",
    "dashboard",
    "operator",
    "authority",
)
ROLES = (*SERVICES, "simulator", "viewer", "join")
KINDS = (
    orders.RECORDER,
    orders.ESTIMATOR,
    orders.BOARD,
    orders.PROCEDURES,
    orders.ALARMS,
    orders.REPLAY,
    orders.LOG_LEVEL,
    orders.SEAT,
)
SEGMENTS = "/segment/"  # of a key: what stands behind it is asked for
SAID = (tp.NOTE, tp.MUTE)  # by people who order
ORDERING = ("dashboard", "operator", "procedures")
REPLAYED = f"$*{tp.REPLAY_SUFFIX}"  # of a device's name: any device that is a replay


@dataclass(frozen=True)
class Rights:
    """Key expressions by what may be done with them; what stands in none is denied."""

    put: tuple[str, ...] = ()
    token: tuple[str, ...] = ()  # to claim, or to be seen alive
    answer: tuple[str, ...] = ()  # to declare a queryable, and to reply
    ask: tuple[str, ...] = ()

    def __add__(self, other: "Rights") -> "Rights":
        return Rights(
            self.put + other.put,
            self.token + other.token,
            self.answer + other.answer,
            self.ask + other.ask,
        )


def rights(role: str, site: str, devices: Iterable[str] = ()) -> Rights:
    """What a role may say in a site; `devices`: a gateway's boards."""
    made = {
        "gateway": lambda: sum((_gateway(site, device) for device in devices), _consumer(site)),
        "estimator": lambda: _consumer(site) + _publisher(site, tp.ESTIMATES, orders.ESTIMATOR),
        "recorder": lambda: _consumer(site) + _publisher(site, RECORDER, orders.RECORDER),
        "procedures": lambda: (
            _consumer(site)
            + _publisher(site, tp.PROCEDURES, orders.PROCEDURES)
            + Rights(answer=(orders.SEAT.key(site, ""),))
            + _orders(site)
        ),
        "alarms": lambda: _consumer(site) + _publisher(site, tp.ALARMS, orders.ALARMS),
        "dashboard": lambda: _consumer(site) + _orders(site) + Rights(put=_of(site, "*", "any")),
        "operator": lambda: _listener(site) + _orders(site) + _replay(site),
        "simulator": lambda: _listener(site) + Rights(put=_of(site, "*", "simulator")),
        "viewer": lambda: _listener(site),
        "authority": lambda: _listener(site) + Rights(ask=(renew_key(site),)),
        "join": lambda: Rights(ask=(join_key(site),)),
    }
    said = made.get(role, Rights)()
    if role not in SERVICES or role == "operator":
        return said
    return said + Rights(answer=(orders.LOG_LEVEL.key(site, role),))


def join_key(site: str) -> str:
    """Where a place asks to join."""
    return f"{check_name(site)}/site/join"


def renew_key(site: str) -> str:
    """Where a certificate is renewed."""
    return f"{check_name(site)}/site/renew"


def segment_key(site: str) -> str:
    """Below which home answers about its recordings."""
    return f"{check_name(site)}/{RECORDER}{SEGMENTS}".rstrip("/")


def listening(site: str) -> tuple[str, ...]:
    """What whoever listens may ask: for what he missed, which numbers were heard, recordings."""
    return (
        tp.history_key(site, "*"),
        tp.published_key(site, "*", "*"),
        tp.fence_key(site, "*"),
        f"{segment_key(site)}/**",
        overview_key(site, "*"),
        f"{lane_key(site, '*')}/**",
        tp.clock_key(site),
    )


def preview_keys(site: str) -> tuple[str, ...]:
    """Frames of every device at every rate; no `**` matches them."""
    return (frame_key(site, "*", "*"),)


def order_keys(site: str) -> tuple[str, ...]:
    """The keys of all orders, for any device."""
    return tuple(kind.key(site, "*") for kind in KINDS)


def presence(site: str, place: str, role: str) -> Rights:
    """Everybody but a viewer may say that he is there: under his own place and role, no other's;
    and that whoever started him is.
    """
    if role not in (*SERVICES, "simulator"):
        return Rights()
    beat, token = tp.BEAT.pattern(site, place), tp.alive_key(site, place, "*")
    said = (role, UP)
    return Rights(
        put=tuple(f"{beat[:-1]}{name}-$*" for name in said),
        token=tuple(f"{token[:-1]}{name}-$*" for name in said),
    )


def ordered(site: str, place: str, role: str) -> Rights:
    """Who orders says so for the history of all orders: in the name of his own place alone."""
    return Rights(put=(tp.ORDER.pattern(site, place),) if role in ORDERING else ())


def presence_of(site: str, place: str = "*") -> Rights:
    """What all processes of a place say of being there, and of every place."""
    return Rights(put=(tp.BEAT.pattern(site, place),), token=(alive_keys(site, place),))


def alive_keys(site: str, place: str = "*") -> str:
    """The tokens of all processes of a place, or of every one."""
    return f"{check_name(site)}/{place}/alive/*"


def topic_keys(site: str) -> tuple[str, ...]:
    """Every topic of every device."""
    return tuple(topic.pattern(site) for topic in TOPICS)


def claim_keys(site: str) -> tuple[str, ...]:
    """Every claim of every publisher."""
    return tuple(f"{tp.claim_key(site, source, '*')}/*" for source in tp.CLAIMED)


def _of(site: str, device: str, *sources: str) -> tuple[str, ...]:
    return tuple(topic.pattern(site, device) for topic in TOPICS if topic.source in sources)


def _listener(site: str) -> Rights:
    return Rights(ask=listening(site))


def _consumer(site: str) -> Rights:
    """A service: it listens, tells which numbers it heard, and may note and warn."""
    return _listener(site) + Rights(put=_of(site, "*", "any"), answer=(tp.fence_key(site, "*"),))


def _gateway(site: str, device: str) -> Rights:
    answer = (
        tp.history_key(site, device),
        tp.published_key(site, device, GATEWAY),
        orders.BOARD.key(site, device),
    )
    claims = (f"{tp.claim_key(site, GATEWAY, device)}/*",)
    return Rights(put=_of(site, device, GATEWAY), token=claims, answer=answer)


def _publisher(site: str, source: str, kind: orders.Kind) -> Rights:
    """A service that there is one of, with the orders it takes."""
    return Rights(
        put=_of(site, "*", source),
        token=(f"{tp.claim_key(site, source)}/*",),
        answer=(kind.key(site, "*"), tp.published_key(site, "*", source)),
    )


def _orders(site: str) -> Rights:
    return Rights(ask=order_keys(site), put=tuple(t.pattern(site) for t in SAID))


def _replay(site: str) -> Rights:
    """A replay speaks under names that end in its suffix, and under no other."""
    source = tp.REPLAY.source
    return Rights(
        put=(tp.REPLAY.pattern(site), *(topic.pattern(site, REPLAYED) for topic in TOPICS)),
        token=(f"{tp.claim_key(site, source)}/*",),
        answer=(orders.REPLAY.key(site, ""),),
    )
