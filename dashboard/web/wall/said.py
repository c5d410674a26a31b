"""What a wall display shows, in words and numbers that need no more thought there."""

import math
from typing import Any

from dashboard.data.alarms import alarms, bench_alarms
from dashboard.data.device import Device
from dashboard.data.intake import INTAKE
from dashboard.data.lateness import lateness
from dashboard.data.live import finite, live
from dashboard.data.places import places
from dashboard.data.pose import roll_pitch
from dashboard.data.store import Store
from messages.bus.command.watch import name_of
from messages.contract import gyrofree_pb2 as pb
from messages.text import plain

DEG = 180.0 / math.pi
ALARMS, BOARDS, PLACES = 4, 6, 6  # rows that there is room for
RECORDER_STALE_S = 5.0
Told = dict[str, Any]


def chosen(store: Store, wanted: str) -> Device | None:
    """The board asked for, else the first that has data. Call under the store's lock."""
    if wanted:
        return store.device(wanted)
    speaking = [store.devices[name] for name in store.names() if store.devices[name].rings]
    fresh = [one for one in speaking if _age(one) < 3.0]
    return (fresh or speaking or [None])[0]


def moving(device: Device) -> Told:
    """What changes many times a second: attitude and rate, null where it is not known."""
    topic = "nav" if device.body == "nav" else "attitude"
    turned, rate = live(device, topic), live(device, "rate")
    return {
        "q": None if turned is None or turned["stale"] else turned["q_nb"],
        "omega": None if rate is None or rate["stale"] else rate["omega_radps"],
        "age_s": finite(_age(device)),
    }


def _age(device: Device) -> float:
    """Since the newest word with data, s: alarms are said of a silent board, too."""
    data = (one.age() for (topic, _), one in device.latest.items() if topic in INTAKE)
    return min(data, default=math.inf)


def state(store: Store, wanted: str, stale_s: float) -> Told:
    """All the rest, once a second. Call under the store's lock."""
    device = chosen(store, wanted)
    found = list(bench_alarms(store))
    said: Told = {"device": wanted, "there": device is not None, "rows": [], "late": ""}
    if device is not None:
        said |= _of_device(store, device, stale_s)
        found = [*alarms(store, device), *found]
    others = [name for name in store.names() if device is None or name != device.name]
    order = {"critical": 0, "warning": 1, "watch": 2}
    found.sort(key=lambda one: order.get(one.level, 1))
    return said | {
        "alarms": [
            {"level": one.level or "warning", "title": plain(one.title), "text": plain(one.text)}
            for one in found[:ALARMS]
        ],
        "more": max(0, len(found) - ALARMS),
        "boards": [_board(store.devices[name], stale_s) for name in others[:BOARDS]],
        "places": [
            {"name": one["name"], "state": one["state"]} for one in places(store.presence)[:PLACES]
        ],
        "recording": _recording(store),
    }


def _of_device(store: Store, device: Device, stale_s: float) -> Told:
    link = device.get("link")
    age_s = _age(device)
    source = link.message.header.source if link is not None else pb.SOURCE_UNKNOWN
    late = lateness(store, device)
    connected = link is not None and link.message.connected
    return {
        "device": device.name,
        "source": pb.Source.Name(source).removeprefix("SOURCE_").lower()
        if source in pb.Source.values()
        else "unknown",
        "connected": connected and age_s <= stale_s,
        "stale": age_s > stale_s,
        "hz": link.message.sample_rate_hz if link is not None else 0.0,
        "lost": link.message.lost_samples if link is not None else 0,
        "late": late.said if late is not None and late.shown else "",
        "rows": _rows(device),
        "procedure": _procedure(device),
    }


def _board(device: Device, stale_s: float) -> Told:
    return {"name": device.name, "stale": _age(device) > stale_s}


def _rows(device: Device) -> list[Told]:
    """Three lines of large numbers."""
    if device.body == "nav":
        return _vehicle(live(device, "nav"))
    if device.body == "attitude":
        return _tilt(live(device, "attitude"))
    rate = live(device, "rate")
    if rate is None or rate["stale"]:
        return [_row(f"ω {axis}", None, "°/s", "no estimate") for axis in "xyz"]
    values, sigmas, sights = rate["omega_radps"], rate["sigma_radps"], rate["sight"]
    parts = zip(values, sigmas, sights, strict=False)
    return [_rate(axis, *one) for axis, one in zip("xyz", parts, strict=False)]


def _rate(axis: str, value: float | None, sigma: float | None, sight: str) -> Told:
    if value is None or sight == "blind":
        return _row(f"ω {axis}", None, "°/s", "not known")
    half = None if sigma is None else sigma * DEG
    said = _within(half)
    if sight == "ambiguous":
        row = _row(f"ω {axis}", abs(value) * DEG, "°/s", f"{said} sign not known".strip(), half)
        return row | {"value": f"±{row['value']}"}
    return _row(f"ω {axis}", value * DEG, "°/s", said, half)


def _within(half: float | None) -> str:
    return "" if half is None else f"± {_fixed(half, half)} (1σ)"


def _row(name: str, value: float | None, unit: str, note: str, half: float | None = None) -> Told:
    shown = "–" if value is None else _fixed(value, half)
    return {"name": name, "value": shown, "unit": unit, "note": note, "known": value is not None}


def _fixed(value: float, half: float | None) -> str:
    """No more digits than the half width lets stand, and none that cannot be read from afar."""
    places = 1 if half is None or half <= 0 else 0 if half >= 1.0 else 1 if half >= 0.1 else 2
    text = f"{value:.{places}f}"
    return (text if float(text) else text.lstrip("-")).replace("-", "\u2212")


def _tilt(said: Told | None) -> list[Told]:
    if said is None or said["stale"] or not said["q_nb"]:
        return [_row(name, None, "°", "no estimate") for name in ("roll", "pitch")]
    roll, pitch = roll_pitch(said["q_nb"])
    sigma = said["inclination_sigma_rad"]
    half = None if sigma is None else sigma * DEG
    note = _within(half)
    return [
        _row("roll", roll * DEG, "°", note, half),
        _row("pitch", pitch * DEG, "°", note, half),
    ]


def _vehicle(said: Told | None) -> list[Told]:
    if said is None or said["stale"] or said["latitude_deg"] is None:
        why = plain(said["why"], 60) if said is not None else ""
        return [_row("speed", None, "m/s", why or "no solution")]
    v_n = [value for value in said["v_n_mps"] or [] if value is not None]
    speed = math.hypot(*v_n[:2]) if len(v_n) == 3 else None
    return [
        _row("speed", speed, "m/s", said["mode"], 0.1),
        _row("north", said["latitude_deg"], "°", "", 0.01),
        _row("east", said["longitude_deg"], "°", "", 0.01),
    ]


def _procedure(device: Device) -> str:
    heard = device.get("procedure")
    if heard is None or heard.age() > 5.0:
        return ""
    m = heard.message
    if m.state not in (pb.ProcedureStatus.STATE_RUNNING, pb.ProcedureStatus.STATE_HELD):
        return ""
    held = " HELD" if m.state == pb.ProcedureStatus.STATE_HELD else ""
    return plain(f"{m.title}: step {m.step + 1} of {len(m.steps)}{held}", 80)


def _recording(store: Store) -> str:
    heard = store.recorder
    if heard is None or heard.age() > RECORDER_STALE_S:
        return "recorder not heard of"
    m = heard.message
    if not m.recording:
        return "not recording"
    minutes, seconds = divmod(int(m.seconds), 60)
    return f"recording {plain(m.session, 60)} {minutes}:{seconds:02d}"


def commanding(status: pb.CommandStatus | None) -> str:
    """Who has the command."""
    return "" if status is None or not status.holder.id else f"{name_of(status.holder)} commands"
