"""A newcomer's path, counted and measured: from `git clone` to a board on the live page, and on to
the signed report of the published 30 s test.

Everything is real: the clone, the commands as they are typed, Chromium, the services; the board is
simulated and hangs on a pseudo-terminal, a simulated person turns its table as the page asks. What
is counted: commands, and clicks (an address that is opened is one). One JSON line; exit code 1 when
it takes more than it may. `--ready` takes this installation instead of making one (`make setup`
still counts, but not its minutes); `--pictures FOLDER` keeps what was seen.
"""

import argparse
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from playwright.sync_api import Page, expect, sync_playwright

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from support.stack import free_port  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
MOST_TO_LIVE, MOST_TO_REPORT = 10, 3
CHROMIUM = "/usr/bin/chromium"
FLAGS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
PATIENCE_MS = 180_000  # the scene is drawn in software
BUILT = ("inertial/core/_core*.so", "emulator/_cycles.so")
PASSWORD = "a long pass phrase"
NAME = "anna"


class Newcomer:
    """What he does, one after the other."""

    def __init__(self, folder: Path, ready: bool) -> None:
        self.folder, self.ready = folder, ready
        self.done: list[str] = []
        self.begun = time.monotonic()
        self.clone = folder / "gyrofree"

    @property
    def seconds(self) -> float:
        return round(time.monotonic() - self.begun, 1)

    def command(self, *words: str, says: str = "", cwd: Path | None = None) -> None:
        """A command that is waited for."""
        self.done.append(" ".join(words))
        subprocess.run(
            self._real(words),
            cwd=cwd or self.clone,
            check=True,
            input=says,
            text=True,
            env=self._env(),
        )

    @contextmanager
    def running(self, *words: str) -> Iterator[Path]:
        """A command that goes on; the log of what it says."""
        self.done.append(" ".join(words))
        with started(self._real(words), self.clone, self.folder / "up.log", self._env()) as log:
            yield log

    def click(self, what: str) -> None:
        self.done.append(f"[{what}]")

    def gyrofree(self) -> list[str]:
        return self._real([".venv/bin/gyrofree"])

    def _real(self, words) -> list[str]:
        if words[0] != ".venv/bin/gyrofree":
            return list(words)
        if self.ready:
            return [sys.executable, "-P", "-m", "gyrofree", *words[1:]]
        return [str(self.clone / words[0]), *words[1:]]

    def _env(self) -> dict[str, str]:
        return os.environ | ({"PYTHONPATH": str(self.clone)} if self.ready else {})


@contextmanager
def started(words: list[str], cwd: Path, log: Path, env: dict[str, str]) -> Iterator[Path]:
    """A process with its log, until the block ends."""
    with log.open("wb") as out:
        process = subprocess.Popen(words, cwd=cwd, stdout=out, stderr=out, env=env)
    try:
        yield log
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(60)


def said(log: Path, pattern: str) -> re.Match:
    """Wait for a line."""
    end = time.monotonic() + PATIENCE_MS / 1000.0
    while not (found := re.search(pattern, log.read_text(errors="replace"))):
        if time.monotonic() > end:
            raise SystemExit(f"no {pattern!r}:\n{log.read_text(errors='replace')[-3000:]}")
        time.sleep(0.1)
    return found


def install(one: Newcomer) -> None:
    """Clone and setup."""
    one.command("git", "clone", "--quiet", str(ROOT), "gyrofree", cwd=one.folder)
    if not one.ready:
        one.command("make", "setup")
        return
    one.done.append("make setup")
    for pattern in BUILT:
        for file in ROOT.glob(pattern):
            shutil.copy(file, one.clone / file.relative_to(ROOT))


@contextmanager
def board(one: Newcomer, bus_port: int) -> Iterator[Path]:
    """The board that he has, and the person at its table, who hears what the page asks."""
    link, config = one.folder / "by-id" / "usb-cube", one.folder / "bench.toml"
    config.write_text(f'[bus]\nrouter = "tcp/127.0.0.1:{bus_port}"\n')
    words = [*one.gyrofree(), "simulate", "--link", str(link), "--config", str(config)]
    with started(words, one.folder, one.folder / "board.log", one._env()) as log:
        said(log, "simulated cube")
        yield link.parent


def enter(one: Newcomer, page: Page, url: str) -> None:
    """Open the address, sign in, and see the board live."""
    page.goto(url)
    one.click("open the address")
    page.get_by_label("Name").fill(NAME)
    page.get_by_label("Password").fill(PASSWORD)
    page.get_by_role("button", name="Sign in").click()
    one.click("Sign in")
    expect(page.locator("#device")).to_have_attribute("data-state", "live", timeout=PATIENCE_MS)


def test_and_report(one: Newcomer, page: Page, keep) -> str:
    """Run the published test; the text of its report."""
    page.locator("#rooms").get_by_role("tab", name="Test").click()
    one.click("Test")
    scene = page.frame_locator("#scene")
    start = scene.get_by_role("button", name="Start test")
    expect(start).to_be_visible(timeout=PATIENCE_MS)
    keep(page, "start")
    unit = scene.locator("xpath=//*[text()='Serial number']/following::input[1]")
    unit.fill("SN-1", timeout=20_000)
    unit.press("Tab")
    start.click()
    one.click("Start test")
    scene.get_by_role("button", name="Yes, start it").click()
    one.click("Yes, start it")
    expect(scene.get_by_text("Turn the table").first).to_be_visible(timeout=PATIENCE_MS)
    keep(page, "test")
    report = scene.get_by_role("link", name="Open the report")
    expect(report).to_be_visible(timeout=PATIENCE_MS)
    keep(page, "done")
    with page.context.expect_page() as opened:
        report.click()
    one.click("Open the report")
    there = opened.value
    there.wait_for_url(re.compile(r"report\.html$"), timeout=PATIENCE_MS)
    keep(there, "report")
    return there.inner_text("body")


def walk(one: Newcomer, pictures: Path | None) -> dict:
    """The whole way; the figures."""

    def keep(page: Page, name: str) -> None:
        if pictures is not None:
            pictures.mkdir(parents=True, exist_ok=True)
            page.screenshot(path=pictures / f"first-hour-{name}.png")

    install(one)
    port, bus_port = free_port(), free_port()
    gyrofree = ".venv/bin/gyrofree"
    with board(one, bus_port) as ports, sync_playwright() as playwright:
        others = ["--dashboard-port", str(port), "--bus-port", str(bus_port)]  # ours may be taken
        pty = ["--ports-in", str(ports)]  # where there is no USB
        first = ["--user", NAME, "--password-file", "-"]
        one.command(gyrofree, "setup", "--yes", *first, *pty, *others, says=PASSWORD + "\n")
        with one.running(gyrofree, "up") as log:
            url = said(log, r"open  (http://\S+)")[1]
            browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
            page = browser.new_page(viewport={"width": 1024, "height": 768})
            page.set_default_timeout(PATIENCE_MS)
            enter(one, page, url)
            to_live, live_s = len(one.done), one.seconds
            keep(page, "live")
            text = test_and_report(one, page, keep)
            browser.close()
    assert "Published rotating-table test" in text and "SN-1" in text, text[:500]
    signed = text[text.rindex("Tested by") - 40 :]
    assert NAME in signed, signed
    verdict = re.search(r"\b(PASS|FAIL|INCOMPLETE)\b", text)
    return {
        "bench": "first_hour",
        "to_live": to_live,
        "to_live_s": live_s,
        "to_report": len(one.done) - to_live,
        "to_report_s": round(one.seconds - live_s, 1),
        "installed": "before" if one.ready else "by make setup",
        "verdict": verdict[1].lower() if verdict else "",
        "steps": one.done,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--ready", action="store_true", help="take this installation")
    parser.add_argument("--pictures", type=Path, help="folder for what was seen")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="gyrofree-first-") as folder:
        figures = walk(Newcomer(Path(folder), given.ready), given.pictures)
    print(json.dumps(figures))
    few = figures["to_live"] <= MOST_TO_LIVE and figures["to_report"] <= MOST_TO_REPORT
    sys.exit(0 if few else 1)


if __name__ == "__main__":
    main()
