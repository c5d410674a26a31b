"""Faults of the bench as causes of alarms: those of dashboard.data.alarms, which the page shows,
and what takes a look over time, at two services at once, or at the disk.

What cannot be looked at now (its topic is silent, the filter waits) is neither there nor gone.
"""

import shutil
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dashboard.alarms.machine import Cause
from dashboard.alarms.places import Certificates, clocks_off
from dashboard.alarms.settings import OFF, AlarmSettings
from dashboard.data.alarms import RECORDER_STALE_S, bench_faults, faults, waits
from dashboard.data.device import Device
from dashboard.data.fault import Alarm
from dashboard.data.store import Store
from dashboard.data.there import twin_fault
from messages.clock import STEP_NS
from messages.contract import gyrofree_pb2 as pb
from messages.text import plain
from sessions.report.nis import TOO_FEW, TOO_SURE, nis_verdict

SETTING_KINDS = ("settings", "estimator", "late", "disk")  # said by an estimator's status
SPECIAL = {"link-said": "line"}  # ids with a level of their own
NIS_S = 30.0  # of corrections that a verdict is taken on
GIB = 1 << 30


@dataclass(frozen=True)
class Found:
    """What is wrong, by id, and the kinds that could be looked at."""

    causes: dict[str, Cause]
    looked_at: frozenset[str]
    lasted: frozenset[str] = frozenset()  # causes that have stayed for as long as it takes


def of_device(store: Store, device: Device, settings: AlarmSettings, now: float) -> Found:
    """Call under the store's lock; now: time.monotonic(), s."""
    found = [*twin_fault(store, device.name), *faults(device, now)]
    found += [*_clock(device, now), *_not_recorded(store, device, now)]
    verdict = _inconsistent(device, now)
    found += verdict or []
    kinds = {"link"} if device.get("link") else set()
    kinds |= {"twin"} if store.presence.sees else set()
    kinds |= {"table"} if device.get("procedure") else set()
    kinds |= {"board"} if not device.stale("board", now=now) else set()
    kinds |= {"axis"} if not device.stale("axes", now=now) else set()
    kinds |= {"clock"} if not device.stale("link", now=now) else set()
    kinds |= {"recorder"} if not device.stale("procedure", now=now) else set()
    kinds |= {"inconsistent"} if verdict is not None else set()
    kinds |= set(_of_filters(device, now))
    return Found(_causes(found, settings), frozenset(kinds))


def of_bench(
    store: Store,
    settings: AlarmSettings,
    recordings: Path,
    now: float,
    certificates: Certificates | None = None,
) -> Found:
    """Of the recorder, the disk it writes to, the services, their clocks and certificates. Call
    under the store's lock.
    """
    found = bench_faults(store, now)
    kinds = {"recorder"} if store.recorder is not None else set()
    if store.presence.sees:
        kinds |= {"service", "place", "clock", "certificate"}
        found += clocks_off(store, settings)
        if certificates is not None:
            days = settings.certificate_days
            found += certificates.near_end(store, days, time.time())
    free = free_bytes(recordings)
    if free is not None:
        kinds |= {"disk"}
        if free < settings.disk_free_bytes:
            wanted = settings.disk_free_bytes / GIB
            text = (
                f"{free / GIB:.1f} GiB are free for recordings, of {wanted:.1f} that are wanted:"
                " delete old sessions, or record elsewhere"
            )
            found.append(Alarm("disk", "disk low", text, ""))
    lasted = frozenset(one.id for one in found if one.lasted)
    return Found(_causes(found, settings), frozenset(kinds), lasted)


def free_bytes(folder: Path) -> int | None:
    """Of the disk that a folder is on, or would be; None where that cannot be told."""
    there = next((one for one in (folder, *folder.absolute().parents) if one.exists()), None)
    try:
        return None if there is None else shutil.disk_usage(there).free
    except OSError:
        return None


def _causes(found: list[Alarm], settings: AlarmSettings) -> dict[str, Cause]:
    causes: dict[str, Cause] = {}
    for one in found:
        level = getattr(settings.health, SPECIAL.get(one.id, one.kind), "warning")
        if level != OFF:
            causes.setdefault(one.id, Cause(one.kind, one.title, one.text, level, one.page))
    return causes


def _of_filters(device: Device, now: float) -> Iterator[str]:
    """Kinds that estimators are asked about."""
    names = device.estimators("estimator")
    if names:
        yield "estimator"
    if any(not device.stale("estimator", name, now) for name in names):
        yield from SETTING_KINDS
    if _leading(device, now):
        yield from ("blind", "contradicted")


def _leading(device: Device, now: float) -> str:
    """The first rate filter, while it speaks and has begun; else empty."""
    names = device.estimators("rate")
    if not names or device.stale("rate", names[0], now):
        return ""
    status = device.get("estimator", names[0])
    waiting = status is not None and waits(status.message.state)
    return "" if waiting else names[0]


def _clock(device: Device, now: float) -> Iterator[Alarm]:
    heard = device.get("link")
    if heard is None or device.stale("link", now=now):
        return
    off_s = heard.message.clock_offset_s
    if abs(off_s) * 1e9 >= STEP_NS:
        text = (
            f"the clock of the gateway's machine was set by {off_s:+,.1f} s while it ran: times of"
            " this run go on without that; see that it is kept by NTP"
        )
        yield Alarm("clock", "clock was set", text, "link")


def _not_recorded(store: Store, device: Device, now: float) -> Iterator[Alarm]:
    heard = device.get("procedure")
    if heard is None or device.stale("procedure", now=now):
        return
    if heard.message.state != pb.ProcedureStatus.STATE_RUNNING:
        return
    recorder = store.recorder
    if recorder is not None and recorder.age(now) <= RECORDER_STALE_S:
        if recorder.message.recording:
            return
        why = "the recorder does not record"
    else:
        why = "no recorder is heard"
    text = f"{plain(heard.message.procedure, 60)} runs and {why}: its test will have no report"
    yield Alarm("recorder", "procedure not recorded", text, "procedure", "procedure")


def _inconsistent(device: Device, now: float) -> list[Alarm] | None:
    """What NIS says of the leading filter, and of what navigates; None: too little to say."""
    name = _leading(device, now)
    if not name:
        return None
    _, rows = device.window("rate", name, device.t_newest - NIS_S, device.t_newest)
    rows = rows[np.isfinite(rows["nis"]) & (rows["nis_dof"] > 0)]
    verdict = nis_verdict(rows["nis"], rows["nis_dof"])
    if verdict == TOO_FEW:
        return None
    if verdict != TOO_SURE:
        return []
    mean = float(np.sum(rows["nis"]) / np.sum(rows["nis_dof"]))
    text = (
        f"its errors squared are {mean:.1f} times what it believes, over {NIS_S:g} s: take its"
        f" sigma for {mean**0.5:.1f} times as large"
    )
    return [Alarm("inconsistent", f"{plain(name, 40)} too sure", text, "nis", plain(name, 40))]
