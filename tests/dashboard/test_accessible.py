"""Every page and workspace in a real browser: no serious finding of axe-core, no clipped text, keys
and tabs that work, one switch for dark and light.
"""

import contextlib
import re
import threading
from types import SimpleNamespace

import pytest
from playwright.sync_api import expect, sync_playwright
from support.feeder import UTC0_NS, Feeder
from support.front_door import open_door

from dashboard.data.store import Store
from dashboard.desk import Desk
from dashboard.scene.panels import PAGES
from dashboard.scene.service import OWN_INPUTS, start
from messages.contract import gyrofree_pb2 as pb
from messages.contract import topics as tp

axe_of = pytest.importorskip("axe_playwright_python.sync_playwright")
pytestmark = [pytest.mark.browser, pytest.mark.timeout(600)]

PATIENCE = 60_000  # ms
CHROMIUM = "/usr/bin/chromium"
FLAGS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
SIZES = {"desk": (1440, 900), "tablet": (1024, 768), "narrow": (768, 1024), "phone": (390, 844)}
# elements that hide a part of their own text; those that scroll are meant to
CLIPPED = """() => [...document.querySelectorAll('body *')].filter((e) => {
  const style = getComputedStyle(e), own = [...e.childNodes].some((n) => n.nodeType === 3 && n.data.trim());
  const hidden = style.visibility === 'hidden' || style.display === 'none' || !e.getClientRects().length;
  if (hidden || !own || e.closest('.hidden, [inert], [aria-hidden=true], details:not([open]) > :not(summary)') || style.display === 'inline') return false;
  if (e.closest('#webgl-software-rendering') || style.clipPath !== 'none') return false;
  return e.scrollWidth > e.clientWidth + 1 && !['auto', 'scroll'].includes(style.overflowX);
}).map((e) => `${e.tagName} ${e.id} ${e.className}: ${e.textContent.slice(0, 60)}`)"""  # noqa: E501


class Into:
    """Publishers that put into a store."""

    def __init__(self, store):
        self._store = store

    def put(self, topic, device, message, estimator=""):
        self._store.put(topic, device, estimator, message)


@contextlib.contextmanager
def fed(store):
    """A cube and a car that go on speaking, the cube with a stuck axis."""
    ended = threading.Event()
    feeder = Feeder(Into(store))
    axes = [pb.AxisHealth.Axis(name=f"a{k}", state=int(k == 3)) for k in range(12)]

    def speak():
        k = 0
        while not ended.wait(0.02):
            feeder.cube(k * 0.02, 0.02)
            feeder.drive(k * 0.02)
            if k % 25 == 0:
                header = pb.Header(device="cube-01", utc_ns=UTC0_NS + k * 20_000_000)
                store.put(tp.AXES, "cube-01", "", pb.AxisHealth(header=header, axes=axes))
            k += 1

    thread = threading.Thread(target=speak)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


@pytest.fixture(scope="module")
def door(tmp_path_factory):
    store, desk = Store(), Desk(None, "gyrofree")
    handle = start(SimpleNamespace(viser_port=0), store, desk)
    folder = tmp_path_factory.mktemp("door")
    try:
        with (
            fed(store),
            open_door(
                folder,
                scene=False,
                scene_at=handle.port,
                store=store,
                desk=desk,
                open_labels=OWN_INPUTS,
            ) as opened,
        ):
            yield opened
    finally:
        handle.stop()


@pytest.fixture(scope="module")
def chromium():
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield browser
        browser.close()


@contextlib.contextmanager
def visit(chromium, door, user="otto", size="desk", scheme="dark", path="/"):
    """The live page of a person, its scene there; what its console complained of."""
    width, height = SIZES[size]
    context = chromium.new_context(viewport={"width": width, "height": height}, color_scheme=scheme)
    with door.client(user) as client:
        cookies = [{"name": k, "value": v, "url": door.url} for k, v in client.cookies.items()]
    context.add_cookies(cookies)
    page, said = context.new_page(), []
    page.set_default_timeout(PATIENCE)
    page.on("console", lambda message: message.type == "error" and said.append(message.text))
    page.on("pageerror", lambda error: said.append(error.stack))
    try:
        page.goto(door.url + path)
        page.locator("#rooms [aria-selected=true]").wait_for()
        yield page, said
    finally:
        context.close()


def scene_of(page):
    return page.locator("#scene").element_handle().content_frame()


def turn_to(page, key):
    """Open a page of the view as a click on an alarm does, and wait until it is there."""
    page.evaluate("async (p) => (await import('/static/desk.js')).turnTo(p)", key)
    expect(page.locator("#pages [aria-selected=true]")).to_have_attribute("data-key", key)
    page.wait_for_timeout(500)  # for what it draws


def serious(where, rules=None):
    """The findings of axe-core that count; of all its rules, or of these."""
    only = {"runOnly": {"type": "rule", "values": rules}} if rules else None
    found = axe_of.Axe().run(where, options=only).response["violations"]
    return [
        (one["id"], [node["html"][:200] for node in one["nodes"]][:3])
        for one in found
        if one["impact"] in ("serious", "critical")
    ]


@pytest.mark.parametrize("scheme, size", [("dark", "desk"), ("light", "phone")])
def test_no_page_of_the_scene_has_a_serious_finding_or_clipped_text(chromium, door, scheme, size):
    # nothing to draw in software: the pages are looked at; a scheme changes only colours
    rules = None if scheme == "dark" else ["color-contrast"]
    path = "/?w=watch&layers=grid"
    with visit(chromium, door, scheme=scheme, size=size, path=path) as (page, said):
        scene = scene_of(page)
        wrong, seen = {}, set()
        for device in ("cube-01", "car-01"):
            page.select_option("#devices", device)
            if found := serious(page, rules):  # what is about the view is the same for every page
                wrong[device, "view"] = found
            shown = [one for one in PAGES if (one.title != "Layout" or device == "cube-01")]
            for key in [
                one.key() for one in shown if not one.missing(door.front.store.devices[device])
            ]:
                if key in seen:  # the same page of the other device
                    continue
                seen.add(key)
                turn_to(page, key)
                found = serious(scene, rules) + [page.evaluate(CLIPPED), scene.evaluate(CLIPPED)]
                wrong |= {(device, key): found} if any(found) else {}
        assert not wrong
        assert not said


@pytest.mark.parametrize("size", SIZES)
def test_no_width_clips_the_bars_or_the_summary(chromium, door, size):
    with visit(chromium, door, size=size) as (page, _):
        scene_of(page).wait_for_selector(".gf-tile")
        page.wait_for_timeout(1000)  # for the panels to fit
        assert page.evaluate("document.documentElement.scrollWidth") <= SIZES[size][0]
        assert page.evaluate("document.documentElement.scrollHeight") <= SIZES[size][1]
        assert not page.evaluate(CLIPPED) and not scene_of(page).evaluate(CLIPPED)
        for part in ("#pause", "#window", "#note", "#mark", "#record"):
            box = page.locator(part).bounding_box()
            assert 0 <= box["x"] and box["x"] + box["width"] <= SIZES[size][0], part
            assert box["y"] + box["height"] <= SIZES[size][1], part


def test_the_plain_pages_have_no_serious_finding(chromium, door):
    for scheme in ("dark", "light"):
        with visit(chromium, door, user="anna", scheme=scheme) as (page, _):
            for path in ("/sessions", "/users", "/words", "/api/docs"):
                page.goto(door.url + path)
                assert not serious(page), path
                assert not page.evaluate(CLIPPED), path


def test_keys_work_wherever_the_focus_is_and_d_moves_no_camera(chromium, door):
    with visit(chromium, door) as (page, _):
        room = page.locator("#rooms [aria-selected=true]")
        page.keyboard.press("3")
        expect(room).to_have_text("Diagnose")
        page.locator("#scene").click()  # the focus goes into the frame
        camera = "() => window.__viserMutable.camera.position.toArray()"
        page.wait_for_timeout(1500)
        before = scene_of(page).evaluate(camera)
        page.keyboard.down("d")
        page.wait_for_timeout(600)
        page.keyboard.up("d")
        expect(page.locator("html")).to_have_attribute("data-theme", "light")
        assert scene_of(page).evaluate(camera) == pytest.approx(before, abs=1e-3)
        page.keyboard.press("1")
        expect(room).to_have_text("Watch")
        page.keyboard.press("p")
        expect(page.locator("#paused")).to_be_visible()
        page.fill("#note", "3 p d")
        expect(room).to_have_text("Watch")
        page.reload()
        expect(page.locator("html")).to_have_attribute("data-theme", "light")
        page.goto(f"{door.url}/sessions")
        expect(page.locator("html")).to_have_attribute("data-theme", "light")


def test_tabs_are_tabs(chromium, door):
    with visit(chromium, door) as (page, _):
        page.locator("#rooms [aria-selected=true]").focus()
        page.keyboard.press("ArrowRight")
        expect(page.locator("#rooms [aria-selected=true]")).to_be_focused()
        first = page.locator("#rooms [role=tab]").first
        page.keyboard.press("Home")
        expect(first).to_have_attribute("aria-selected", "true")
        assert page.locator("#rooms [tabindex='0']").count() == 1


def test_a_link_shows_another_person_the_same(chromium, door):
    with visit(chromium, door) as (page, _):
        page.select_option("#devices", "cube-01")
        turn_to(page, "nis")
        page.select_option("#window", "60")
        page.wait_for_url("**/?*window=60*")
        link = page.url.removeprefix(door.url)
    with visit(chromium, door, user="vera", path=link) as (page, _):
        expect(page.locator("#pages [aria-selected=true]")).to_have_text("NIS")
        expect(page.locator("#window")).to_have_value("60")
        expect(page.locator("#devices")).to_have_value("cube-01")


def test_an_alarm_is_in_every_workspace_and_leads_to_its_page(chromium, door):
    with visit(chromium, door, path="/?w=watch&device=cube-01") as (page, _):
        alarm = page.locator(".alarm", has_text="axis a3 stuck").first
        for key in ("1", "3", "4", "5"):
            page.keyboard.press(key)
            expect(alarm).to_be_visible()
        alarm.click()
        expect(page.locator("#pages [aria-selected=true]")).to_have_text("Health")


def test_a_viewer_sees_what_he_may_not_and_why(chromium, door):
    with visit(chromium, door, user="vera", path="/?p=board") as (page, _):
        for part in ("#record", "#session", "#note", "#mark"):
            expect(page.locator(part)).to_be_disabled()
            expect(page.locator(part)).to_have_attribute("title", re.compile("viewer"))
        scene = scene_of(page)
        scene.wait_for_selector("text=You look as viewer")
        expect(scene.get_by_role("button", name="Start sampling")).to_be_disabled()
        page.locator("#pause").click()
        expect(page.locator("#paused")).to_be_visible()
