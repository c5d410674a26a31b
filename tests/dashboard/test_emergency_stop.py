"""The emergency stop of the pages: there while a table is driven, for operators, and never a "done"
that is not certain.
"""

import pytest
from support.front_door import open_door

from dashboard.data.alarms import alarms
from dashboard.data.store import Store
from messages.bus.orders import NoAnswer
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import PROCEDURE

M = pb.ProcedureStatus


def said(state=M.STATE_RUNNING, table="a table", instruction="") -> M:
    m = M(state=state, table=table, table_radps=1.5, instruction=instruction)
    m.header.device = "cube"
    return m


class Desk:
    """Takes orders, or nobody answers."""

    def __init__(self):
        self.given, self.reply = [], pb.Reply(ok=True, message="stopped")

    watching = ""

    def of(self, seat):
        self.seat = seat
        return self

    def procedure(self, command):
        self.given.append(command)
        if self.reply is None:
            raise NoAnswer("the procedures do not answer")
        return self.reply


@pytest.mark.parametrize(
    "message, driven",
    [
        (said(), True),
        (said(M.STATE_HELD), True),
        (said(M.STATE_DONE, instruction="done; the recording is being closed"), True),
        (said(M.STATE_DONE), False),
        (said(M.STATE_IDLE), False),
        (said(table=""), False),
    ],
)
def test_a_table_is_named_while_it_is_driven(tmp_path, message, driven):
    store = Store()
    store.put(PROCEDURE, "cube", "", message)
    with open_door(tmp_path, scene=False, store=store) as door, door.client("vera") as client:
        found = client.get("/api/tables").json()
    assert [one["table"] for one in found] == ["a table"] * driven


def test_operators_stop_and_others_are_told_why_not(tmp_path):
    desk = Desk()
    with open_door(tmp_path, scene=False, store=Store(), desk=desk) as door:
        with door.client("vera") as client:
            answer = client.post("/api/devices/cube/stop", json={})
            assert answer.status_code == 403 and "operator" in answer.json()["error"]
            assert "takes the role operator" in client.get("/sessions").text
        assert not desk.given
        with door.client("otto") as client:
            assert client.post("/api/devices/cube/stop", json={}).json() == {"message": "stopped"}
            given = desk.given[-1]
            assert (given.action, given.user) == (pb.ProcedureCommand.ACTION_STOP, "otto")
            desk.reply = pb.Reply(ok=False, message="THE TABLE DID NOT TAKE THE STOP")
            assert client.post("/api/devices/cube/stop", json={}).status_code == 503
            desk.reply = None
            answer = client.post("/api/devices/cube/stop", json={})
            assert answer.status_code == 503 and "MAY STILL TURN" in answer.json()["error"]


def test_a_table_that_is_left_alone_is_an_alarm():
    store = Store()
    store.put(PROCEDURE, "cube", "", said())
    device = store.device("cube")
    came = device.get("procedure").arrived
    assert "table" not in [one.kind for one in alarms(store, device, came + 1.0)]
    assert alarms(store, device, came + 4.0)[0].kind == "table"
