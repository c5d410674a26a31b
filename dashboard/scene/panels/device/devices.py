"""The summary on the left: which device, where its data come from, is it well, and the numbers one
looks for first.
"""

import math
import re
import time

import numpy as np

from dashboard.data.pose import roll_pitch
from dashboard.scene.drawing.geometry import MODES
from dashboard.scene.drawing.palette import (
    FIX,
    REFERENCE,
    SOURCES,
    age,
    escape,
    estimator_colour,
    estimator_title,
    number,
    rows,
)
from dashboard.scene.panels.base import DEG, Panel, Snapshot
from messages.contract import gyrofree_pb2 as pb
from messages.contract import rates

_COUNTS = re.compile(r"fixes (\w+) (\d+)")


def counts(message: str) -> dict[str, int] | None:
    """What an estimator counted, of a message such as 'fixes used 1315, fixes late 2'; None for any
    other message.
    """
    found = [_COUNTS.fullmatch(part) for part in message.split(", ")]
    return {match[1]: int(match[2]) for match in found} if all(found) else None


class Devices(Panel):
    """Source badge, health and live values of the chosen device. Also what a phone shows first."""

    title = "Device"
    _table = None

    def update(self, s: Snapshot) -> None:
        self._table = self.html(self._content(s), self._table)

    def waiting(self, text: str) -> None:
        """There is no device yet."""
        badge = '<span class="gf-badge" style="background:#8C8C8C">WAITING</span>'
        self._table = self.html(
            f'<div class="gf-head">{badge}</div><p class="gf-note">{escape(text)}</p>', self._table
        )

    def _content(self, s: Snapshot) -> str:
        device = s.device
        text, colour = SOURCES[self._source(s)]
        data = "imu" if device.is_vehicle else "accel"
        newest = device.get(data) or max(device.latest.values(), key=lambda latest: latest.arrived)
        state = self._state(s, newest.age(s.now))
        head = (
            f'<div class="gf-head"><span class="gf-badge" style="background:{colour}">{text}</span>'
            f'<span class="gf-name">{escape(device.name)}</span>{state}</div>'
        )
        body = {"nav": self._vehicle, "attitude": self._board, "rate": self._cube}[device.body](s)
        return (
            head
            + self._alerts(s)
            + self._advice(s)
            + body
            + rows(self._health(s), s.stale("link"))
            + self._logs(s)
        )

    @staticmethod
    def _state(s: Snapshot, old: float) -> str:
        """Live, stale, or what the replay does that these data are of."""
        replay = s.store.replay.state(s.device.name, time.monotonic())
        if replay == "ended":
            return '<b class="gf-bad">■ replay ended</b>'
        if replay == "paused":
            return '<b class="gf-replay">❚❚ replay paused</b>'
        if old >= 1.0:
            return f'<b class="gf-bad">■ stale, {age(old)}</b>'
        return (
            '<b class="gf-replay">▶ replay</b>' if replay else '<span class="gf-live">● live</span>'
        )

    @staticmethod
    def _source(s: Snapshot) -> int:
        """The newest message that says where its data come from."""
        for latest in sorted(s.device.latest.values(), key=lambda item: -item.arrived):
            if latest.message.header.source in SOURCES and latest.message.header.source:
                return latest.message.header.source
        return pb.SOURCE_UNKNOWN

    @staticmethod
    def _cube(s: Snapshot) -> str:
        tiles = []
        for name in s.device.estimators("rate"):
            m = rates.row(s.device.get("rate", name).message, -1)
            omega = m.omega_ib_b_radps[2] * DEG if len(m.omega_ib_b_radps) == 3 else None
            sub = "still" if m.still else f"angle {number(m.angle_z_rad * DEG, 0, '°')}"
            tiles.append(_tile(s, name, "rate", number(omega, 1), "°/s", sub))
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
        return f'<div class="gf-tiles">{"".join(tiles)}</div>'

    @staticmethod
    def _vehicle(s: Snapshot) -> str:
        tiles = []
        for name in s.device.estimators("nav"):
            m = s.device.get("nav", name).message
            speed = float(np.hypot(*m.v_n_mps[:2])) * 3.6 if len(m.v_n_mps) == 3 else None
            sigma = float(np.hypot(m.sigma[6], m.sigma[7])) if len(m.sigma) >= 8 else None
            sub = f"{MODES.get(m.mode, '')} · 1σ {number(sigma, 2, 'm')}"
            tiles.append(_tile(s, name, "nav", number(speed, 1), "km/h", sub))
        fix = s.device.get("gnss")
        if fix is not None:
            quality = (
                pb.GnssFix.Quality.Name(fix.message.quality)
                .removeprefix("QUALITY_")
                .replace("_", " ")
                .lower()
            )
            if fix.message.quality and math.isnan(fix.message.height_m):
                quality += " · no height"
            if fix.message.quality and not fix.message.v_n_mps:
                quality += " · no velocity"
            satellites = str(fix.message.satellites) if fix.message.satellites else "–"
            tiles.append(_raw_tile("GNSS", FIX, satellites, "satellites", quality, s.stale("gnss")))
        return f'<div class="gf-tiles">{"".join(tiles)}</div>'

    @staticmethod
    def _board(s: Snapshot) -> str:
        tiles = []
        for name in s.device.estimators("attitude"):
            roll, pitch = (
                number(angle * DEG, 1)
                for angle in roll_pitch(s.device.get("attitude", name).message.q_nb)
            )
            tiles.append(_tile(s, name, "attitude", f"{roll} / {pitch}", "°", "roll / pitch"))
        return f'<div class="gf-tiles">{"".join(tiles)}</div>'

    @staticmethod
    def _alerts(s: Snapshot) -> str:
        found = [s.device.get("link")] + [
            s.device.get("estimator", n) for n in s.device.estimators("estimator")
        ]
        said = [
            latest.message.message
            for latest in found
            if latest is not None and latest.message.message
        ]
        texts = [text for text in said if counts(text) is None]
        board = s.device.get("board")
        if board is not None and not s.stale("board"):
            texts += [
                f"{fault.name}: {fault.text}" for fault in board.message.faults if fault.active
            ]
        if s.store.dropped:
            texts.append(f"the dashboard could not keep up: {s.store.dropped} messages not shown")
        if s.store.refused:
            texts.append(f"{s.store.refused} messages of too many or nameless devices not shown")
        return "".join(f'<p class="gf-alert">{escape(text)}</p>' for text in texts)

    @staticmethod
    def _health(s: Snapshot) -> list[tuple[str, str]]:
        items = []
        link, board, accel = s.device.get("link"), s.device.get("board"), s.device.get("accel")
        if link is not None:
            m = link.message
            lost = f'<b class="gf-bad">{m.lost_samples}</b>' if m.lost_samples else "0"
            items += [
                ("link", "connected" if m.connected else '<b class="gf-bad">not connected</b>'),
                ("sample rate", number(m.sample_rate_hz, 1, "Hz")),
                ("lost · bad bytes", f"{lost} · {m.bad_bytes}"),
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
                items.append((estimator_title(name), '<b class="gf-bad">silent</b>'))
                continue
            state = m.state.partition(":")[
                0
            ]  # what a person should do stands after the colon, see _advice
            items.append(
                (estimator_title(name), f"{escape(state)} · {number(m.us_per_sample, 0, 'µs')}")
            )
            items += [
                (f"fixes {what}", number(count, 0))
                for what, count in (counts(m.message) or {}).items()
            ]
        if board is not None:
            items.append(("firmware", escape(board.message.firmware)))
        return items

    @staticmethod
    def _advice(s: Snapshot) -> str:
        """What an estimator waits for the person to do, such as 'levelling: stand still for 10
        s'.
        """
        states = [
            s.device.get("estimator", n).message.state for n in s.device.estimators("estimator")
        ]
        return "".join(
            f'<p class="gf-note">{escape(text)}</p>'
            for text in dict.fromkeys(states)
            if ":" in text
        )

    @staticmethod
    def _logs(s: Snapshot) -> str:
        lines = [
            text
            for arrived, name, text in s.store.logs
            if name == s.device.name and s.now - arrived < 60
        ][-2:]
        return "".join(f'<p class="gf-note">{escape(text)}</p>' for text in lines)


def _tile(s: Snapshot, name: str, topic: str, value: str, unit: str, sub: str) -> str:
    colour = estimator_colour(name, s.device.estimators(topic))
    return _raw_tile(estimator_title(name), colour, value, unit, sub, s.stale(topic, name))


def _raw_tile(title: str, colour: str, value: str, unit: str, sub: str, stale: bool) -> str:
    return (
        f'<div class="gf-tile{" gf-stale" if stale else ""}" style="border-left-color:{colour}">'
        f"<span>{title}</span><b>{value}</b> <em>{unit}</em><small>{sub}</small></div>"
    )
