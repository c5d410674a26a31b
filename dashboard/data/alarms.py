"""What is wrong with a device or the bench, and on which page that is seen: one list for the bar,
the summary and the REST interface, so that all three say the same.
"""

import re
import time
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from dashboard.data.device import BEHIND_STALE_S, Device
from dashboard.data.fault import Alarm
from dashboard.data.store import Store
from dashboard.data.there import (
    gateway_out_of_reach,
    role_out_of_reach,
    service_faults,
    twin_fault,
)
from logs.figures.words import words_of
from messages.contract import gyrofree_pb2 as pb
from messages.contract import rates
from messages.text import plain

AXIS_WORDS = {
    pb.AxisHealth.STATE_GOOD: "good",
    pb.AxisHealth.STATE_STUCK: "stuck",
    pb.AxisHealth.STATE_SATURATED: "saturated",
    pb.AxisHealth.STATE_SWAPPED: "swapped",
    pb.AxisHealth.STATE_FLIPPED: "sign flipped",
    pb.AxisHealth.STATE_SPIKING: "spiking",
    pb.AxisHealth.STATE_BIASED: "biased",
    pb.AxisHealth.STATE_STALE: "not fresh",
    pb.AxisHealth.STATE_SUSPECT: "suspect",
}
AXIS_MEANINGS = {  # of what is wrong with an axis, for people
    "stuck": "It gives the same value again and again.",
    "saturated": "It is at the end of its range: the true value is larger.",
    "swapped": "It measures along the axis of another one: wires or layout are exchanged.",
    "sign flipped": "It measures along its axis, but the other way round.",
    "spiking": "Single values of it are far off.",
    "biased": "It is off by a constant that the others do not share.",
    "not fresh": "Its values are repeated: no new reading comes.",
}
LEVELS = {"critical": 3, "warning": 2, "watch": 1}
SHOWN = (pb.Alarm.STATE_UNACKNOWLEDGED, pb.Alarm.STATE_ACKNOWLEDGED)
ALONE = (
    "certificate",
    "clock",
    "disk",
    "inconsistent",
    "recorder",
)  # that the alarms' service finds, and we not
MOST = 12  # of one device
STARTING_S = 8.0  # after a device was first heard of, before which an absent board is no fault
TURNS_RADPS = 0.035  # 2 deg/s: beyond it a rate is no standstill
PROCEDURES_SILENT_S = 3.0  # s without a word of who drives a table
RECORDER_STALE_S = 5.0  # s without a word of the recorder while it records
_COUNTS = re.compile(r"fixes (\w+) (\d+)")


def words(alarm: Alarm) -> dict[str, str]:
    """Words of the trade that stand in an alarm, with their meanings."""
    return words_in(alarm.kind, alarm.title, alarm.text)


def words_in(kind: str, title: str, text: str) -> dict[str, str]:
    """Likewise of one that came over the bus."""
    of_axes = AXIS_MEANINGS if kind == "axis" else {}
    shown = {word: means for word, means in of_axes.items() if word in title}
    return shown | words_of([title, text])


def counts(message: str) -> dict[str, int] | None:
    """What an estimator counted, of a message such as 'fixes used 1315, fixes late 2'; None for any
    other message.
    """
    found = [_COUNTS.fullmatch(part) for part in message.split(", ")]
    return {match[1]: int(match[2]) for match in found} if all(found) else None


def axis_good(axis: pb.AxisHealth.Axis) -> bool:
    """An axis that is only looked into is good."""
    looked_into = axis.state == pb.AxisHealth.STATE_SUSPECT and not axis.excluded
    return looked_into or axis.state == pb.AxisHealth.STATE_GOOD


def waits(state: str) -> bool:
    """Whether an estimator says that it has nothing to say yet, as 'finding biases: keep still'."""
    return ":" in state or "keep still" in state or "stand still" in state


def alarms(store: Store, device: Device, now: float | None = None) -> list[Alarm]:
    """What is wrong with a device, the worst first. Call under the store's lock; now:
    time.monotonic(), s, of a replay that is paused, when it was.
    """
    if store.replay.state(device.name, time.monotonic()) == "ended":
        return []
    now = time.monotonic() if now is None else now
    cut = gateway_out_of_reach(store, device.name)
    found = [*twin_fault(store, device.name), *faults(device, now, cut)]
    return judged(found, device, now, False)[:MOST]


def judged(found: list[Alarm], device: Device, now: float, bench: bool) -> list[Alarm]:
    """What is found here with what the alarms' service says of it: its level, who took note, and
    what it alone finds, as limits. What is on a shelf is left out. Without the service, as found.
    """
    heard = device.get("alarm")
    if heard is None or device.stale("alarm", now=now):
        return found
    said = {one.id: one for one in heard.message.alarms if bool(one.device) is not bench}
    shown = []
    for one in found:
        known = said.pop(one.id, None)
        if known is None or known.state in (pb.Alarm.STATE_NORMAL, pb.Alarm.STATE_RETURNED):
            shown.append(one)
        elif known.state != pb.Alarm.STATE_SHELVED:
            shown.append(replace(one, **_said(known)))
    others = [one for one in said.values() if one.state in SHOWN and one.active]
    shown += [
        Alarm(plain(one.kind), plain(one.title), plain(one.text), plain(one.page), **_said(one))
        for one in others
        if one.kind in ("limit", *ALONE)
    ]
    return sorted(shown, key=lambda one: -LEVELS.get(one.level, 1))


def _said(one: pb.Alarm) -> dict[str, Any]:
    level = next((word for word, rank in LEVELS.items() if rank == one.level), "")
    state = "acknowledged" if one.state == pb.Alarm.STATE_ACKNOWLEDGED else "unacknowledged"
    return {"level": level, "state": state, "raised_s": one.raised_utc_ns * 1e-9}


def faults(device: Device, now: float, cut: bool = False) -> list[Alarm]:
    """All of them. Call under the store's lock. cut: its place is out of reach, which is an alarm
    of its own: whoever is silent there is not blamed for it.
    """
    found = [*_table(device, now), *_link(device, now, cut), *_board(device, now)]
    found += [*_axes(device, now), *_estimators(device, now, cut), *_sight(device, now)]
    return found


def bench_alarms(store: Store, now: float | None = None) -> list[Alarm]:
    """What is wrong with the recorder, its disk and the services. Call under the store's lock."""
    found, now = bench_faults(store, now), time.monotonic() if now is None else now
    told = [one for one in store.devices.values() if not one.stale("alarm", now=now)]
    return judged(found, told[0], now, True) if told else found


def bench_faults(store: Store, now: float | None = None) -> list[Alarm]:
    """As found here. Call under the store's lock."""
    found = [*_recorder(store, now), *service_faults(store)]
    known = {one.id for one in found}
    return found + [one for one in store.own_faults if one.id not in known]


def _recorder(store: Store, now: float | None) -> Iterator[Alarm]:
    heard = store.recorder
    if heard is None or (
        heard.age(now) > RECORDER_STALE_S and role_out_of_reach(store, "recorder")
    ):
        return
    text = plain(heard.message.message)
    if heard.message.recording and heard.age(now) > RECORDER_STALE_S:
        silent = f"silent for {heard.age(now):.0f} s in the middle of a recording"
        yield Alarm("recorder", "recorder silent", silent, "")
    elif text:
        full = "no space" in text.lower() or "full" in text.lower()
        slow = "disk slow" if "the disk is slow" in text else "recording failed"
        yield Alarm("recorder", "disk full" if full else slow, text, "")


def drives(m: pb.ProcedureStatus) -> bool:
    """Whether a procedure has a table in its hands: from its start until the table is let go; and
    after that where it did not take its stop.
    """
    active = m.state in (pb.ProcedureStatus.STATE_RUNNING, pb.ProcedureStatus.STATE_HELD)
    return bool(m.table) and (active or bool(m.alarm) or m.instruction.endswith("being closed"))


def _table(device: Device, now: float) -> Iterator[Alarm]:
    heard = device.get("procedure")
    if heard is not None and drives(heard.message) and heard.age(now) > PROCEDURES_SILENT_S:
        text = (
            f"the procedures have been silent for {heard.age(now):.0f} s and"
            f" {plain(heard.message.table, 60)} may still turn: stop it at the table"
        )
        yield Alarm("table", "the table is left alone", text, "procedure", "alone")
    if heard is not None and heard.message.alarm:
        yield Alarm("table", "the table may turn", plain(heard.message.alarm), "procedure", "turns")


def _link(device: Device, now: float, cut: bool) -> Iterator[Alarm]:
    heard = device.get("link")
    if heard is None:
        return
    m = heard.message
    if device.stale("link", now=now):
        if cut:
            return
        text = f"its gateway has been silent for {heard.age(now):.0f} s: does it still run?"
        yield Alarm("link", "gateway silent", text, "link")
    elif not m.connected and not m.bytes_in and now - device.born < STARTING_S:
        return  # services and board start together, each in its own time
    elif not m.connected:
        yield Alarm("link", "link lost", plain(m.message) or "the board is not connected", "link")
    elif m.message:
        yield Alarm("link", "link", plain(m.message), "link", "said")


def _board(device: Device, now: float) -> Iterator[Alarm]:
    heard = device.get("board")
    if heard is None or device.stale("board", now=now):
        return
    # The simulated table boots at the beginning of each of its tests: nobody has to look after it.
    simulated = heard.message.header.source == pb.SOURCE_SIMULATED
    for fault in heard.message.faults:
        if fault.name == "reboot" and simulated:
            continue
        if fault.active or fault.name == "reboot":  # over as soon as it is known
            name = plain(fault.name)
            yield Alarm("board", name, plain(fault.text), "board", name)


def _axes(device: Device, now: float) -> Iterator[Alarm]:
    heard = device.get("axes")
    if heard is None or device.stale("axes", now=now):
        return
    for axis in heard.message.axes:
        if axis_good(axis):
            continue
        name = plain(axis.name, 16)
        title = f"axis {name} {AXIS_WORDS.get(axis.state, 'unknown')}"
        text = plain(axis.text) or "it does not fit the other axes"
        yield Alarm("axis", title, text + (", not used" if axis.excluded else ""), "health", name)


def _estimators(device: Device, now: float, cut: bool) -> Iterator[Alarm]:
    page = {"nav": "position", "attitude": "tilt", "rate": "rates"}[device.body]
    for name in device.estimators("estimator"):
        heard = device.get("estimator", name)
        m, called = heard.message, plain(name, 40)
        if device.stale("estimator", name, now):
            if cut:
                continue
            text = f"nothing from it for {heard.age(now):.0f} s: does its process still run?"
            yield Alarm("estimator", f"{called} silent", text, page, called)
            continue
        if m.message and counts(m.message) is None:
            doubted = m.message.startswith("settings: ")
            title = "is a setting wrong?" if doubted else called
            kind = "settings" if doubted else "estimator"
            yield Alarm(kind, title, plain(m.message), page, called)
    yield from _late(device, page)


def _late(device: Device, page: str) -> Iterator[Alarm]:
    """What the estimators' machine has no time or no room for."""
    said = [device.get("estimator", name).message for name in device.estimators("estimator")]
    trouble = next((plain(m.trouble) for m in said if m.trouble), "")
    if trouble:
        yield Alarm("disk", "state not saved", trouble, page, "state")
    behind_s = max((m.behind_s for m in said), default=0.0)
    limit_hz = max((m.limit_hz for m in said), default=0.0)
    if behind_s <= BEHIND_STALE_S and not limit_hz:
        return
    what = [f"estimates are {behind_s:.0f} s behind their samples"] if behind_s >= 0.5 else []
    if limit_hz:
        what.append(f"at most {limit_hz:g} estimates a second are published")
    skipped_s = max(m.skipped_s for m in said)
    if skipped_s:
        what.append(f"samples of {skipped_s:.0f} s were passed over")
    text = (
        f"{', '.join(what)}: the estimators' machine is too slow for all that it is given; fewer"
        " estimators or boards, or a second machine"
    )
    title = "estimates are late" if behind_s > BEHIND_STALE_S else "estimates are sparse"
    yield Alarm("late", title, text, page)


def _sight(device: Device, now: float) -> Iterator[Alarm]:
    """What the leading rate filter does not see, or what contradicts it."""
    names = device.estimators("rate")
    if not names or device.stale("rate", names[0], now):
        return
    name = names[0]
    m = rates.row(device.get("rate", name).message, -1)
    status = device.get("estimator", name)
    if status is not None and waits(status.message.state):
        return
    reason, called = plain(m.sight_reason), plain(name, 40)
    if "contradict" in reason:
        yield Alarm("contradicted", f"{called} contradicted", reason, "nis", called)
    blind = len(m.sight) == 3 and all(s == pb.RateEstimate.SIGHT_BLIND for s in m.sight)
    if blind and not m.still:
        text = reason or "no component is seen now"
        yield Alarm("blind", f"{called} blind", text, "rates", called)
    omega = m.omega_ib_b_radps
    if m.still and len(omega) == 3 and max(map(abs, omega)) > TURNS_RADPS:
        text = "the accelerometers say that it stands still, the filter says that it turns"
        yield Alarm("contradicted", f"{called} contradicted", text, "rates", f"{called}-still")
