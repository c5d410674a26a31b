"""What is wrong with who is there: a service that hangs, is frozen or gone, a place out of reach,
one board of two gateways.
"""

from collections.abc import Iterator

from dashboard.data.fault import Alarm
from dashboard.data.store import Store
from messages.bus.presence import Process, State
from messages.text import plain

PERSONS = ("operator",)  # roles of commands that people begin and end
WRONG = (State.HUNG, State.FROZEN, State.GONE)
CALM_S = 3.0  # without a word, before that is a fault of one that ...
YOUNG = 20  # ... has beaten so often only: a machine that starts much is busy for a while


def service_faults(store: Store) -> Iterator[Alarm]:
    """Services and places. Call under the store's lock."""
    presence, said = store.presence, set()
    for place in presence.places():
        if presence.out_of_reach(place):
            said.add(place)
            text = (
                f"nothing is heard of any service of {place}: the link between the places is cut,"
                " or that place has no power"
            )
            yield Alarm("place", f"{place} out of reach", text, "", place)
    told: set[tuple[str, str]] = set()
    for one in presence.all():
        key, silent_s = (one.place, one.role), presence.now_s - one.heard_s
        unsure = one.alone or one.beat.header.sequence < YOUNG
        if one.state is State.FROZEN and unsure and silent_s < CALM_S:
            continue
        if one.place in said or one.role in PERSONS or one.state not in WRONG or key in told:
            continue
        if not (one.beats and one.held):  # a token or beats alone are nobody's
            continue
        told.add(key)
        title = f"{one.role} at {one.place} {one.state.value}"
        text, about = _wrong(one, silent_s), f"{one.place}-{one.role}"
        yield Alarm("service", title, text, "", about, lasted=one.state is not State.GONE)


def _wrong(one: Process, silent_s: float) -> str:
    since, beat = _round(silent_s), one.beat
    if one.state is State.HUNG:
        doing = f" ({plain(beat.doing)})" if beat.doing else ""
        return (
            f"it is there, and its main work, {plain(beat.loop)}{doing}, has stood for"
            f" {_round(beat.turn_ago_s)}, longer than the {beat.turn_most_s:g} s that a turn may"
            " take: a disk or file that does not answer, a lock, or a debugger"
        )
    if one.state is State.FROZEN:
        return (
            f"its connection stands and it has said nothing for {since}: it was stopped (a signal,"
            " a debugger), or its machine has no time for it or sleeps"
        )
    if one.froze:
        return (
            f"it was frozen, has said nothing for {since} and was cut off: its machine has no time"
            " for it, sleeps, or is out of reach"
        )
    return (
        f"it went without a word {since} ago: killed, or its machine is cut off; does `gyrofree up`"
        " run there?"
    )


def gateway_out_of_reach(store: Store, device: str) -> bool:
    """Is the place of a board out of reach? Call under the store's lock."""
    gateway = store.presence.gateway_of(device)
    return gateway is not None and store.presence.out_of_reach(gateway.place)


def role_out_of_reach(store: Store, role: str) -> bool:
    """Are all services of a role at places out of reach? Call under the store's lock."""
    found = {one.place for one in store.presence.all() if one.role == role}
    return bool(found) and all(store.presence.out_of_reach(place) for place in found)


def twin_fault(store: Store, device: str) -> Iterator[Alarm]:
    """Of one board. Call under the store's lock."""
    who = store.presence.twins().get(device)
    if who is not None:
        text = (
            f"{who} want to publish {device}: one at a time is heard, and the others wait; stop all"
            " but the one that has the board, or give the boards different names"
        )
        yield Alarm("twin", "two gateways of one board", text, "link", device)


def _round(seconds: float) -> str:
    """A time that does not change with every look."""
    if seconds < 10:
        return "some seconds"
    return f"{seconds // 10 * 10:.0f} s" if seconds < 120 else f"{seconds // 60:.0f} min"
