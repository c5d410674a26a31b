"""The map: what a file of tiles must be, ranges of it, where a device is, and both in a real
browser.
"""

import contextlib
import hashlib
import io
import math
import re
import threading
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image
from playwright.sync_api import expect
from support import tiles
from support.browser import visit
from support.feeder import ORIGIN, Feeder
from support.front_door import open_door
from support.waiting import until

import dashboard
from dashboard.data.store import Store
from dashboard.data.whereabouts import Known, ellipse, whereabouts
from dashboard.desk import Desk
from dashboard.scene.service import OWN_INPUTS, start
from dashboard.web.map.archive import ArchiveError, open_archive
from dashboard.web.map.recorded import ways_of
from inertial.earth import ned_between, place_from_ned
from messages.contract import gyrofree_pb2 as pb
from messages.contract import topics as tp
from sessions.library.curves import Curves
from sessions.library.curves import Track as RecordedTrack

MAP = "/?w=navigate&p=map&device=car-01"
GROUND = (18, 20, 22)  # of the page, dark
VENDOR = Path(dashboard.__file__).parent / "web" / "static" / "vendor"


class Into:
    def __init__(self, store):
        self._store = store

    def put(self, topic, device, message, estimator=""):
        self._store.put(topic, device, estimator, message)


def driven(seconds: float) -> Store:
    store = Store()
    feeder = Feeder(Into(store))
    for k in range(round(seconds * 50)):
        feeder.drive(k * 0.02)
    return store


# --- the file


def test_a_sound_file_says_what_it_holds(tmp_path):
    for packed in (True, False):
        found = open_archive(tiles.vector(tmp_path / "lab.pmtiles", packed=packed))
        assert (found.kind, found.zooms, found.layers) == ("vector", (0, 0), ("water",))
        assert found.attribution == "Tiles of the test" and found.bounds[0] == -180.0
    assert open_archive(tiles.raster(tmp_path / "r.pmtiles", (9, 9, 9))).kind == "raster"


def test_a_file_that_cannot_be_used_is_said_in_a_sentence(tmp_path):
    whole = tiles.vector(tmp_path / "whole.pmtiles").read_bytes()
    root = tiles.HEADER.size
    for data, words in (
        (b"", "no PMTiles file"),
        (b"SQLite format 3" + bytes(200), "no PMTiles file"),
        (whole[:7] + b"\2" + whole[8:], "version 2"),
        (whole[:-1], "cut off"),
        (whole[:97] + b"\3" + whole[98:], "use gzip"),
        (whole[:99] + b"\0" + whole[100:], "kind 0"),
        (whole[:100] + b"\x1f" + whole[101:], "zooms 31 to 0"),
        (whole[: root + 12] + b"\xff\xff" + whole[root + 14 :], "first directory"),
    ):
        path = tmp_path / "broken.pmtiles"
        path.write_bytes(data)
        with pytest.raises(ArchiveError, match=words) as error:
            open_archive(path)
        assert "broken.pmtiles" in str(error.value) and str(tmp_path) not in str(error.value)
    for path in (tmp_path / "none.pmtiles", tmp_path):
        with pytest.raises(ArchiveError, match="is not there|is no file|cannot be read"):
            open_archive(path)


@settings(max_examples=150, deadline=None)
@given(st.data())
def test_any_change_of_a_file_is_sound_or_said(tmp_path_factory, data):
    path = tiles.vector(tmp_path_factory.mktemp("m") / "x.pmtiles")
    whole = bytearray(path.read_bytes())
    for _ in range(data.draw(st.integers(1, 6))):
        whole[data.draw(st.integers(0, len(whole) - 1))] = data.draw(st.integers(0, 255))
    path.write_bytes(whole[: data.draw(st.integers(0, len(whole)))])
    try:
        open_archive(path)
    except ArchiveError as error:
        assert "x.pmtiles" in str(error)


@pytest.fixture
def door(tmp_path):
    path = tiles.vector(tmp_path / "lab.pmtiles")
    with open_door(tmp_path, scene=False, store=driven(4.0), map=path) as opened:
        yield opened


def test_ranges_are_given_to_people_who_are_signed_in(door):
    path = door.settings.map
    whole, ask = path.read_bytes(), "/api/map/tiles"
    with door.client() as stranger:
        assert stranger.get(ask, headers={"range": "bytes=0-9"}).status_code == 401
        assert stranger.get("/api/map").status_code == 401
    with door.client("vera") as client:
        assert client.get("/api/map").json()["state"] == "ready"
        answer = client.get(ask, headers={"range": "bytes=3-9"})
        assert answer.status_code == 206 and answer.content == whole[3:10]
        assert answer.headers["content-range"] == f"bytes 3-9/{len(whole)}"
        tag = answer.headers["etag"]
        assert client.get(ask, headers={"range": "bytes=0-99999"}).content == whole
        again = {"range": "bytes=3-9", "if-none-match": f'"other", W/{tag}'}
        assert client.get(ask, headers=again).status_code == 304
        for wrong in (
            "",
            "bytes=9-3",
            "bytes=-5",
            "bytes=5-",
            "bytes=0-1,3-4",
            "lines=0-1",
            "bytes=0-1e9",
            f"bytes={len(whole)}-{len(whole)}",
            "bytes=0-" + "9" * 40,
        ):
            answer = client.get(ask, headers={"range": wrong} if wrong else {})
            assert answer.status_code == 416, wrong
            assert answer.headers["content-range"] == f"bytes */{len(whole)}"
        tiles.vector(path, packed=False)
        newer = client.get(ask, headers={"range": "bytes=0-9", "if-range": tag})
        assert newer.status_code == 412
        params = {"state": tag.strip('"')}  # what a browser has kept is of that state alone
        assert client.get(ask, params=params, headers={"range": "bytes=0-9"}).status_code == 412
        path.write_bytes(b"gone")
        said = client.get("/api/map").json()
        assert said["state"] == "fault" and "no PMTiles file" in said["text"]
        path.unlink()
        assert client.get(ask, headers={"range": "bytes=0-9"}).status_code == 503
        assert "is not there" in client.get("/api/map").json()["text"]


def test_what_is_vendored_is_what_the_notice_says():
    notice = (Path(dashboard.__file__).parents[1] / "NOTICE").read_text()
    said = re.findall(r"([0-9a-f]{64})  (\S+)", notice)
    assert len(said) == 3
    for digest, name in said:
        assert hashlib.sha256((VENDOR / name).read_bytes()).hexdigest() == digest
        assert (VENDOR / name).with_name("LICENSE").is_file()


# --- where a device is


def test_a_place_from_metres_is_the_inverse_of_metres_from_a_place():
    origin = (0.7, -1.9, 120.0)
    there = place_from_ned(origin, 830.0, -1400.0, 12.0)
    assert ned_between(origin, there) == pytest.approx((830.0, -1400.0, 12.0), abs=1e-6)


@given(st.floats(0.01, 1e4), st.floats(0.01, 1e4), st.floats(-math.pi, math.pi, allow_nan=False))
def test_the_ellipse_is_oriented_as_the_covariance(a, b, bearing):
    longer, shorter = max(a, b), min(a, b)
    c, s = math.cos(bearing), math.sin(bearing)
    turn = np.array([[c, -s], [s, c]])  # the first axis points to the bearing, north over east
    found = ellipse(turn @ np.diag([longer**2, shorter**2]) @ turn.T)
    assert found[:2] == pytest.approx((2 * longer, 2 * shorter), rel=1e-4)
    if longer > 1.01 * shorter:
        off = (found[2] - bearing + math.pi / 2) % math.pi - math.pi / 2
        assert abs(off) < 1e-4 * longer / (longer - shorter)


def test_a_recorded_way_has_the_accuracy_and_quality_that_were_said():
    points = np.column_stack([np.arange(4.0), 10.0 * np.arange(4.0), np.zeros(4), np.zeros(4)])
    told = np.array([[np.nan] * 3 + [4.0], [4.0, 0, 1, 4], [1, 0, 9, 3], [-1, 0, 1, 99]])
    place = (math.radians(ORIGIN[0]), math.radians(ORIGIN[1]), ORIGIN[2])
    track = RecordedTrack("car/gnss", points, place, told)
    [way] = ways_of(Curves("a", 0, 3.0, 1.0, tracks={track.key: track}))
    assert way["ellipse"][0] is None and way["ellipse"][3] is None
    assert way["ellipse"][1] == pytest.approx([4.0, 2.0, 0.0])
    assert way["ellipse"][2] == pytest.approx([6.0, 2.0, math.pi / 2], rel=1e-3)
    words = [pb.GnssFix.Quality.Name(int(k)) for k in told[:3, 3]]
    assert [f"QUALITY_{one.upper().replace(' ', '_')}" for one in way["quality"][:3]] == words
    assert way["quality"][3] == "none"


@pytest.mark.parametrize("wrong", [np.full((2, 2), np.nan), np.zeros((2, 2)), -np.eye(2)])
def test_what_is_no_covariance_is_no_ellipse(wrong):
    assert ellipse(wrong) is None


def test_a_way_comes_once_and_then_what_grew(door):
    store = door.front.store
    with door.client("vera") as client:
        first = client.get("/api/devices/car-01/map").json()
        [way] = [one for one in first["ways"] if one["name"] == "ekf"]
        assert len(way["latitude_deg"]) > 20 and way["from"] == 0
        assert way["latitude_deg"][0] == pytest.approx(ORIGIN[0], abs=1e-3)
        assert set(first["fixes"]["quality"]) == {"RTK fixed"}
        have = f"ekf:{way['state']}:{len(way['latitude_deg'])}"
        ask = {"have": have, "since": first["fixes"]["t"][-1]}
        second = client.get("/api/devices/car-01/map", params=ask).json()
        assert not second["ways"][0]["latitude_deg"] and not second["fixes"]["t"]
        assert second["ways"][0]["from"] == len(way["latitude_deg"])
        feeder = Feeder(Into(store))
        for k in range(400):
            feeder.drive(k * 0.02)
        third = client.get("/api/devices/car-01/map", params=ask).json()["ways"][0]
        assert third["latitude_deg"]
        for wrong in ("ekf", "ekf:x:-1", "ekf:x:1e3"):
            answer = client.get("/api/devices/car-01/map", params={"have": wrong})
            assert answer.status_code == 422
        assert client.get("/api/devices/none/map").status_code == 404


def solution(store, **fields):
    m = pb.NavSolution()
    m.CopyFrom(store.device("car-01").get("nav", "ekf").message)
    for name, value in fields.items():
        if isinstance(value, list):
            del getattr(m, name)[:]
            getattr(m, name).extend(value)
        else:
            setattr(m, name, value)
    store.put(tp.NAV, "car-01", "ekf", m)
    return whereabouts(store.device("car-01"), {}, 0.0)["ways"][0]["now"]


def test_what_is_not_known_says_why():
    store = driven(3.0)
    known = solution(store)
    assert known["ellipse"] and known["heading_rad"] is not None and not known["why"]
    waits = solution(store, mode=pb.NavSolution.MODE_COURSE, alignment="drive faster")
    assert waits["latitude_deg"] is None and waits["why"] == "drive faster"
    navigating = pb.NavSolution.MODE_NAVIGATING
    bare = solution(store, mode=navigating, position_covariance=[])
    assert bare["ellipse"] is None and "how certain" in bare["why"]
    lost = solution(store, position_covariance=[1e12, 0, 0, 0, 1e12, 0, 0, 0, 1e12])
    assert lost["latitude_deg"] is None and "uncertain" in lost["why"]
    blind = solution(store, position_covariance=list(np.eye(3).ravel()), sigma=[3.0] * 15)
    assert blind["heading_rad"] is None and "heading" in blind["why"]
    fix = pb.GnssFix(header=pb.Header(device="car-01", utc_ns=1_750_000_010_000_000_000))
    fix.latitude_deg = fix.longitude_deg = math.nan
    store.put(tp.GNSS, "car-01", "", fix)
    told = whereabouts(store.device("car-01"), {"ekf": Known("x", 5)}, 0.0)
    assert "no satellite fix" in told["receiver"]["why"]


# --- in a real browser


@contextlib.contextmanager
def live(folder, path):
    """A live page that a car goes on driving for."""
    store, desk, ended = Store(), Desk(None, "gyrofree"), threading.Event()
    feeder = Feeder(Into(store))

    def drive():
        k = 0
        while not ended.wait(0.02):
            feeder.drive(k * 0.02)
            k += 1

    handle, thread = (
        start(SimpleNamespace(viser_port=0), store, desk),
        threading.Thread(target=drive),
    )
    services = {"store": store, "desk": desk, "open_labels": OWN_INPUTS}
    thread.start()
    try:
        with open_door(folder, scene=False, scene_at=handle.port, map=path, **services) as door:
            yield door
    finally:
        ended.set()
        thread.join()
        handle.stop()


def serious(page, where):
    """What axe-core finds that counts."""
    axe = pytest.importorskip("axe_playwright_python.sync_playwright").Axe()
    found = axe.run(page, context=where).response["violations"]
    return [one["id"] for one in found if one["impact"] in ("serious", "critical")]


def colour_at(page, x, y):
    """The tiles' colour at a point of the page: a byte each of red, green, blue."""
    box = page.locator("#map").bounding_box()
    clip = {"x": box["x"] + x, "y": box["y"] + y, "width": 1, "height": 1}
    page.evaluate("document.querySelector('.map-canvas').style.visibility = 'hidden'")
    shot = Image.open(io.BytesIO(page.screenshot(clip=clip))).convert("RGB").getpixel((0, 0))
    page.evaluate("document.querySelector('.map-canvas').style.visibility = ''")
    return shot


NO_WEBGL = """const asked = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, ...more) {
  return kind.startsWith('webgl') ? null : asked.call(this, kind, ...more); };"""
DRAWN = """() => { const c = document.querySelector('.map-canvas'), seen = new Set();
  const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;
  for (let k = 0; k < d.length; k += 4) if (d[k + 3] > 250) seen.add(d.slice(k, k + 3).join());
  return [...seen]; }"""


@pytest.mark.browser
@pytest.mark.timeout(300)
def test_the_map_in_a_browser_with_vector_tiles_raster_tiles_and_none(tmp_path, chromium):
    """One visit: nobody else is asked, nothing is against the policy, axe finds nothing."""
    path = tiles.vector(tmp_path / "lab.pmtiles")
    with live(tmp_path, path) as door, visit(chromium, door) as (page, said):
        others = []
        page.on("request", lambda r: elsewhere(r.url, door) and others.append(r.url))
        page.goto(door.url + MAP)
        _vector(page)
        tiles.raster(path, (200, 40, 40))
        page.goto(door.url + MAP)
        page.locator("#map[data-tiles=raster]").wait_for()
        until(lambda: (at := colour_at(page, 30, 400))[0] > at[1] + 60, "raster tiles")
        path.unlink()
        page.goto(door.url + MAP)
        page.locator(".map-note", has_text="is not there").wait_for()
        until(lambda: "50,150,216" in page.evaluate(DRAWN), "a way on the grid")
        loaded = page.evaluate("performance.getEntriesByType('resource').map((r) => r.name)")
        assert not any("maplibre" in name for name in loaded)
        # without WebGL there is no scene: the page says why, and the way is drawn all the same
        page.add_init_script(NO_WEBGL)
        page.goto(door.url + "/")
        expect(page.locator("#plain")).to_contain_text("This browser has no WebGL")
        expect(page.locator("#plain dl")).to_contain_text("speed, km/h")
        expect(page.locator("#pages [aria-selected=true]")).to_have_text("Map")
        page.locator(".map-canvas").wait_for()
        until(lambda: "50,150,216" in page.evaluate(DRAWN), "a way without WebGL")
        assert not serious(page, "#stage")
        assert not others and not said


def elsewhere(url, door):
    """Does that ask anybody else?"""
    return url.startswith(("http", "ws")) and door.url not in url


def _vector(page):
    page.locator("#map[data-tiles=vector]").wait_for()
    page.locator(".map-legend li", has_text="INS/GNSS filter").wait_for()
    until(lambda: (at := colour_at(page, 30, 400)) != GROUND and at[2] > at[0] + 15, "tiles")
    text = page.locator(".map-legend").inner_text()
    assert "(2σ)" in text and "heading" in text and "RTK fixed, 14 satellites" in text
    assert page.locator(".map-scale").inner_text().split()[1] in ("m", "cm", "km")
    assert page.locator(".map-credit").inner_text() == "Tiles of the test"
    assert not serious(page, "#map"), serious(page, "#map")
    # following, the leading filter stays in the middle; a move by hand ends that
    follow = page.locator(".map-tools button", has_text="Follow")
    assert follow.get_attribute("aria-pressed") == "true"
    page.locator(".map-board").focus()
    page.keyboard.press("ArrowLeft")
    expect(follow).to_have_attribute("aria-pressed", "false")
    page.locator("#pages [data-key=sky]").click()
    expect(page.locator("#map")).to_be_hidden()
    scene = page.locator("#scene").element_handle().content_frame()
    expect(scene.get_by_text("12 satellites in view, 10 used")).to_be_visible()
