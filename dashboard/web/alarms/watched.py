"""Alarms at a place that may only watch: as the site says them to everybody. Whose limits and
history it would have to ask for, it may not ask.
"""

from dashboard.data.fault import Alarm
from dashboard.data.store import Store
from dashboard.data.there import role_out_of_reach
from messages.contract import gyrofree_pb2 as pb

LEVELS = {
    "watch": pb.Alarm.LEVEL_WATCH,
    "warning": pb.Alarm.LEVEL_WARNING,
    "critical": pb.Alarm.LEVEL_CRITICAL,
}
WATCHED = (
    "Seen from here is what is wrong now. Limits, notices and what happened stand on the page of"
    " the site's home."
)


def watched(store: Store) -> tuple[list[pb.Alarm], str]:
    """The alarms that the site's service says and those of this place, the worst first; and what
    is wrong with that. Call under the store's lock.
    """
    found = {("", one.id): _own(one) for one in store.own_faults}
    for name in store.names():
        device = store.devices[name]
        heard = device.get("alarm")
        if heard is not None and not device.stale("alarm"):
            found |= {(one.device, one.id): one for one in heard.message.alarms}
    heard_of = any(not one.stale("alarm") for one in store.devices.values())
    if heard_of:
        trouble = ""
    elif role_out_of_reach(store, "alarms"):
        trouble = "The site's home is out of reach: what is wrong there is not known now."
    else:
        trouble = "Nothing is heard of the site's alarms: what is wrong is not known now."
    return sorted(found.values(), key=lambda one: (-one.level, one.raised_utc_ns)), trouble


def _own(one: Alarm) -> pb.Alarm:
    """A fault that this place has found of itself (dashboard.alarms.own_place)."""
    return pb.Alarm(
        id=one.id,
        kind=one.kind,
        title=one.title,
        text=one.text,
        page=one.page,
        level=LEVELS.get(one.level, pb.Alarm.LEVEL_WARNING),
        state=pb.Alarm.STATE_UNACKNOWLEDGED,
        active=True,
        raised_utc_ns=int(one.raised_s * 1e9),
    )
