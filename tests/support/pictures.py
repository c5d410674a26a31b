"""The pictures of the guide, taken of the running demo by the project's own Chromium.

python tests/support/pictures.py docs/guide/pictures
"""

import sys
import tempfile
from pathlib import Path

from playwright.sync_api import Page, sync_playwright

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]

from support.browser import CHROMIUM, FLAGS  # noqa: E402
from support.stack import RunningDemo  # noqa: E402

SIZE = {"width": 1440, "height": 900}
PATIENCE = 120_000  # ms; the scene is drawn in software
TURNING = 42_000  # ms: the charts then have a run of the table to show, and it turns again
DRAWN = 6_000  # ms, of another workspace
WORKSPACES = {"1": "watch", "2": "test", "3": "diagnose", "4": "calibrate"}  # by key
PAGES = ("sessions",)


def take(folder: Path) -> list[Path]:
    """All pictures as PNG files of the folder; returns them."""
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as work, RunningDemo(Path(work) / "demo") as demo:
        with sync_playwright() as playwright:
            chromium = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
            page = chromium.new_page(viewport=SIZE)
            page.set_default_timeout(PATIENCE)
            taken = _all(page, demo, folder)
            chromium.close()
    return taken


def _all(page: Page, demo: RunningDemo, folder: Path) -> list[Path]:
    page.goto(demo.link)
    frame = page.wait_for_selector("#scene").content_frame()
    frame.wait_for_function(
        "() => window.__viserMutable?.nodeRefFromName?.['/world/estimate/products-ekf/body']"
    )
    page.wait_for_timeout(TURNING)
    taken = []
    for key, name in WORKSPACES.items():
        page.keyboard.press(key)
        page.wait_for_timeout(DRAWN)
        taken.append(_picture(page, folder / f"{name}.png"))
    page.goto("about:blank")  # the scene would go on being drawn
    for name in PAGES:
        page.goto(f"{demo.url}/{name}")
        page.wait_for_selector("main")
        taken.append(_picture(page, folder / f"{name}.png"))
    return taken


def _picture(page: Page, path: Path) -> Path:
    page.screenshot(path=path, timeout=PATIENCE)
    return path


if __name__ == "__main__":
    for made in take(Path(sys.argv[1])):
        print(made)
