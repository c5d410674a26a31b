"""Workspaces, links, alarms and rights of the live page: what is offered, what is said, who may."""

import contextlib
import json
import re
import time
from types import SimpleNamespace
from urllib.parse import urlencode

import msgspec
import numpy as np
import pytest
import viser
from hypothesis import given
from hypothesis import strategies as st
from support.feeder import Feeder
from support.front_door import open_door

from dashboard.data.alarms import alarms, bench_alarms
from dashboard.data.store import Store
from dashboard.desk import Desk
from dashboard.scene.drawing.labels import free, pixels
from dashboard.scene.panels import PAGES
from dashboard.scene.panels.base import Snapshot
from dashboard.scene.panels.device.devices import state_of
from dashboard.scene.panels.motion.innovations import verdict
from dashboard.scene.view import KEYS, View
from dashboard.scene.workspaces import LAYERS, WORKSPACES, Wish, offered
from dashboard.web.auth import Role
from dashboard.web.frame.scene_messages import ROLE, Widgets, may_send
from dashboard.web.pages import own_path
from dashboard.web.views import Views
from inertial.rate.batch import Phase
from logs.figures.words import glossary_link, words_of
from messages.contract import gyrofree_pb2 as pb
from messages.contract import topics as tp

UTC = 1_750_000_003_000_000_000
ORDER = "products-ekf"


class Into:
    """Publishers that put into a store."""

    def __init__(self, store):
        self._store = store

    def put(self, topic, device, message, estimator=""):
        self._store.put(topic, device, estimator, message)


@pytest.fixture
def store():
    filled = Store()
    feeder = Feeder(Into(filled))
    for k in range(100):
        feeder.cube(k * 0.01)
        feeder.drive(k * 0.01)
    return filled


@pytest.fixture
def view(store):
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    client = SimpleNamespace(
        gui=server.gui, scene=server.scene, camera=None, atomic=contextlib.nullcontext
    )
    yield View(client, store, Desk(None, "gyrofree"))
    server.stop()


def state(view):
    text = re.search(r'data-state="([^"]*)"', view._state.content)[1]
    return json.loads(text.replace("&#34;", '"').replace("&quot;", '"').replace("&amp;", "&"))


# --- what is offered


def test_every_page_is_in_one_workspace_and_has_a_key_of_its_own():
    assert {page.workspace for page in PAGES} <= {room.key for room in WORKSPACES}
    assert len(set(KEYS)) == len(PAGES) and all(re.fullmatch(r"[a-z0-9-]+", key) for key in KEYS)


def test_the_kind_of_a_device_decides_what_is_offered_and_what_is_not_says_why(store):
    def of(device):
        rooms = offered(PAGES, store.device(device))
        there = {page["key"] for room in rooms for page in room["pages"]}
        return there, {one["title"]: one["why"] for room in rooms for one in room["absent"]}

    cube, why_cube = of("cube-01")
    car, why_car = of("car-01")
    assert {"rates", "axes", "calibrate"} <= cube and not {"map", "wiring", "tilt"} & cube
    assert {"map", "wiring", "position"} <= car and not {"calibrate", "race"} & car
    assert "no gyroscopes" in why_cube["Tilt"] and "accelerometers alone" in why_car["Calibrate"]
    assert all(why_cube.values()) and all(why_car.values())


def test_a_page_that_is_offered_shows_something(view, store):
    """No page that is offered says that there is nothing."""
    for device in ("cube-01", "car-01"):
        view._wanted = device
        view.tick_panels()
        for room in offered(PAGES, store.device(device)):
            for page in room["pages"]:
                view._asked(Wish.of(f"p={page['key']}"))
                view.tick_panels()
                assert state(view)["missing"] == "" and state(view)["page"] == page["key"]
                for words in said(view):
                    text = re.sub('<span class="gf-channel">[^<]*<', "<", words)  # of channels
                    there = words_of([re.sub("<[^>]*>", " ", text)])
                    assert all(f'href="{glossary_link(word)}"' in words for word in there), words


def said(view):
    """The HTML of the page that is open, and of the summary at its left."""
    page = view._pages[view._page]
    handles = [*vars(page).values(), *(chart._heading for chart in page._charts.values())]
    handles += vars(view._devices).values()
    return [one.content for one in handles if isinstance(one, viser.GuiHtmlHandle)]


# --- what a link asks


def test_a_link_turns_to_device_page_window_and_layers(view):
    view._asked(Wish.of("w=diagnose&p=axes&device=car-01&window=60&layers=truth.grid&dark=0"))
    view.tick_panels()
    now = state(view)
    assert (now["workspace"], now["page"], now["device"]) == ("diagnose", "axes", "car-01")
    assert (now["window"], now["layers"], now["dark"]) == ("60", ["truth", "grid"], False)
    view._asked(Wish.of("pause=1"))
    assert state(view)["paused"]
    view._asked(Wish.of("pause=0&w=navigate"))
    assert not state(view)["paused"] and state(view)["workspace"] == "navigate"
    view._asked(Wish.of("w=diagnose"))
    assert state(view)["page"] == "axes", "the page that was open there before"


def test_a_device_of_a_link_is_waited_for(view, store):
    view._asked(Wish.of("device=late-01"))
    view.tick_panels()
    assert state(view)["device"] in ("cube-01", "car-01")
    Feeder(Into(store)).cube(2.0, device="late-01")
    view.tick_panels()
    assert state(view)["device"] == "late-01"


@given(st.text(max_size=300))
def test_no_line_is_too_strange_to_be_asked(line):
    wish = Wish.of(line)
    assert wish.layers is None or wish.layers <= set(LAYERS)


@given(st.text(max_size=80), st.sampled_from(["/", "//", "/\\", "http://", "/sessions?q=", ""]))
def test_sign_in_goes_to_pages_of_this_dashboard_only(tail, head):
    path = own_path(head + tail)
    assert path.startswith("/") and not path.startswith(("//", "/\\", "/login", "/scene", "/api"))
    assert not re.search(r"[\s\\]|[^\x20-\x7e]", path)


def test_sign_in_returns_to_the_link_that_was_asked_for(tmp_path):
    asked = "/?w=diagnose&p=nis&device=cube-01"
    with open_door(tmp_path, scene=False) as door, door.client() as client:
        sent = client.get(asked, headers={"accept": "text/html"})
        assert sent.headers["location"] == "/login?" + urlencode({"next": asked})
        page = client.get(sent.headers["location"]).text
        assert 'name="next" value="/?w=diagnose&amp;p=nis&amp;device=cube-01"' in page
        evil = client.get("/login?next=//evil.example").text
        assert 'name="next" value="/"' in evil


# --- kept per user


def test_a_view_is_kept_per_user_over_a_restart(tmp_path):
    with open_door(tmp_path, scene=False) as door:
        with door.client("vera") as client:
            assert client.post("/api/me/view", json={"view": "w=watch&p=race"}).status_code == 200
            assert 'data-view="w=watch&amp;p=race"' in client.get("/").text
            assert client.post("/api/me/view", json={"view": 'x="><b>'}).status_code == 422
        with door.client("otto") as client:
            assert client.get("/api/me/view").json() == {"view": ""}
        kept = door.settings.users.with_name(door.settings.users.name + ".views")
    assert Views(kept).of("vera") == "w=watch&p=race"
    kept.write_text("[1")
    assert Views(kept).of("vera") == ""


def test_a_note_is_for_operators_and_wants_words(tmp_path, store):
    with open_door(tmp_path, scene=False, store=store, desk=Desk(None, "gyrofree")) as door:
        path = "/api/devices/cube-01/notes"
        with door.client("vera") as client:
            assert client.post(path, json={"text": "seen"}).status_code == 403
        with door.client("otto") as client:
            assert client.post(path, json={"text": "  "}).status_code == 422
            assert client.post("/api/devices/nobody/notes", json={"mark": True}).status_code == 404
            answer = client.post(path, json={"mark": True})
            assert answer.status_code == 503 and "no router" in answer.json()["error"]


def test_the_time_of_a_mark_is_the_recordings(store):
    assert store.recorded_s("cube-01") is None
    now = time.monotonic()
    status = pb.RecorderStatus(recording=True, seconds=12.0)
    store.put(tp.STATUS, "recorder", "", status, arrived=now - 0.5)
    assert store.recorded_s("cube-01", now) == pytest.approx(12.5)


# --- alarms


def health(**of_first):
    axes = [pb.AxisHealth.Axis(name=f"a{k}", state=pb.AxisHealth.STATE_GOOD) for k in range(12)]
    for name, value in of_first.items():
        setattr(axes[0], name, value)
    return pb.AxisHealth(header=pb.Header(utc_ns=UTC), axes=axes)


def kinds(store, device="cube-01"):
    return {alarm.kind for alarm in alarms(store, store.device(device))}


def test_what_is_wrong_is_an_alarm_with_a_reason_and_a_page_that_exists(store):
    before = kinds(store)
    put = store.put
    put(tp.AXES, "cube-01", "", health(state=pb.AxisHealth.STATE_STUCK, excluded=True))
    gone = pb.LinkStatus(header=pb.Header(utc_ns=UTC), connected=False, bytes_in=1)
    put(tp.LINK, "cube-01", "", gone)
    fault = pb.Fault(name="reboot", text="the board restarted", active=False)
    put(tp.BOARD, "cube-01", "", pb.BoardInfo(header=pb.Header(utc_ns=UTC), faults=[fault]))
    late = pb.EstimatorStatus(header=pb.Header(utc_ns=UTC), state="turning", behind_s=9.0)
    put(tp.ESTIMATOR, "cube-01", ORDER, late)
    assert {"axis", "link", "board", "late"} <= kinds(store) - before
    sparse = pb.EstimatorStatus(
        header=pb.Header(utc_ns=UTC), limit_hz=5.0, skipped_s=12.0, trouble="cannot be saved"
    )
    put(tp.ESTIMATOR, "cube-01", ORDER, sparse)
    texts = [alarm.text for alarm in alarms(store, store.device("cube-01"))]
    assert "cannot be saved" in texts
    assert any("at most 5 estimates a second" in t and "12 s were passed over" in t for t in texts)
    for alarm in alarms(store, store.device("cube-01")):
        assert alarm.title and alarm.text and alarm.page in KEYS
    full = pb.RecorderStatus(recording=False, message="No space left on device: free some")
    put(tp.STATUS, "recorder", "", full)
    assert [alarm.title for alarm in bench_alarms(store)] == ["disk full"]


def test_a_board_that_is_not_there_is_a_fault_once_it_had_time_to_come(store):
    never = pb.LinkStatus(header=pb.Header(utc_ns=UTC), connected=False)
    store.put(tp.LINK, "cube-01", "", never)
    device = store.device("cube-01")
    device.born = time.monotonic()
    assert "link" not in kinds(store)
    device.born -= 60.0
    assert "link" in kinds(store)


def test_an_axis_that_is_only_looked_into_is_no_alarm(store):
    store.put(tp.AXES, "cube-01", "", health(state=pb.AxisHealth.STATE_SUSPECT))
    assert "axis" not in kinds(store)


@pytest.mark.parametrize("phase", Phase)
@pytest.mark.parametrize("still", [True, False])
def test_no_table_says_still_beside_a_rate(store, phase, still):
    """The status comes once a second, the samples a hundred times: the newer word counts."""
    batch = pb.RateBatch(
        header=pb.Header(utc_ns=UTC),
        estimator=ORDER,
        omega_ib_b_radps=[0.0, 0.0, 0.0 if still else 1.0],
        omega_covariance=np.eye(3).ravel(),
        sight=[pb.RateEstimate.SIGHT_VALID] * 3,
        still=[still],
    )
    store.put(tp.RATE, "cube-01", ORDER, batch)
    status = pb.EstimatorStatus(header=pb.Header(utc_ns=UTC), state=phase.text)
    store.put(tp.ESTIMATOR, "cube-01", ORDER, status)
    shown = Snapshot(store, store.device("cube-01"), 0.0, 1.0, time.monotonic(), True)
    assert still or "still" not in state_of(shown, ORDER).replace("keep still", "")


@pytest.mark.parametrize("sight", pb.RateEstimate.Sight.values())
@pytest.mark.parametrize("still", [True, False])
@pytest.mark.parametrize("state", ["turning", "finding biases: keep still"])
@pytest.mark.parametrize("omega", [0.0, 0.25])
def test_no_number_is_shown_where_none_is_known(view, store, sight, still, state, omega):
    """Whatever a filter says: a tile has a dash where it waits or is blind, and never says still
    beside a rate.
    """
    batch = pb.RateBatch(
        header=pb.Header(utc_ns=UTC),
        estimator=ORDER,
        omega_ib_b_radps=[0.0, 0.0, omega],
        omega_covariance=np.eye(3).ravel(),
        q_nb=[1, 0, 0, 0],
        sight=[sight] * 3,
        still=[still],
        angle_z_rad=[0.0],
    )
    store.put(tp.RATE, "cube-01", ORDER, batch)
    status = pb.EstimatorStatus(header=pb.Header(utc_ns=UTC), state=state)
    store.put(tp.ESTIMATOR, "cube-01", ORDER, status)
    view._wanted = "cube-01"
    view.tick_panels()
    tile = re.search(r"<span>products filter</span><b>(.*?)</b>.*?<small>(.*?)</small>", html(view))
    value, said = tile[1], re.sub("<.*?>", "", tile[2])
    if state != "turning":
        assert value == "–" and "keep still" in said
    elif sight == pb.RateEstimate.SIGHT_BLIND and not still:
        assert value == "–" and said.startswith("blind")
    elif omega:
        assert said != "still"


def html(view):
    return view._devices._table.content


# --- rights


def test_a_viewer_sees_orders_disabled_and_why(view, store):
    replay = pb.ReplayStatus(header=pb.Header(utc_ns=UTC), session="s", length_s=5.0, speed=1.0)
    store.put(tp.REPLAY, "replay", "", replay)
    view.tick_panels()
    mine = [handle for handle in view.orders if handle is not view._role]
    groups = [one for one in mine if isinstance(one, viser.GuiButtonGroupHandle)]
    others = [one for one in mine if one not in groups]
    assert groups and all(one.visible for one in groups)
    assert not any(handle.disabled for handle in others)
    view._role.value = "viewer"
    assert all(handle.disabled for handle in others)
    assert not any(one.visible for one in groups), "they cannot be greyed"
    view._asked(Wish.of("p=board&do=play"))
    view.tick_panels()
    assert view._rights.visible and "role operator" in view._rights.content
    assert "role operator" in view._timeline._state.content
    view._role.value = "operator otto"
    assert {page.user for page in view._pages} == {"otto"}
    assert not any(handle.disabled for handle in others) and not view._rights.visible
    assert all(one.visible for one in groups)


@pytest.mark.parametrize("role, may", [("", 0), ("viewer", 0), ("operator", 1), ("admin", 1)])
def test_the_keys_of_a_replay_are_orders(view, role, may):
    asked = []
    view._timeline._press = asked.append
    view._role.value = role
    view._asked(Wish.of("do=play"))
    assert len(asked) == may


def test_nobody_tells_the_scene_another_role():
    widgets = Widgets(["Show"])
    made = SimpleNamespace(type="GuiTextMessage", props=packed({"label": ROLE}))
    widgets._learn(made, "r")
    update = {"type": "GuiUpdateMessage", "uuid": "r", "updates": {"value": "admin"}}
    assert widgets.role == "r" and "r" not in widgets.open
    assert not any(may_send(role, "GuiUpdateMessage", update, widgets) for role in Role)


def packed(value):
    return msgspec.Raw(msgspec.msgpack.encode(value))


# --- drawing


@given(
    st.lists(
        st.tuples(*[st.floats(-300, 300)] * 2, st.floats(4, 60), st.floats(4, 20)), max_size=25
    )
)
def test_labels_that_are_shown_never_lie_on_each_other(given_boxes):
    table = np.array(given_boxes).reshape(-1, 4)
    places, halves = table[:, :2], table[:, 2:]
    shown = np.nonzero(free(places, halves))[0]
    for k, i in enumerate(shown):
        for j in shown[:k]:
            assert (np.abs(places[i] - places[j]) > halves[i] + halves[j]).any()
    assert not len(table) or shown[0] == 0, "the first is always shown"


def test_a_point_right_of_the_middle_is_right_in_the_picture():
    camera = SimpleNamespace(
        image_height=600,
        fov=np.pi / 2,
        position=(0.0, -10.0, 0.0),
        look_at=(0.0, 0.0, 0.0),
        up_direction=(0.0, 0.0, 1.0),
    )
    x, y = pixels(camera, np.array([[1.0, 0.0, 2.0]]))[0]
    assert (x, y) == pytest.approx((30.0, -60.0))


@pytest.mark.parametrize(
    "scale, word", [(0.2, "too careful"), (1.0, "honest"), (4.0, "too sure of itself")]
)
def test_nis_has_its_verdict(scale, word):
    nis = scale * np.random.default_rng(1).chisquare(6, 400)
    assert word in verdict(nis, 6)
    assert "too few" in verdict(nis[:5], 6)
