"""Real Chromium for the tests: one for all, a page for a visitor, what its console said."""

import contextlib
from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

CHROMIUM = "/usr/bin/chromium"
FLAGS = [
    "--no-sandbox",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
]
# said without harm: drawing in software; a part of viser that we do not use wants to evaluate texts
KNOWN = ("GPU stall", "Evaluating a string as JavaScript")
DESKTOP, PHONE = {"width": 1440, "height": 900}, {"width": 390, "height": 844}
EXPECTED = 30_000  # ms; the 5 s of playwright are short on a busy machine
PATIENCE = 90_000  # ms; the scene is drawn in software here


def _shared(fixture_name: str, config: pytest.Config) -> str:
    """How long a browser is kept: its event loop would be in the way of tests without one."""
    return "session" if config.option.markexpr == "browser" else "module"


@pytest.fixture(scope=_shared)
def chromium() -> "Iterator[Browser]":
    """A browser that draws in software; one for all, each visitor has a context of his own."""
    from playwright.sync_api import expect, sync_playwright  # most tests need none

    expect.set_options(timeout=EXPECTED)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield browser
        browser.close()


class Rounds:
    """Counts the rounds in which the scene's panels are drawn, of the process of the test."""

    def __init__(self) -> None:
        self.drawn = 0

    @classmethod
    @contextlib.contextmanager
    def counted(cls) -> "Iterator[Rounds]":
        """To be entered before a scene is started."""
        from dashboard.scene.view import View  # most tests need none

        rounds, tick = cls(), View.tick_panels

        def counting(view: View) -> None:
            tick(view)
            rounds.drawn += 1

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(View, "tick_panels", counting)
            yield rounds

    def after(self, page: "Page") -> None:
        """Until what is open now was drawn, and has come to the browser."""
        end = self.drawn + 1
        while self.drawn < end:
            page.wait_for_timeout(20)
        page.wait_for_timeout(80)


@contextlib.contextmanager
def visit(
    chromium: "Browser", door, user: str = "otto", path: str = "", viewport=DESKTOP, **options
) -> "Iterator[tuple[Page, list[str]]]":
    """A page of a person who is signed in, at `path` when one is given; and what its console
    complained of, the policy's refusals too. Options are those of a browser's context.
    """
    context = chromium.new_context(viewport=viewport, **{"color_scheme": "dark"} | options)
    with door.client(user) as client:
        cookies = [{"name": k, "value": v, "url": door.url} for k, v in client.cookies.items()]
    context.add_cookies(cookies)
    page, said = context.new_page(), []
    page.set_default_timeout(PATIENCE)
    page.on("console", lambda message: message.type == "error" and said.append(message.text))
    page.on("pageerror", lambda error: said.append(error.stack or str(error)))
    try:
        if path:
            page.goto(door.url + path)
        yield page, said
    finally:
        context.close()
