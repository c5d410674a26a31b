"""The page of alarms and its REST: who may what, what is refused, what is said without a bus."""

import time

import pytest
from support.front_door import open_door

from dashboard.data.store import Store
from dashboard.desk import Desk
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import ALARM

ORDERS = {
    "acknowledge": {"id": "axis-a21", "device": "cube"},
    "shelve": {"id": "axis-a21", "device": "cube", "seconds": 60.0},
    "unshelve": {"id": "axis-a21", "device": "cube"},
    "limits": {"name": "fast", "field": "omega_z", "above": 30.0},
    "limits/remove": {"name": "fast"},
    "test": {},
}


@pytest.fixture(scope="module")
def door(tmp_path_factory):
    desk = Desk(None, "gyrofree")
    with open_door(tmp_path_factory.mktemp("door"), scene=False, desk=desk) as opened:
        yield opened


def test_a_place_that_only_watches_sees_the_sites_alarms_and_why_no_orders(tmp_path):
    """It may ask no service: what is said to everybody is shown, and where it is not, that is."""
    store, desk = Store(), Desk(None, "lab", watching="office watches lab")
    one = pb.Alarm(id="axis-a21", device="cube", kind="axis", title="axis a21 stuck", level=2)
    one.state = pb.Alarm.STATE_UNACKNOWLEDGED
    with (
        open_door(tmp_path, scene=False, store=store, desk=desk) as door,
        door.client("vera") as viewer,
    ):
        silent = viewer.get("/api/alarms").json()
        assert silent["part"] and "not known now" in silent["trouble"] and not silent["alarms"]
        status = pb.AlarmStatus(header=pb.Header(utc_ns=time.time_ns()), alarms=[one])
        store.put(ALARM, "cube", "", status)
        seen = viewer.get("/api/alarms").json()
        assert not seen["trouble"] and [a["title"] for a in seen["alarms"]] == ["axis a21 stuck"]
        orders = viewer.get("/api/orders").json()
        assert orders["orders"] == [] and "office watches lab" in orders["message"]


@pytest.mark.parametrize("path", ORDERS)
def test_orders_take_an_operator_and_the_token_of_his_session(door, path):
    url, body = f"/api/alarms/{path}", ORDERS[path]
    with door.client("vera") as viewer:
        assert viewer.post(url, json=body).status_code == 403
    with door.client("otto") as operator:
        assert operator.post(url, json=body, headers={"x-csrf-token": "no"}).status_code == 403
        answer = operator.post(url, json=body)
        assert answer.status_code == 503 and "router" in answer.json()["error"]


@pytest.mark.parametrize(
    ("path", "body"),
    [
        ("shelve", {"id": "x", "seconds": 0}),
        ("shelve", {"id": "x", "seconds": 1e9}),
        ("acknowledge", {"id": ""}),
        ("acknowledge", {"id": "x", "note": "\u202e"}),
        ("acknowledge", {"id": "x", "nonsense": 1}),
        ("limits", {"name": "fast", "field": "omega_z", "above": "30"}),
        ("limits", {"name": "fast", "field": "x" * 300}),
    ],
)
def test_what_cannot_be_is_refused_before_it_is_an_order(door, path, body):
    with door.client("otto") as operator:
        assert operator.post(f"/api/alarms/{path}", json=body).status_code == 422


def test_a_viewer_sees_the_page_and_why_he_may_do_nothing(door):
    with door.client("vera") as viewer:
        page = viewer.get("/alarms").text
        assert "takes the role operator" in page and "<fieldset disabled" in page
        assert viewer.get("/api/alarms").status_code == 503
    with door.client("otto") as operator:
        page = operator.get("/alarms").text
        assert "<fieldset>" in page and "you look as viewer" not in page.split("<h2>Limits")[1]


def test_nobody_sees_alarms_without_signing_in(door):
    with door.client() as nobody:
        assert nobody.get("/api/alarms").status_code == 401
        assert nobody.get("/alarms", headers={"accept": "text/html"}).status_code == 303
