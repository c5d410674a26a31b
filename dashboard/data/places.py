"""Who is there, as a table for the page, REST and the command line: the same words for all."""

import math
from typing import Any

from dashboard.data.lateness import clock
from messages.bus.presence import Presence, Process, State, viewers
from messages.text import plain

OUT_OF_REACH = "out of reach"
Told = dict[str, Any]


def places(presence: Presence) -> list[Told]:
    """Every place with its services, boards and people; our own first."""
    own, found = presence.here, []
    for name in sorted(presence.places(), key=lambda one: (one != own, one)):
        there = [one for one in presence.all() if one.place == name]
        found.append(
            {
                "name": name,
                "own": name == own,
                "state": _state(presence, name, there),
                "people": viewers(there),
                "devices": sorted({device for one in there for device in one.beat.devices}),
                "services": [_service(presence, one) for one in there],
            }
        )
    return found


def _state(presence: Presence, name: str, there: list[Process]) -> str:
    """Of a place: the worst of its services, unless all of it is silent."""
    if presence.out_of_reach(name):
        return OUT_OF_REACH
    order = (State.FROZEN, State.GONE, State.HUNG, State.UNKNOWN, State.RUNNING)
    states = {one.state for one in there}
    return next((state.value for state in order if state in states), State.ENDED.value)


def _service(presence: Presence, one: Process) -> Told:
    beat = one.beat
    waits = {d for d in beat.devices if beat.session in presence.claimants.waiting(d)}
    waits -= {d for d in beat.devices if beat.session in presence.claimants.serving(d)}
    told = {
        "role": plain(one.role),
        "name": plain(one.name),
        "state": one.state.value,
        "since_s": beat.since_utc_ns * 1e-9 if one.beats else None,
        "silent_s": max(0.0, presence.now_s - one.heard_s),
        "loop": plain(beat.loop),
        "doing": plain(beat.doing),
        "turn_ago_s": _turned(presence, one),
        "turn_most_s": beat.turn_most_s if beat.loop else None,
        "devices": list(beat.devices),
        "waits": sorted(waits),
        "clock_ahead_s": _known(beat.clock_ahead_s) if one.beats else None,
        "clock_bound_s": _known(beat.clock_bound_s) if one.beats else None,
        "clock": _clock(one),
        "certificate_ends_s": beat.certificate_ends_utc_ns * 1e-9 or None,
        "version": plain(beat.version),
    }
    return told | {"state_said": state_said(told)}


def _turned(presence: Presence, one: Process) -> float | None:
    """Since the last turn of its slowest loop, s; None where no loop is known."""
    if not one.beat.loop:
        return None
    return one.beat.turn_ago_s + max(0.0, presence.now_s - one.heard_s)


def state_said(service: Told) -> str:
    """ "hung, 5 s: link cube (reading)"; for how long, where that is a fault."""
    state = service["state"]
    if state == State.HUNG.value:
        doing = f" ({service['doing']})" if service["doing"] else ""
        return f"{state}, {service['turn_ago_s']:.0f} s: {service['loop']}{doing}"
    if state in (State.FROZEN.value, State.GONE.value):
        return f"{state}, {service['silent_s']:.0f} s"
    return str(state)


def _clock(one: Process) -> str:
    """In words, with the digits that are known."""
    ahead, bound = one.beat.clock_ahead_s, one.beat.clock_bound_s
    if not one.beats or not math.isfinite(ahead):
        return "not measured"
    digits = 3 if bound < 0.005 else 2 if bound < 0.05 else 1
    if abs(ahead) <= bound:
        return f"within {bound:.{digits}f} s"
    if bound >= 0.5:
        return clock(ahead, bound)
    return f"{ahead:+.{digits}f} s ± {bound:.{digits}f}".replace("-", "−")


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None


def people_said(people: dict[str, int], state: str = "") -> str:
    """ "1 operator and 2 viewers look"; that nobody does. state: of the place; nobody knows who
    looks at one that is out of reach.
    """
    if state == OUT_OF_REACH:
        return "who looks is not known"
    if not people:
        return "nobody looks"
    parts = [f"{count} {role}{'s' * (count != 1)}" for role, count in sorted(people.items())]
    verb = "looks" if sum(people.values()) == 1 else "look"
    return f"{' and '.join(parts)} {verb}"
