"""Real Chromium for the tests: one for a module, a page for a visitor, what its console said."""

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
PATIENCE = 90_000  # ms; the scene is drawn in software here


@pytest.fixture(scope="module")
def chromium() -> "Iterator[Browser]":
    """A browser that draws in software."""
    from playwright.sync_api import sync_playwright  # most tests need none

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield browser
        browser.close()


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
