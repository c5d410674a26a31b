"""What one waits for with sessions: report, exports, the list of 500, a session of one hour opened
in the browser.

    python tests/bench/bench_sessions.py [HOURS]

One line of JSON per group of figures. The long session is the 30 s table run, written over and over
through the recorder's own store with times and sequences that go on (100 Hz, two estimators,
tachometer). Its pages are the real ones behind the real front door, in Chromium; without Chromium
those figures are left out, and the line says so.
"""

import contextlib
import json
import os
import shutil
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from support.table_session import SESSION, table_recording, table_root

from messages.contract.topics import parse
from sessions.export.export import FORMATS, export
from sessions.library.catalogue import Catalogue
from sessions.library.curves import FILE
from sessions.library.curves_build import build
from sessions.recording.mcap_log import read
from sessions.replay.rerun import write_session
from sessions.report.build import build as report
from sessions.report.verdict import load_spec

CHROMIUM = "/usr/bin/chromium"
RUN_S = 30.0
LONG = "20240101-000000-long"
LIMIT_S = 3.0


def seconds(work) -> float:
    """Wall time of one call."""
    begin = time.perf_counter()
    work()
    return round(time.perf_counter() - begin, 2)


def short() -> dict:
    """Report, exports, list; s."""
    path = table_recording()
    result: dict = {"bench": "sessions", "recording_MB": round(path.stat().st_size / 1e6, 2)}
    result["report_s"] = seconds(lambda: report(path, load_spec(None)))
    with tempfile.TemporaryDirectory() as scratch:
        for form in FORMATS:
            if form not in ("kml", "gpx"):  # this one has no track
                result[f"export_{form}_s"] = seconds(
                    lambda form=form: export(path, form, Path(scratch) / form)
                )
        root = Path(scratch) / "sessions"
        for k in range(500):
            folder = root / f"20240101-{k:06d}"
            folder.mkdir(parents=True)
            (folder / "recording.mcap").write_bytes(b"")
            text = (
                (table_root() / SESSION / "session.json").read_text().replace(SESSION, folder.name)
            )
            (folder / "session.json").write_text(text)
        result["list_500_s"] = seconds(lambda: Catalogue(root).list())
        shutil.rmtree(root)
    return result


def repeated(hours: float) -> Iterator[tuple[int, str, bytes]]:
    """The table run's messages again and again, each with its next time and sequence."""
    decoded = [
        (row.log_ns, row.key, parse(row.key).topic.type.FromString(row.payload))
        for row in read(table_recording())
    ]
    counts: Counter[str] = Counter()
    step = round(RUN_S * 1e9)
    for run in range(round(hours * 3600 / RUN_S)):
        for log_ns, key, message in decoded:
            if "header" in message.DESCRIPTOR.fields_by_name:
                counts[key] += 1
                message.header.sequence = counts[key]
                message.header.utc_ns += step if run else 0
                message.header.device_us += step // 1000 if run else 0
            yield log_ns + run * step, key, message.SerializeToString()


def long(hours: float) -> dict:
    """A long session: reading it, and its page."""
    result: dict = {
        "bench": "sessions_long",
        "hours": hours,
        "load_1min": round(os.getloadavg()[0], 1),
    }
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        path = write_session(folder / "sessions", LONG, repeated(hours), "", {}) / "recording.mcap"
        shutil.copytree(table_root() / SESSION, folder / "sessions" / SESSION)
        result["recording_MB"] = round(path.stat().st_size / 1e6, 1)
        result["read_coarse_cpu_s"] = cpu(lambda: build(path, coarse=True))
        result["read_whole_cpu_s"] = cpu(lambda: build(path))
        if not Path(CHROMIUM).exists():
            return result | {"browser": f"{CHROMIUM} is not there: pages were not timed"}
        result |= pages(folder)
        result["curves_MB"] = round((path.parent / FILE).stat().st_size / 1e6, 1)
    result["limit_s"] = LIMIT_S
    result["ok"] = max(result["first_opening_s"], result["opening_s"]) <= LIMIT_S
    return result


def cpu(work) -> float:
    """CPU time of one call, s."""
    begin = time.process_time()
    work()
    return round(time.process_time() - begin, 2)


def pages(folder: Path) -> dict:
    """Seconds from asking for a page until its lines are drawn: never opened before, whole, again,
    and compared.
    """
    from playwright.sync_api import sync_playwright
    from support.front_door import open_door

    from dashboard.web.users import issue_link_token

    with contextlib.ExitStack() as stack:
        door = stack.enter_context(open_door(folder, scene=False))
        browser = stack.enter_context(sync_playwright()).chromium.launch(
            executable_path=CHROMIUM, args=["--no-sandbox"]
        )
        page = browser.new_page(viewport={"width": 1440, "height": 900})
        page.goto(f"{door.url}/login/link?token={issue_link_token(door.settings.users, 'anna')}")
        page.wait_for_url(f"{door.url}/")

        def opened(address: str, state: str = "") -> float:
            page.goto(f"{door.url}/users")
            begin = time.perf_counter()
            page.goto(f"{door.url}{address}")
            page.wait_for_selector(f"body[data-plotted{state}]", timeout=240_000)
            return round(time.perf_counter() - begin, 2)

        result = {"first_opening_s": opened(f"/sessions/{LONG}")}
        begin = time.perf_counter()
        page.wait_for_selector("body[data-plotted=done]", timeout=240_000)
        result["then_read_whole_s"] = round(time.perf_counter() - begin, 2)
        result["opening_s"] = opened(f"/sessions/{LONG}")
        result["compare_with_another_s"] = opened(f"/compare?ids={LONG},{SESSION}", "=done")
        browser.close()
        return result


def main() -> None:
    """All of it."""
    print(json.dumps(short()), flush=True)
    print(json.dumps(long(float(sys.argv[1]) if len(sys.argv) > 1 else 1.0)))


if __name__ == "__main__":
    main()
