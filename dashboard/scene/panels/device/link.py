"""The line between board and gateway: what came, what was lost, how late, the clocks, and why bytes
were bad.
"""

from dashboard.data.device import Device
from dashboard.scene.drawing.page import alert, bad, note, rows, tag
from dashboard.scene.drawing.palette import number
from dashboard.scene.panels.base import Panel, Snapshot

MOST = 30  # reasons in the table


class Link(Panel):
    """The ledger of the line; its bytes add up: in = good + bad + pending."""

    title = "Link"
    workspace = "diagnose"
    _table = None

    @classmethod
    def missing(cls, device: Device) -> str:
        return "" if device.get("link") else "the gateway has not spoken of this line yet"

    def update(self, s: Snapshot) -> None:
        latest = s.device.get("link")
        if latest is None:
            text = "The gateway has not spoken of this line yet."
            self._table = self.html(note(text), self._table)
            return
        m = latest.message
        items = [
            ("state", "connected" if m.connected else bad("not connected")),
            ("port", m.port),
            ("samples", number(m.sample_rate_hz, 1, "Hz")),
            ("frames", number(m.frame_rate_hz, 1, "Hz")),
            (
                "latency p50 · p99",
                f"{number(m.latency_p50_s * 1e3, 2)} · {number(m.latency_p99_s * 1e3, 2, 'ms')}",
            ),
            ("clock skew", number(m.clock_skew_ppm, 1, "ppm", sign=True)),
            ("clock scatter", number(m.clock_residual_s * 1e6, 0, "µs")),
            ("clock window", number(m.clock_window_s, 0, "s")),
            ("bytes in", number(m.bytes_in, 0)),
            ("good frames", f"{number(m.good_frames, 0)} ({number(m.good_bytes, 0)} bytes)"),
            ("damaged", _count(m.bad_chunks, f" chunks ({number(m.bad_bytes, 0)} bytes)")),
            ("lost frames", _count(m.lost_frames)),
            ("of these dropped by the board", number(m.device_dropped, 0)),
            ("lost samples", _count(m.lost_samples)),
            ("reboots · reconnects", f"{m.reboots} · {m.reconnects}"),
            ("frames of unknown type", number(m.unknown_frames, 0)),
            (
                "journal, on disk",
                f"{number(m.durable_sequence, 0)} of {number(m.journal_sequence, 0)}",
            ),
            ("GNSS good · bad", f"{m.gnss_good} · {m.gnss_bad}"),
        ]
        content = rows(items, s.stale("link"))
        for title, counts in (("Left out, by reason", m.refused), ("Damage by reason", m.damage)):
            if counts:
                reasons = sorted(counts.items(), key=lambda item: -item[1])[:MOST]
                content += tag("p", title, class_="gf-title")
                content += rows([(reason, number(count, 0)) for reason, count in reasons])
        self._table = self.html(alert(m.message) + content, self._table)


def _count(value: int, after: str = "") -> object:
    text = number(value, 0) + after
    return bad(text) if value else text
