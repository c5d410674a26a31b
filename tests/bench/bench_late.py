"""A dashboard opened late: how long until it shows the last ten minutes of every plot, in a real
page.

    python tests/bench/bench_late.py [minutes of history, default 10] [page (default) or rings:
    without a browser]

A cube at 100 samples/s with two estimators goes on in real time in a process of its own; before
that its history has been written to the spools of gateway and estimator, dated back: 20 samples/s,
and 100 in the last 70 s, of which a dashboard asks for everything. Then a dashboard is started, a
real Chromium opens it, and the window of ten minutes is chosen. Wants playwright and
/usr/bin/chromium; draws in software.
"""

import multiprocessing
import sys
import tempfile
import threading
import time
from pathlib import Path
from types import SimpleNamespace

sys.path[:0] = [
    str(Path(__file__).resolve().parent.parent),
    str(Path(__file__).resolve().parent.parent.parent),
]

from playwright.sync_api import Error, sync_playwright  # noqa: E402
from support.feeder import Feeder  # noqa: E402
from support.kill_stack import line  # noqa: E402
from support.stack import free_port  # noqa: E402

from dashboard.data.feed import Feed  # noqa: E402
from dashboard.data.store import Store  # noqa: E402
from dashboard.desk import Desk  # noqa: E402
from dashboard.scene.service import start  # noqa: E402
from messages.bus.session import BusSettings, Publishers, open_client, open_router  # noqa: E402
from messages.contract.topics import ESTIMATES, GATEWAY  # noqa: E402
from messages.history.answers import declare  # noqa: E402
from messages.history.spool import Spool  # noqa: E402
from tests.support.browser import CHROMIUM, FLAGS  # noqa: E402

DT, DEVICE = 0.01, "cube-01"
PATIENCE_S = 60.0
SPANS = """() => Object.values(window.__viserTestpoints?.uplots ?? {})
  .map((plot) => plot.chart.data?.[0] ?? [])
  .filter((t) => t.length > 1).map((t) => t.at(-1) - t[0])"""


def board(folder: Path, router: str, minutes: float, ready: object) -> None:
    """The process that published: history first, then real time for ever."""
    bus = BusSettings(router=router)
    began = time.time() - 60.0 * minutes
    spools = {source: Spool(folder / source) for source in (GATEWAY, ESTIMATES)}
    by_source = {source: Publishers(None, bus.prefix, spool) for source, spool in spools.items()}
    feeder = Feeder(by_source[GATEWAY], int(began * 1e9))

    def put(topic, device, message, estimator=""):
        by_source.get(topic.source, by_source[GATEWAY]).put(topic, device, message, estimator)

    feeder._put = put
    k = 0
    while began + k * DT < time.time():
        feeder.cube(k * DT)
        k += 5 if began + k * DT < time.time() - 70.0 else 1
    session = open_client(bus, timeout_s=60.0)
    held = [
        declare(session, bus.prefix, DEVICE if s == GATEWAY else "*", s, spool)
        for s, spool in spools.items()
    ]
    for publishers in by_source.values():
        publishers.attach(session)
    ready.set()
    while held:
        feeder.cube(k * DT)
        k += 1
        time.sleep(max(0.0, began + k * DT - time.time()))


def seconds(condition) -> float | None:
    """How long until it is true; None when it did not come true."""
    begun = time.monotonic()
    while time.monotonic() - begun < PATIENCE_S:
        if condition():
            return round(time.monotonic() - begun, 2)
        time.sleep(0.02)
    return None


def reaches(store: object, span_s: float) -> bool:
    """Every ring that charts draw from goes back so far."""
    with store.lock:
        device = store.devices.get(DEVICE)
        rings = {} if device is None else device.rings
        spans = [
            t[-1] - t[0] for t, _ in (ring.window(-1e9, 1e9) for ring in rings.values()) if len(t)
        ]
        return {"accel", "rate"} <= {topic for topic, _ in rings} and min(spans) > span_s


def look(port: int, span_s: float) -> dict[str, float | None]:
    """Times of a real page: until its first chart; the window chosen, until all charts of the open
    page span it.
    """
    found: dict[str, float | None] = {}
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        page = browser.new_page(viewport={"width": 900, "height": 640})
        page.set_default_timeout(1000 * PATIENCE_S)
        page.goto(f"http://127.0.0.1:{port}", wait_until="commit")
        found["first_chart"] = seconds(lambda: page.evaluate(SPANS))
        page.get_by_text("View", exact=True).first.click()
        page.get_by_label("Window").first.click()
        page.get_by_role("option", name="10 min", exact=True).click()
        found["rates"] = seconds(lambda: (spans := page.evaluate(SPANS)) and min(spans) > span_s)
        page.screenshot(path="artefacts/late.png")
        browser.close()
    return found


def main(minutes: float = 10.0, until: str = "page") -> None:
    """Run and print."""
    port, context = free_port(), multiprocessing.get_context("spawn")
    bus = BusSettings(router=f"tcp/127.0.0.1:{port}", listen=[f"tcp/127.0.0.1:{port}"])
    span_s = 60.0 * minutes - 15.0
    with tempfile.TemporaryDirectory() as name, open_router(bus):
        ready = context.Event()
        process = context.Process(
            target=board, args=(Path(name), bus.router, minutes, ready), daemon=True
        )
        process.start()
        ready.wait(600.0)
        session, store, watched = open_client(bus), Store(), threading.Event()
        feed = Feed(session, bus.prefix, store, watched)
        handle = start(SimpleNamespace(viser_port=0), store, Desk(session, bus.prefix), watched)
        try:
            line(
                "late_history_in_dashboard",
                seconds(lambda: reaches(store, span_s)),
                "s",
                target=2.0,
            )
            if until == "rings":
                return
            try:
                found = look(handle.port, span_s)
            except Error as error:
                line("late_page", None, "s", target=2.0, not_measured=str(error).splitlines()[0])
                return
            line("late_page_to_first_chart", found.pop("first_chart"), "s")
            for title, value in found.items():
                line(f"late_charts_{title.lower()}", value, "s", target=2.0)
        finally:
            handle.stop()
            feed.stop()
            session.close()
            process.kill()
            process.join()
            threading.Event().wait(0.2)


if __name__ == "__main__":
    main(*(float(word) for word in sys.argv[1:2]), *sys.argv[2:3])
