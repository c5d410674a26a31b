"""Hostile requests and messages: no fault of the server, and a viewer changes nothing."""

import contextlib
import random
import shutil

import msgspec
import pytest
import viser._messages
from support.front_door import CAMERA, Door, message, open_door
from support.table_session import SESSION, table_root
from support.waiting import until
from support.web_fuzz import fuzz

from dashboard.data.store import Store
from dashboard.web.frame.scene_messages import OPERATOR_MAY
from messages.contract.topics import RATE
from tests.dashboard.test_live_api import rate

KNOWN = {"session": [SESSION], "device": ["cube"], "form": ["html"], "number": ["1"]}


def test_no_request_is_a_fault_of_the_server(tmp_path, caplog):
    shutil.copytree(table_root(), tmp_path / "sessions")
    store = Store()
    store.put(RATE, "cube", "products-ekf", rate(1))
    with open_door(tmp_path, scene=False, store=store, free_attempts=100) as door:
        run = fuzz(door, "anna", KNOWN, 2)
        with door.client("otto") as client:
            assert client.get("/api/me").status_code == 200
    assert not run.faults, "\n".join(run.faults[:5])
    assert run.codes[200] > 20 and run.codes[422] > 50 and run.codes.total() > 300, run.codes
    assert not [record for record in caplog.records if record.exc_info]


class Changes:
    """Whatever a browser can change in a scene, and what was changed."""

    def __init__(self, door: Door) -> None:
        gui, scene = door.viser.gui, door.viser.scene
        self.calls: list[str] = []
        self.inputs = [
            gui.add_checkbox("box", False),
            gui.add_slider("slider", 0.0, 10.0, 0.5, 5.0),
            gui.add_text("text", "as it was"),
            gui.add_dropdown("choice", ("a", "b", "c")),
            gui.add_button("button"),
            gui.add_button_group("group", ("x", "y")),
        ]
        self.turn = scene.add_transform_controls("/turn")
        for one in self.inputs[:4]:
            one.on_update(lambda _: self.calls.append("update"))
        for one in self.inputs[4:]:
            one.on_click(lambda _: self.calls.append("click"))
        self.turn.on_update(lambda _: self.calls.append("turned"))
        self.uuids = [one._impl.uuid for one in self.inputs]

    def state(self) -> tuple:
        values = [(one.label, one.disabled, one.visible, one.value) for one in self.inputs[:4]]
        return values, tuple(self.turn.position), tuple(self.turn.wxyz), self.calls.copy()


def junk(rng: random.Random, changes: Changes) -> bytes:
    """A message of viser's, or of nobody's, with values that mean something to the scene."""
    kinds = [*viser._messages.Message.get_subclasses(), None]
    kind = rng.choice(kinds)
    name = rng.choice(list(OPERATOR_MAY)) if kind is None or rng.random() < 0.5 else kind.__name__
    value = lambda: rng.choice(  # noqa: E731
        [
            None,
            True,
            rng.random() * 10,
            float("nan"),
            -(2**40),
            "b",
            "/turn",
            "x" * rng.randrange(400),
            [1.0, 0.0, 0.0, 0.0],
            [rng.random()] * 3,
            {"value": rng.choice([True, "b", 7.5])},
            {"disabled": True, "label": "mine", "visible": False},
            rng.choice(changes.uuids),
        ]
    )
    wanted = OPERATOR_MAY.get(name, dict.fromkeys(("name", "uuid", "value", "wxyz", "props")))
    fields = CAMERA.copy() if name == "ViewerCameraMessage" else {key: value() for key in wanted}
    if "uuid" in fields:
        fields["uuid"] = rng.choice(changes.uuids)
    if name in ("TransformControlsUpdateMessage", "TransformControlsDragStartMessage"):
        fields["name"] = "/turn"
    for _ in range(rng.randrange(3)):
        if fields and rng.random() < 0.5:
            fields.pop(rng.choice(list(fields)))
        fields[rng.choice(["extra", "uuid", "updates", "name", "position", "type_"])] = value()
    return msgspec.msgpack.encode(fields | {"type": name})


def arrived(door: Door) -> bool:
    """The camera of a browser is where its last message says."""
    browsers = door.viser.get_clients().values()
    return any(tuple(one.camera.position) == (7.0, 7.0, 7.0) for one in browsers)


@pytest.mark.parametrize("seed", [1])
def test_ten_thousand_messages_of_a_viewer_change_nothing(tmp_path, seed):
    with open_door(tmp_path, message_rate=10_000.0) as door:
        changes, rng = Changes(door), random.Random(seed)
        with door.client("vera") as client, door.scene(client) as scene:
            before = changes.state()
            for _ in range(10_000):
                scene.send(junk(rng, changes))
                with contextlib.suppress(TimeoutError):
                    scene.recv(timeout=0.0)
            # it is still there, and what it sent has arrived: a good message comes behind
            scene.send(message("ViewerCameraMessage", **CAMERA | {"position": (7.0, 7.0, 7.0)}))
            until(lambda: arrived(door), "the last message arrived", 60.0)
            assert changes.state() == before
        with door.client("otto") as client, door.scene(client) as scene:  # whom the scene obeys
            update = message("GuiUpdateMessage", uuid=changes.uuids[0], updates={"value": True})
            until(
                lambda: scene.send(update) or changes.state() != before,
                "an operator's message changes it",
            )
