"""How old the picture is: by the time of its newest sample, the gateway's clock and ours, each
against the clock of the site's home (equation T-4 of docs/equations-time.md).

What is not known is not guessed: without an offset there is no age, and why is said.
"""

import math
import time
from dataclasses import dataclass

from dashboard.data.device import Device
from dashboard.data.store import Store
from messages.bus.presence import Process
from messages.clock import STEP_NS
from messages.contract.topics import REPLAY_SUFFIX

SAID_S = 1.0  # a picture that is older is late
SIGMAS = 3.0  # of a sample's time that count as its bound
STEP_S = STEP_NS * 1e-9  # from which a step is in that sigma
CLOCK_SAID_S = 0.1  # an offset that is larger is said beside the age


@dataclass(frozen=True)
class Lateness:
    """Of a device's picture."""

    age_s: float  # NaN: not known
    bound_s: float  # the most that it may be wrong by
    clock_ahead_s: float  # our clock minus home's; NaN: not known
    clock_bound_s: float
    why: str  # the age is not known; empty: it is
    afar: bool = False  # the board is at another place, or nobody knows where
    preview_hz: float = 0.0  # it is a preview of so many rows a second; 0: it is everything

    @property
    def known(self) -> bool:
        return math.isfinite(self.age_s)

    @property
    def late(self) -> bool:
        """Is it surely late?"""
        return self.known and self.age_s - self.bound_s > SAID_S

    @property
    def shown(self) -> bool:
        """Is it worth a place in the head of a page?"""
        return self.late or bool(self.preview_hz) or (self.afar and not self.known)

    @property
    def said(self) -> str:
        """For the head of a page, with no digit that is not known."""
        parts = [f"preview, {self.preview_hz:g} Hz"] if self.preview_hz else []
        if not self.known:
            return ", ".join([*parts, "age not known"])
        parts.append(f"{behind(self.age_s, self.bound_s)} behind")
        if abs(self.clock_ahead_s) > CLOCK_SAID_S + self.clock_bound_s:
            parts.append(f"clock {clock(self.clock_ahead_s, self.clock_bound_s)}")
        return ", ".join(parts)

    @property
    def details(self) -> str:
        """In full."""
        if not self.known:
            return self.why + self._thinned
        way = "ahead of" if self.clock_ahead_s >= 0 else "behind"
        ahead, bound = abs(self.clock_ahead_s), self.clock_bound_s
        return (
            f"newest sample {self.age_s:.3f} s ago, within {self.bound_s:.3f} s; the clock here is"
            f" {ahead:.3f} s {way} the site's, within {bound:.3f} s{self._thinned}"
        )

    @property
    def _thinned(self) -> str:
        if not self.preview_hz:
            return ""
        return (
            f"; at most {self.preview_hz:g} samples a second come over the link, and what lies"
            " between is no gap: it comes with the copy of the recording"
        )


def _digits(bound_s: float) -> int:
    """Decimals that such an uncertainty leaves."""
    return 1 if bound_s <= 0.25 else 0


def behind(age_s: float, bound_s: float) -> str:
    """An age with the digits that are known."""
    if bound_s > max(1.0, 0.5 * abs(age_s)):
        return f"at most {max(age_s, 0.0) + bound_s:.0f} s"
    if age_s < 0.05:
        return "under 0.1 s" if bound_s <= 0.05 else f"under {max(age_s, 0.0) + bound_s:.1f} s"
    return f"{age_s:.{_digits(bound_s)}f} s"


def clock(ahead_s: float, bound_s: float) -> str:
    """An offset likewise, with its sign."""
    text = f"{ahead_s:+,.{_digits(bound_s)}f} s"
    return text.replace("-", "−")


def lateness(store: Store, device: Device, wall_s: float | None = None) -> Lateness | None:
    """Of a live picture; None for a replay, whose time is another, and before there are samples.
    Call under the store's lock. wall_s: time.time().
    """
    if device.name.endswith(REPLAY_SUFFIX) or not device.rings:
        return None
    presence, gateway = store.presence, store.presence.gateway_of(device.name)
    there = gateway.place if gateway is not None else ""
    afar = presence.here not in ("", there) and len(presence.places()) > 1
    data = max(device.latest.values(), key=lambda one: one.arrived)
    sample_s = device.utc0_ns * 1e-9 + device.t_newest
    age = age_of(store, device, sample_s, data.message.header.utc_sigma_s, wall_s)
    ahead, bound = ahead_of(presence.mine)
    return Lateness(age.s, age.bound_s, ahead, bound, age.why, afar, float(store.preview_hz))


@dataclass(frozen=True)
class Age:
    """By the clock of the site."""

    s: float  # NaN: not known
    bound_s: float  # the most that it may be wrong by; NaN: not known
    why: str = ""  # it is not known; empty: it is


def age_of(
    store: Store, device: Device, sample_s: float, sigma_s: float, wall_s: float | None = None
) -> Age:
    """Of what a device said of `sample_s`, s since 1970 by its gateway's clock, +- sigma_s. Call
    under the store's lock. wall_s: time.time().
    """
    if device.name.endswith(REPLAY_SUFFIX):
        return Age(math.nan, math.nan, "a replay: its time is another")
    gateway, link = store.presence.gateway_of(device.name), device.get("link")
    was_set = 0.0 if link is None else link.message.clock_offset_s  # time stamps go on without it
    sigma_s -= abs(was_set) if abs(was_set) >= STEP_S else 0.0
    return said_by(store, gateway, "gateway", sample_s + was_set, sigma_s, wall_s)


def said_by(
    store: Store,
    process: Process | None,
    role: str,
    said_s: float,
    sigma_s: float = 0.0,
    wall_s: float | None = None,
) -> Age:
    """Of what a process said at `said_s`, s since 1970 by its own clock, +- sigma_s. Call under the
    store's lock. role: of it, for people.
    """
    ahead, bound = ahead_of(store.presence.mine)
    theirs, their_bound = ahead_of(process)
    why = _why(process, role, ahead, theirs)
    if why:
        return Age(math.nan, math.nan, why)
    age = (time.time() if wall_s is None else wall_s) - ahead - (said_s - theirs)
    return Age(age, bound + their_bound + SIGMAS * max(sigma_s, 0.0))


def _why(process: Process | None, role: str, ahead: float, theirs: float) -> str:
    """Why there is no age; empty where there is one."""
    if not math.isfinite(ahead):
        return "no offset of this clock to the site's is measured yet"
    if process is None:
        return f"its {role} says nothing of its clock"
    if not math.isfinite(theirs):
        return f"no offset of its {role}'s clock to the site's is measured yet"
    return ""


def ahead_of(process: Process | None) -> tuple[float, float]:
    """What a process says of its clock against the site's, s, and its bound; NaN: not known."""
    if process is None or not process.beats:
        return float("nan"), float("nan")
    return process.beat.clock_ahead_s, process.beat.clock_bound_s
