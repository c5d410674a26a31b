"""The summary on the left: which device, where its data come from, is it well, and the numbers one
looks for first.
"""

import math
import time

import numpy as np

from dashboard.data.alarms import TURNS_RADPS, alarms, bench_alarms, counts, waits
from dashboard.data.device import PREVIEW_PAUSES
from dashboard.data.lateness import lateness
from dashboard.data.pose import roll_pitch
from dashboard.data.whereabouts import QUALITIES
from dashboard.scene.drawing.geometry import MODES
from dashboard.scene.drawing.page import EMPTY, Markup, alert, bad, joined, note, rows, tag, term
from dashboard.scene.drawing.palette import (
    FIX,
    REFERENCE,
    SOURCES,
    age,
    estimator_colour,
    estimator_title,
    number,
)
from dashboard.scene.panels.base import DEG, Panel, Snapshot, from_zero
from inertial.rate.batch import Phase
from messages.contract import gyrofree_pb2 as pb
from messages.contract import rates
from messages.text import counted

# states that are as fast as the samples: in each pair, what is said of a body that stands still,
# and of one that turns
MOTIONS = ((Phase.STILL, Phase.TURNING), (Phase.STILL_AT_START, Phase.INTEGRATING))
BEHIND_SHOWN_S = 0.5  # that an estimator is behind by less is nobody's business


class Devices(Panel):
    """Source badge, health and live values of the chosen device. Also what a phone shows first."""

    title = "Device"
    short = False  # on a phone: the rows are left to the pages of Diagnose
    _table = None

    def update(self, s: Snapshot) -> None:
        content = s.once(("summary", self.short), lambda: self._content(s))
        self._table = self.html(content, self._table)

    def waiting(self, text: str) -> None:
        """There is no device yet."""
        badge = tag("span", "WAITING", class_="gf-badge", style="background:#8C8C8C")
        self._table = self.html(tag("div", badge, class_="gf-head") + note(text), self._table)

    def _content(self, s: Snapshot) -> Markup:
        device = s.device
        text, colour = SOURCES[self._source(s)]
        data = "imu" if device.is_vehicle else "accel"
        newest = device.get(data) or max(device.latest.values(), key=lambda latest: latest.arrived)
        state = self._state(s, newest.age(s.now))
        badge = tag("span", text, class_="gf-badge", style=f"background:{colour}")
        name = tag("span", device.name, class_="gf-name")
        head = tag("div", badge, name, state, class_="gf-head")
        body = {"nav": self._vehicle, "attitude": self._board, "rate": self._cube}[device.body](s)
        return (
            head
            + self._alerts(s)
            + self._advice(s)
            + body
            + (EMPTY if self.short else rows(self._health(s), s.stale("link")))
            + self._logs(s)
        )

    @staticmethod
    def _state(s: Snapshot, old: float) -> Markup:
        """Live, stale, or what the replay does that these data are of."""
        replay = s.store.replay.state(s.device.name, time.monotonic())
        if replay == "ended":
            return bad("■ replay ended")
        if replay == "paused":
            return tag("b", "❚❚ replay paused", class_="gf-replay")
        if old >= max(1.0, PREVIEW_PAUSES * s.device.thinned_s):
            return bad(f"■ stale, {age(old)}")
        if replay:
            return tag("b", "▶ replay", class_="gf-replay")
        late = lateness(s.store, s.device)
        if late is not None and late.shown:
            return tag("b", f"◷ {late.said}", class_="gf-replay", title=late.details)
        return tag("span", "● live", class_="gf-live")

    @staticmethod
    def _source(s: Snapshot) -> int:
        """The newest message that says where its data come from."""
        for latest in sorted(s.device.latest.values(), key=lambda item: -item.arrived):
            if latest.message.header.source in SOURCES and latest.message.header.source:
                return latest.message.header.source
        return pb.SOURCE_UNKNOWN

    @staticmethod
    def _cube(s: Snapshot) -> Markup:
        tiles = []
        for name in s.device.estimators("rate"):
            m = rates.row(s.device.get("rate", name).message, -1)
            omega, sub = _said_rate(s, name, m)
            tiles.append(_tile(s, name, "rate", omega, "°/s", sub))
        tacho = s.device.get("tacho")
        if tacho is not None:
            sub = "" if tacho.message.direction_known else "magnitude only"
            stale = s.stale("tacho")
            tiles.append(
                _raw_tile(
                    "tachometer",
                    REFERENCE,
                    number(tacho.message.omega_radps * DEG, 1),
                    "°/s",
                    sub,
                    stale,
                )
            )
        return tag("div", *tiles, class_="gf-tiles")

    @staticmethod
    def _vehicle(s: Snapshot) -> Markup:
        tiles = []
        for name in s.device.estimators("nav"):
            m = s.device.get("nav", name).message
            speed = float(np.hypot(*m.v_n_mps[:2])) * 3.6 if len(m.v_n_mps) == 3 else None
            sigma = float(np.hypot(m.sigma[6], m.sigma[7])) if len(m.sigma) >= 8 else None
            sub = f"{MODES.get(m.mode, '')} · 1σ {number(sigma, 2, 'm')}"
            tiles.append(_tile(s, name, "nav", number(speed, 1), "km/h", sub))
        fix = s.device.get("gnss")
        if fix is not None:
            quality = QUALITIES.get(fix.message.quality, "none")
            if fix.message.quality and math.isnan(fix.message.height_m):
                quality += " · no height"
            if fix.message.quality and not fix.message.v_n_mps:
                quality += " · no velocity"
            satellites = str(fix.message.satellites) if fix.message.satellites else "–"
            tiles.append(_raw_tile("GNSS", FIX, satellites, "satellites", quality, s.stale("gnss")))
        return tag("div", *tiles, class_="gf-tiles")

    @staticmethod
    def _board(s: Snapshot) -> Markup:
        tiles = []
        for name in s.device.estimators("attitude"):
            roll, pitch = (
                number(angle * DEG, 1)
                for angle in roll_pitch(s.device.get("attitude", name).message.q_nb)
            )
            tiles.append(_tile(s, name, "attitude", f"{roll} / {pitch}", "°", "roll / pitch"))
        return tag("div", *tiles, class_="gf-tiles")

    @staticmethod
    def _alerts(s: Snapshot) -> Markup:
        found = [*alarms(s.store, s.device, s.now), *bench_alarms(s.store)]
        texts = [f"{alarm.title}: {alarm.text}" for alarm in found]
        if s.store.dropped:
            texts.append(
                f"the dashboard could not keep up: {counted(s.store.dropped, 'message')} not shown"
            )
        if s.store.refused:
            kinds = ", ".join(f"{kind} {n}" for kind, n in sorted(s.store.door.counts().items()))
            said = counted(s.store.refused, "message")
            texts.append(f"{said} refused and not shown ({kinds}): see the log")
        return joined(alert(text) for text in texts)

    @staticmethod
    def _health(s: Snapshot) -> list[tuple[str, object]]:
        items: list[tuple[str, object]] = []
        link, board, accel = s.device.get("link"), s.device.get("board"), s.device.get("accel")
        if link is not None:
            m = link.message
            lost = bad(m.lost_samples) if m.lost_samples else "0"
            items += [
                ("link", "connected" if m.connected else bad("not connected")),
                ("sample rate", number(m.sample_rate_hz, 1, "Hz")),
                ("lost · bad bytes", joined([lost, f" · {m.bad_bytes}"])),
                ("latency p99", number(m.latency_p99_s * 1e3, 2, "ms")),
                ("clock skew", number(m.clock_skew_ppm, 1, "ppm", sign=True)),
            ]
        if accel is not None:
            axes = accel.message.axes
            items.append(
                ("axes fresh", f"{axes - bin(accel.message.stale_mask).count('1')} of {axes}")
            )
        for name in s.device.estimators("estimator"):
            m = s.device.get("estimator", name).message
            if s.stale("estimator", name):
                items.append((estimator_title(name), bad("silent")))
                continue
            state = state_of(s, name)
            cost = tag("span", number(m.us_per_sample, 0, "µs"), title="computing, for each sample")
            items.append((estimator_title(name), joined([f"{state} · ", cost])))
            if m.behind_s > BEHIND_SHOWN_S:
                items.append(("", bad(f"{m.behind_s:.1f} s behind")))
            if m.skipped_s:
                items.append(("", bad(f"{m.skipped_s:.1f} s passed over")))
            items += [
                (f"fixes {what}", number(count, 0))
                for what, count in (counts(m.message) or {}).items()
            ]
        if board is not None:
            items.append(("firmware", board.message.firmware))
        return items

    @staticmethod
    def _advice(s: Snapshot) -> Markup:
        """What an estimator waits for the person to do, such as 'levelling: stand still for 10
        s'.
        """
        states = [
            s.device.get("estimator", n).message.state for n in s.device.estimators("estimator")
        ]
        asking = (state for state in dict.fromkeys(states) if waits(state))
        return joined(note(text) for text in asking)

    @staticmethod
    def _logs(s: Snapshot) -> Markup:
        lines = [
            text
            for arrived, name, text in s.store.logs
            if name == s.device.name and s.now - arrived < 60
        ][-2:]
        return joined(note(text) for text in lines)


def state_of(s: Snapshot, name: str) -> str:
    """What an estimator does. Whether the body is still or turns changes faster than the status
    comes: that is taken from the message that the values are of.
    """
    state = s.device.get("estimator", name).message.state
    state = state.partition(":")[0]  # what a person should do stands after it, see _advice
    rate = s.device.get("rate", name)
    if rate is None:
        return state
    still = rates.row(rate.message, -1).still
    for at_rest, turning in MOTIONS:
        if state == at_rest.text and not still:
            return turning.text
        if state == turning.text and still and at_rest == Phase.STILL:
            return at_rest.text
    return state


def _said_rate(s: Snapshot, name: str, m: pb.RateEstimate) -> tuple[str, Markup | str]:
    """The rate about z as a tile shows it, and what is said below: no number where none is
    known.
    """
    status = s.device.get("estimator", name)
    if status is not None and waits(status.message.state):
        return "–", status.message.state
    if len(m.omega_ib_b_radps) != 3:
        return "–", "no rate in its message"
    omega = m.omega_ib_b_radps[2]
    sight = m.sight[2] if len(m.sight) == 3 else pb.RateEstimate.SIGHT_VALID
    drifted = m.still and abs(omega) > TURNS_RADPS
    if sight == pb.RateEstimate.SIGHT_BLIND:
        why = "the body stands still, the integral drifted" if drifted else m.sight_reason
        return "–", joined([term("blind"), f": {why or 'too slow to be seen'}"])
    shown = number(omega * DEG, 1)
    if sight == pb.RateEstimate.SIGHT_AMBIGUOUS:
        return f"± {number(abs(omega) * DEG, 1)}", joined([term("ambiguous"), ": sign not known"])
    if drifted:
        return shown, tag("span", "drifted: the body stands still", class_="gf-bad")
    angle = f"angle {number(m.angle_z_rad * DEG, 0, '°')} {from_zero(s.device, name)}"
    return shown, "still" if m.still else angle.strip()


def _tile(s: Snapshot, name: str, topic: str, value: str, unit: str, sub: str) -> Markup:
    colour = estimator_colour(name, s.device.estimators(topic))
    return _raw_tile(estimator_title(name), colour, value, unit, sub, s.stale(topic, name))


def _raw_tile(title: str, colour: str, value: str, unit: str, sub: str, stale: bool) -> Markup:
    inside = [tag("span", title), tag("b", value), " ", tag("em", unit), tag("small", sub)]
    kind = "gf-tile gf-stale" if stale else "gf-tile"
    return tag("div", *inside, class_=kind, style=f"border-left-color:{colour}")
