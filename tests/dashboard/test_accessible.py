"""Every page and workspace in a real browser: no serious finding of axe-core, no clipped text, keys
and tabs that work, one switch for dark and light.
"""

import contextlib
import re
import shutil
import sys
import threading
from types import SimpleNamespace

import pytest
from playwright.sync_api import expect
from support.browser import Rounds
from support.browser import visit as opened
from support.feeder import UTC0_NS, Feeder
from support.front_door import open_door
from support.table_session import SESSION, table_recording, table_root
from support.waiting import until

from dashboard.data.store import Store
from dashboard.desk import Desk
from dashboard.scene.panels import PAGES
from dashboard.scene.service import OWN_INPUTS, start
from dashboard.web.jobs import Jobs
from messages.contract import gyrofree_pb2 as pb
from messages.contract import topics as tp
from sessions.recording.mcap_log import read
from sessions.replay.rerun import write_session

axe_of = pytest.importorskip("axe_playwright_python.sync_playwright")
pytestmark = [pytest.mark.browser, pytest.mark.timeout(600)]

AGAIN = f"{SESSION}-again"
FOREIGN = {  # as a German spreadsheet saves a log
    "name": "fremd.csv",
    "mimeType": "text/csv",
    "buffer": b"Zeit [s];Acc X [g];Acc Y [g];Acc Z [g]\n"
    + b"".join(b"%d,0;0,01;0,02;1,00\n" % k for k in range(40)),
}
SIZES = {"desk": (1440, 900), "tablet": (1024, 768), "narrow": (768, 1024), "phone": (390, 844)}
# elements that hide a part of their own text; those that scroll are meant to
CLIPPED = """() => [...document.querySelectorAll('body *')].filter((e) => {
  const style = getComputedStyle(e), own = [...e.childNodes].some((n) => n.nodeType === 3 && n.data.trim());
  const hidden = style.visibility === 'hidden' || style.display === 'none' || !e.getClientRects().length;
  if (hidden || !own || e.closest('.hidden, [inert], [aria-hidden=true], details:not([open]) > :not(summary)') || style.display === 'inline') return false;
  if (e.closest('#webgl-software-rendering') || style.clipPath !== 'none') return false;
  return e.scrollWidth > e.clientWidth + 1 && !['auto', 'scroll'].includes(style.overflowX);
}).map((e) => `${e.tagName} ${e.id} ${e.className}: ${e.textContent.slice(0, 60)}`)"""  # noqa: E501

# elements of a plain page with text outside of the window, where nothing scrolls
OUTSIDE = """() => [...document.querySelectorAll('main *')].filter((e) => {
  if (![...e.childNodes].some((n) => n.nodeType === 3 && n.data.trim()) || !e.getClientRects().length) return false;
  for (let one = e; one; one = one.parentElement) {
    const style = getComputedStyle(one);
    if (['auto', 'scroll'].includes(style.overflowX) || style.clipPath !== 'none') return false;
  }
  const words = document.createRange();
  words.selectNodeContents(e);
  const { left, right } = words.getBoundingClientRect();
  return left < -1 || right > document.documentElement.clientWidth + 1;
}).map((e) => `${e.tagName} outside: ${e.textContent.slice(0, 60)}`)"""  # noqa: E501


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
def rounds():
    with Rounds.counted() as counted:
        yield counted


@pytest.fixture(scope="module")
def door(tmp_path_factory, rounds):
    store, desk = Store(), Desk(None, "gyrofree")
    handle = start(SimpleNamespace(viser_port=0), store, desk)
    folder = tmp_path_factory.mktemp("door")
    jobs = Jobs([sys.executable, "-m", "gyrofree"], [])  # there is an import, but none is made
    shutil.copytree(table_root() / SESSION, folder / "sessions" / SESSION)
    rows = ((row.log_ns, row.key, row.payload) for row in read(table_recording()))
    write_session(folder / "sessions", AGAIN, rows, "", {})
    try:
        with (
            fed(store),
            open_door(
                folder,
                scene=False,
                scene_at=handle.port,
                store=store,
                desk=desk,
                jobs=jobs,
                open_labels=OWN_INPUTS,
            ) as opened,
        ):
            yield opened
    finally:
        handle.stop()
        jobs.close()


@contextlib.contextmanager
def visit(chromium, door, user="otto", size="desk", scheme="dark", path="/"):
    """The live page of a person, its tabs there; what its console complained of."""
    width, height = SIZES[size]
    viewport = {"width": width, "height": height}
    with opened(chromium, door, user, path, viewport, color_scheme=scheme) as (page, said):
        page.locator("#rooms [aria-selected=true]").wait_for()
        yield page, said


def scene_of(page):
    return page.locator("#scene").element_handle().content_frame()


def resting_box(page, locator):
    """Where it is once it moves no more: panels take their width after the page is there."""
    box = None
    while box != (box := locator.bounding_box()):
        page.wait_for_timeout(500)
    return box


def turn_to(page, key, rounds):
    """Open a page of the view as a click on an alarm does, and wait until it is drawn."""
    page.evaluate("async (p) => (await import('/static/desk.js')).turnTo(p)", key)
    expect(page.locator("#pages [aria-selected=true]")).to_have_attribute("data-key", key)
    rounds.after(page)


def serious(where, rules=None):
    """The findings of axe-core that count; of all its rules, or of these."""
    only = {"runOnly": {"type": "rule", "values": rules}} if rules else None
    found = axe_of.Axe().run(where, options=only).response["violations"]
    return [
        (one["id"], [node["html"][:200] for node in one["nodes"]][:3])
        for one in found
        if one["impact"] in ("serious", "critical")
    ]


def looked_at(page, size, rules=None):
    """What is wrong with a plain page."""
    wide = page.evaluate("document.documentElement.scrollWidth") > SIZES[size][0]
    found = serious(page, rules) + page.evaluate(CLIPPED) + page.evaluate(OUTSIDE)
    return found + ["wider than the window"] * wide


@pytest.mark.parametrize("scheme, size", [("dark", "desk"), ("light", "phone")])
def test_no_page_of_the_scene_has_a_serious_finding_or_clipped_text(
    chromium, door, rounds, scheme, size
):
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
                turn_to(page, key, rounds)
                found = serious(scene, rules) + [page.evaluate(CLIPPED), scene.evaluate(CLIPPED)]
                found.append("</" in scene.evaluate("document.body.innerText"))  # tags as text
                wrong |= {(device, key): found} if any(found) else {}
        assert not wrong
        assert not said


@pytest.mark.parametrize("size", SIZES)
def test_no_width_clips_the_bars_or_the_summary(chromium, door, size):
    path = "/?w=navigate&p=map&device=car-01"  # its legend stands on what is left between panels
    with visit(chromium, door, size=size, path=path) as (page, _):
        scene_of(page).wait_for_selector(".gf-tile")
        clipped = [True]
        for _ in range(20):  # for the panels to fit
            page.wait_for_timeout(300)
            clipped = page.evaluate(CLIPPED) + scene_of(page).evaluate(CLIPPED)
            if not clipped:
                break
        assert not clipped
        assert page.evaluate("document.documentElement.scrollWidth") <= SIZES[size][0]
        assert page.evaluate("document.documentElement.scrollHeight") <= SIZES[size][1]
        if size != "phone":  # there panels lie over the map
            until(lambda: page.locator("#map").bounding_box()["width"] > 360, "room for the map")
        for part in ("#pause", "#window", "#note", "#mark", "#record"):
            box = page.locator(part).bounding_box()
            assert 0 <= box["x"] and box["x"] + box["width"] <= SIZES[size][0], part
            assert box["y"] + box["height"] <= SIZES[size][1], part


def test_the_plain_pages_have_no_serious_finding(chromium, door):
    plotted = "() => document.body.dataset.plotted === 'done'"
    for place, role in (("lab", "gateway"), ("lab", "recorder"), ("office", "dashboard")):
        beat = pb.Beat(role=role, session=role, devices=["cube"] * (role == "gateway"))
        door.front.store.presence.beat(place, f"{role}-1", beat)
    paths = {
        "/sessions": "main",
        f"/sessions/{SESSION}": plotted,
        f"/compare?ids={SESSION},{AGAIN}": plotted,
        "/trend": "main",
        "/users": "main",
        "/words": "main",
        "/places": "#places section",
        "/alarms": "main",
        "/account": "main",
        "/audit": "main",
        "/orders": "main",
        "/api/docs": "main",
        "/there/is/none": "main",
    }
    # a scheme changes only colours, and a size what is beside what
    of_looks = ["color-contrast", "target-size", "scrollable-region-focusable"]
    for scheme, size, rules in (("dark", "desk", None), ("light", "phone", of_looks)):
        viewport = dict(zip(("width", "height"), SIZES[size], strict=True))
        with opened(chromium, door, "anna", "/words", viewport, color_scheme=scheme) as (page, _):
            for path, there in paths.items():
                page.goto(door.url + path)
                (page.wait_for_function if "=>" in there else page.wait_for_selector)(there)
                fault = looked_at(page, size, rules)
                assert not fault, (path, fault)
            page.goto(door.url + "/sessions")
            page.click(".import summary")
            page.set_input_files("input[name=files]", FOREIGN)
            page.click("#import button")
            page.wait_for_selector("#import-preview td select >> visible=true")
            assert not looked_at(page, size, rules)
        with opened(chromium, door, "", "/login", viewport, color_scheme=scheme) as (page, _):
            page.fill("input[name=name]", "otto")
            page.fill("input[name=password]", "not this one")
            page.click("button >> text=Sign in")
            page.wait_for_selector(".fault")
            assert not looked_at(page, size, rules)


def at_rest(page, read):
    """The value of read() once it has been the same for half a second."""
    value, since = read(), 0
    while since < 5:
        page.wait_for_timeout(100)
        now = read()
        value, since = now, since + 1 if now == value else 0
    return value


def test_keys_work_wherever_the_focus_is_and_d_moves_no_camera(chromium, door):
    with visit(chromium, door) as (page, _):
        room = page.locator("#rooms [aria-selected=true]")
        page.keyboard.press("3")
        expect(room).to_have_text("Diagnose")
        page.locator("#scene").click()  # the focus goes into the frame
        camera = "() => window.__viserMutable.camera.position.toArray()"
        before = at_rest(page, lambda: scene_of(page).evaluate(camera))
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


def test_a_link_shows_another_person_the_same(chromium, door, rounds):
    with visit(chromium, door) as (page, _):
        page.select_option("#devices", "cube-01")
        turn_to(page, "nis", rounds)
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
        expect(alarm.locator("abbr", has_text="stuck")).to_have_attribute(
            "title", re.compile("same value")
        )
        alarm.click()
        expect(page.locator("#pages [aria-selected=true]")).to_have_text("Health")
        page.wait_for_timeout(2300)  # what the link asked for is not asked for again
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


CHARTS = """() => Object.values(window.__viserTestpoints?.uplots ?? {}).map(({ chart }) =>
  [chart.scales.x.min, chart.scales.x.max, ...chart.data.slice(0, 2).map((d) => [...d])])"""


def test_a_zoom_stays_while_data_come_in_until_one_follows_again(chromium, door):
    path = "/?p=rates&device=cube-01&window=10&layers=grid"
    with visit(chromium, door, path=path) as (page, said):
        scene = scene_of(page)
        scene.wait_for_function(f"() => ({CHARTS})().some(([a, b]) => b - a > 1)")
        scene.wait_for_selector(".uplot .gf-tools")  # until then it is uPlot that is dragged
        chart = scene.locator(".uplot .u-over").first
        box = resting_box(page, chart)
        y = box["y"] + box["height"] / 2
        page.mouse.move(box["x"] + 0.3 * box["width"], y)
        page.mouse.down()
        page.mouse.move(box["x"] + 0.6 * box["width"], y, steps=4)
        page.mouse.up()
        expect(page.locator("#zoomed")).to_contain_text("data keep coming in")
        zoom = page.evaluate("new URLSearchParams(location.search).get('zoom')")
        a, b = map(float, zoom.split("_"))
        device, utc0 = door.front.store.devices["cube-01"], UTC0_NS * 1e-9

        def is_zoomed():
            """The first chart shows the stretch of the link, from end to end."""
            low, high, x, _ = scene.evaluate(CHARTS)[0]
            near = 0.01 * (b - a)  # points stand at quarters of their buckets
            ends = abs(low - (a - utc0)) < near and abs(high - (b - utc0)) < near
            return ends and (low, high) == (x[0], x[-1])

        until(is_zoomed, "the stretch")
        before, newest = scene.evaluate(CHARTS), device.t_newest
        until(lambda: device.t_newest > newest + 2.0, "new data")
        page.wait_for_timeout(1500)  # three more updates of the charts
        assert scene.evaluate(CHARTS) == before
        page.locator("#zoomed button").click()
        expect(page.locator("#zoomed")).to_be_hidden()
        until(lambda: scene.evaluate(CHARTS)[0][1] > newest + 1.0, "the newest data")
        assert not said
