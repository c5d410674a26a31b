"""The wall display: who it lets in and for how long, what it says, and that nothing grows there."""

import contextlib
import json
import re
import threading
import time

import httpx
import pytest
from playwright.sync_api import expect
from support.front_door import open_door
from support.waiting import until

from dashboard.data.store import Store
from dashboard.web.wall import routes
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import ACCEL, ALARM, ATTITUDE, LINK, RATE


def rate(omega, sight=(0, 0, 0), sigma=0.01):
    m = pb.RateBatch(omega_ib_b_radps=omega, sight=sight, q_nb=[1, 0, 0, 0], period_s=0.01)
    m.omega_covariance.extend([sigma**2, 0, 0, 0, sigma**2, 0, 0, 0, sigma**2])
    m.header.utc_ns = time.time_ns()
    return m


def speaking(store, omega=(0.1, -0.2, 3.0), **more):
    now = time.time_ns()
    accel = pb.AccelBatch(axes=12, f_mps2=[0.0] * 12, period_s=0.01)
    link = pb.LinkStatus(connected=True, sample_rate_hz=100.0)
    for topic, message in ((ACCEL, accel), (LINK, link)):
        message.header.utc_ns = now
        message.header.source = pb.SOURCE_SIMULATED
        store.put(topic, "cube", "", message)
    store.put(RATE, "cube", "least-squares", rate(omega, **more))
    turned = pb.AttitudeEstimate(q_nb=[1, 0, 0, 0])
    turned.header.utc_ns = now
    store.put(ATTITUDE, "cube", "least-squares", turned)
    return store


@contextlib.contextmanager
def spoken(**more):
    """A store into which a board speaks until the block ends, or until it is told to be quiet."""
    store, quiet = speaking(Store(), **more), threading.Event()

    def speak():
        while not quiet.wait(0.02):
            speaking(store, **more)

    speaker = threading.Thread(target=speak)
    speaker.start()
    try:
        yield store, lambda: (quiet.set(), speaker.join())
    finally:
        quiet.set()
        speaker.join()


@pytest.fixture
def door(tmp_path):
    with spoken() as (store, _), open_door(tmp_path, scene=False, store=store) as served:
        yield served


def csrf_of(client):
    return client.headers["x-csrf-token"]


def link_of(door, admin, name="control room"):
    """The link of a new display, made by an admin on the page of users."""
    form = {"csrf": csrf_of(admin), "name": name, "days": "365"}
    page = admin.post("/users/walls", data=form)
    assert page.status_code == 200
    found = re.search(r'id="wall-link">([^<]+)<', page.text)
    assert found and name in page.text
    path, token = found[1].removeprefix(door.url).split("#")
    assert path == "/wall/open"
    return token


def display(door, token):
    client = httpx.Client(base_url=door.url, headers={"origin": door.url}, timeout=20.0)
    return client, client.post("/wall/open", json={"token": token})


def events(client, wanted, path="/wall/stream"):
    """The first event of each wanted name."""
    found, name = {}, ""
    with client.stream("GET", path) as answer:
        assert answer.status_code == 200
        for line in answer.iter_lines():
            name = line.removeprefix("event: ") if line.startswith("event: ") else name
            if line.startswith("data: "):
                found.setdefault(name, json.loads(line[6:]))
            if set(wanted) <= found.keys():
                return found
    raise AssertionError(f"it ended: {found}")


def test_a_display_looks_at_its_wall_and_at_nothing_else(door):
    with door.client("anna") as admin:
        token = link_of(door, admin)
    client, answer = display(door, token)
    with contextlib.closing(client):
        assert answer.status_code == 200 and token not in answer.text
        said = events(client, ("state", "pose"))
        assert said["state"]["device"] == "cube" and said["state"]["source"] == "simulated"
        assert [row["value"] for row in said["state"]["rows"]] == ["5.7", "−11.5", "171.9"]
        assert said["pose"]["q"] == [1, 0, 0, 0] and said["pose"]["age_s"] < 30.0
        for path in ("/api/devices", "/api/me", "/api/orders", "/map/tiles"):
            assert client.get(path).status_code in (401, 404), path
        assert client.get("/").status_code == 401
        assert client.post("/api/recording/start", json={}).status_code == 401
        bearer = {"authorization": f"Bearer {token}"}
        assert httpx.get(f"{door.url}/api/devices", headers=bearer).status_code == 401
        page = client.get("/wall").text
        assert not re.search(r"<(form|button|input|select|a)\b", page)


def test_it_is_not_ended_by_time_and_at_once_by_an_admin(door):
    with door.client("anna") as admin:
        client, _ = display(door, link_of(door, admin))
        with contextlib.closing(client):
            door.ahead += 30 * 86_400.0  # far beyond session_hours and idle_hours
            assert events(client, ("state",))["state"]["there"]
            door.ahead -= 30 * 86_400.0
            listed = admin.get("/users").text
            number = re.search(r'action="/users/walls">.*?name="revoke" value="(\w+)"', listed)
            began = time.monotonic()
            with client.stream("GET", "/wall/stream") as answer:
                lines = answer.iter_lines()
                next(lines)
                form = {"csrf": csrf_of(admin), "revoke": number[1]}
                assert admin.post("/users/walls", data=form).status_code == 200
                assert any(line == "event: end" for line in lines)
            assert time.monotonic() - began < 15.0
            refused = client.get("/wall/stream")
            assert refused.status_code == 401 and "an admin" in refused.json()["error"]
            assert client.get("/wall").status_code == 200  # the page is there to say so
    _, answer = display(door, "gyf_" + "x" * 43)
    assert answer.status_code == 403


def test_a_wall_that_looks_on_is_no_use_of_a_persons_sign_in(door):
    with door.client("vera") as client, client.stream("GET", "/wall/stream") as answer:
        lines = answer.iter_lines()
        next(lines)
        door.ahead += 2.01 * 3600  # idle_hours
        assert any(line == "event: end" for line in lines)
        assert client.get("/wall/stream").status_code == 401
    door.ahead = 0.0


def test_only_an_admin_makes_one_and_a_program_gets_in_nowhere_by_it(door):
    with door.client("otto") as client:
        form = {"csrf": csrf_of(client), "name": "mine", "days": "1"}
        assert client.post("/users/walls", data=form).status_code == 403


@pytest.mark.parametrize(
    "more, values, notes",
    [
        (
            {"sight": (0, 1, 2)},
            ["5.7", "±11.5", "–"],
            ["± 0.6 (1σ)", "± 0.6 (1σ) sign not known", "not known"],
        ),
        ({"sigma": 0.5}, ["6", "−11", "172"], ["± 29 (1σ)"] * 3),
    ],
)
def test_no_digit_is_shown_that_is_not_known(tmp_path, more, values, notes):
    with (
        spoken(**more) as (store, _),
        open_door(tmp_path, scene=False, store=store) as door,
        door.client("vera") as client,
    ):
        rows = events(client, ("state",))["state"]["rows"]
    assert [row["value"] for row in rows] == values
    assert [row["note"] for row in rows] == notes


def test_a_board_that_is_silent_is_old_although_alarms_speak_of_it(tmp_path):
    store = speaking(Store())
    for latest in store.devices["cube"].latest.values():
        latest.arrived -= 60.0
    status = pb.AlarmStatus()
    status.header.utc_ns = time.time_ns()
    store.put(ALARM, "cube", "", status)
    with open_door(tmp_path, scene=False, store=store) as door, door.client("vera") as client:
        said = events(client, ("state", "pose"))
    assert said["state"]["stale"] and not said["state"]["connected"]
    assert said["pose"]["q"] is None and said["pose"]["age_s"] > 59.0
    assert all(not row["known"] for row in said["state"]["rows"])


@pytest.mark.browser
def test_nothing_grows_on_a_wall_and_it_comes_back_by_itself(tmp_path, chromium, monkeypatch):
    monkeypatch.setattr(routes, "POSES_S", 0.002)
    monkeypatch.setattr(routes, "STATE_S", 0.002)
    with (
        spoken() as (store, quiet),
        open_door(tmp_path, scene=False, store=store) as door,
        door.client("anna") as admin,
    ):
        token = link_of(door, admin)
        page = chromium.new_page(viewport={"width": 1920, "height": 1080})
        page.goto(f"{door.url}/wall/open#{token}")
        page.wait_for_url(f"{door.url}/wall")
        page.wait_for_selector("body:not(.old)")
        page.wait_for_function("document.querySelector('#rows .value').textContent === '5.7'")
        tool = page.context.new_cdp_session(page)
        tool.send("Performance.enable")

        def measured():
            tool.send("HeapProfiler.collectGarbage")
            named = {m["name"]: m["value"] for m in tool.send("Performance.getMetrics")["metrics"]}
            return {k: named[k] for k in ("Nodes", "JSEventListeners", "JSHeapUsedSize")}

        page.evaluate("""() => { window.count = 0; const all = JSON.parse;
            JSON.parse = (text) => { window.count++; return all(text); }; }""")

        def driven(number):
            end = page.evaluate("window.count") + number
            until(lambda: page.evaluate("window.count") >= end, "updates", 60)
            return measured()

        driven(500)
        before = driven(500)
        after = driven(3000)
        assert after["Nodes"] <= before["Nodes"] + 20, (before, after)
        assert after["JSEventListeners"] <= before["JSEventListeners"] + 5
        assert after["JSHeapUsedSize"] < before["JSHeapUsedSize"] + 400_000, (before, after)
        quiet()
        # a silent board is said, and dimmed
        for latest in store.devices["cube"].latest.values():
            latest.arrived -= 60.0
        page.wait_for_selector("body.old")
        assert "NO DATA FOR 6" in page.locator("#banner").inner_text()
        page.close()


@pytest.mark.browser
def test_a_wall_survives_a_restart_and_takes_another_version_by_itself(
    tmp_path, chromium, monkeypatch
):
    """The server is gone and comes back, then comes back as another version that dies while the
    page loads: nobody touches the display.
    """
    first, second = "1" * 16, "2" * 16
    monkeypatch.setattr(routes, "BUILD", first)
    page = chromium.new_page(viewport={"width": 1920, "height": 1080})
    fresh, banner = page.locator("body:not(.old)"), page.locator("#banner")
    with spoken() as (store, _):
        with open_door(tmp_path, scene=False, store=store) as door, door.client("anna") as admin:
            page.goto(f"{door.url}/wall/open#{link_of(door, admin)}")
            page.wait_for_url(f"{door.url}/wall")
            fresh.wait_for()
            page.evaluate("window.mine = true")
        expect(banner).to_contain_text("NO DATA FOR", timeout=10_000)
        expect(fresh).to_have_count(0)
        with open_door(tmp_path, at=door.settings.port, scene=False, store=store):
            fresh.wait_for()
            assert page.evaluate("window.mine"), "it was loaded anew for no reason"
        expect(banner).to_be_visible()
        # the files of the next version do not come at first: its server dies as it begins
        page.route("**/static/wall/cube.js", lambda route: route.abort(), times=1)
        monkeypatch.setattr(routes, "BUILD", second)
        with open_door(tmp_path, at=door.settings.port, scene=False, store=store):
            page.locator(f"body[data-build='{second}']").wait_for()
            fresh.wait_for()
            assert page.evaluate("window.mine === undefined")
    page.close()
