"""The scene behind the door: who gets in, which messages pass, what a slow or hostile browser
meets.
"""

import dataclasses
import socket

import msgspec
import numpy as np
import pytest
import viser._messages
import zstandard
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from support.front_door import CAMERA, Door, message, open_door
from support.waiting import until
from websockets.exceptions import ConnectionClosed, InvalidStatus

from dashboard.web.auth import Role
from dashboard.web.frame.scene_messages import (
    MAKES_INPUT,
    OPERATOR_MAY,
    VIEWER_MAY,
    BadMessage,
    Widgets,
    may_send,
    message_type,
)
from dashboard.web.users import remove_user


@pytest.fixture(scope="module")
def door(tmp_path_factory):
    folder = tmp_path_factory.mktemp("door")
    with open_door(folder, free_attempts=100, open_labels=["Pause"]) as opened:
        yield opened


@pytest.fixture
def checkbox(door: Door):
    handle = door.viser.gui.add_checkbox("Sw", False)
    yield handle
    handle.remove()


def closed_with(scene) -> int:
    """Read until the door closes; its code."""
    with pytest.raises(ConnectionClosed) as closed:
        while True:
            scene.recv(timeout=20.0)
    return closed.value.rcvd.code


def answers(port: int) -> bool:
    """True while something listens there."""
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


def driven(scene, handle) -> None:
    """Tick a box until the relay, which has to have heard of it first, lets that pass."""
    update = message("GuiUpdateMessage", uuid=handle._impl.uuid, updates={"value": True})
    until(lambda: scene.send(update) or handle.value, "the box is ticked")


def only_client(door: Door):
    return until(lambda: list(door.viser.get_clients().values()), "viser has a client")[-1]


def test_page_is_for_signed_in_people_and_talks_to_this_server_only(door: Door):
    with door.client() as client:
        assert client.get("/scene/").status_code == 303
    with door.client("vera") as client:
        answer = client.get("/scene/")
        policy = answer.headers["content-security-policy"]
        host = door.url.removeprefix("http://")
        assert "<title>Viser</title>" in answer.text
        assert (
            f"connect-src data: blob: ws://{host} wss://{host};" in policy
            and "default-src 'none'" in policy
        )
        answer = client.get(
            "/scene/?websocket=wss://evil.example&darkMode&playbackPath=//evil.example/a"
        )
        assert answer.status_code == 303 and answer.headers["location"] == "/scene/?darkMode="


def test_socket_needs_sign_in_and_the_same_origin(door: Door):
    with door.client() as nobody, door.client("otto") as client:
        for who, options in (
            (nobody, {}),
            (client, {"origin": "http://evil.example"}),
            (client, {"origin": None}),
            (client, {"origin": "null"}),
        ):
            with pytest.raises(InvalidStatus) as refused:
                door.scene(who, **options)
            assert refused.value.response.status_code == 403


def test_socket_without_visers_protocol_is_refused(door: Door):
    with door.client("otto") as client, pytest.raises(InvalidStatus):
        door.scene(client, subprotocols=["chat"])


def test_viewer_moves_the_camera_but_no_widget(door: Door, checkbox):
    with door.client("vera") as client, door.scene(client) as scene:
        assert scene.subprotocol.startswith("viser-v")
        assert isinstance(scene.recv(timeout=20.0), bytes)
        scene.send(message("GuiUpdateMessage", uuid=checkbox._impl.uuid, updates={"value": True}))
        scene.send(message("ViewerCameraMessage", **CAMERA))
        viewer = only_client(door)
        until(lambda: np.allclose(viewer.camera.position, (1, 2, 3)), "the camera moved")
        assert checkbox.value is False  # sent before the camera and in order, so it was dropped


def test_viewer_uses_a_widget_of_his_own_view_by_its_label(door: Door, checkbox):
    """The relay learns which is which of what viser tells the browser."""
    mine = door.viser.gui.add_checkbox("Pause", False)
    try:
        with door.client("vera") as client, door.scene(client) as scene:
            scene.send(message("ViewerCameraMessage", **CAMERA))
            scene.recv(timeout=20.0)
            only_client(door)
            driven(scene, mine)  # the relay knows both now
            update = {"uuid": checkbox._impl.uuid, "updates": {"value": True}}
            scene.send(message("GuiUpdateMessage", **update))
            scene.send(message("ViewerCameraMessage", **CAMERA | {"position": (4.0, 5.0, 6.0)}))
            viewer = only_client(door)
            until(lambda: np.allclose(viewer.camera.position, (4, 5, 6)), "the camera moved")
            assert checkbox.value is False
    finally:
        mine.remove()


def test_a_label_that_is_given_later_opens_nothing():
    made = {"type": "GuiButtonMessage", "uuid": "a", "props": {"label": "Record", "order": 1.0}}
    renamed = {"type": "GuiUpdateMessage", "uuid": "a", "updates": {"label": "Pause"}}
    own = {"type": "GuiButtonMessage", "uuid": "b", "props": {"label": "Pause"}}
    text = {"type": "GuiHtmlMessage", "uuid": "c", "props": {"content": "Pause", "label": "Pause"}}
    widgets = Widgets(["Pause"])
    widgets.learn(frame(made, renamed, text))
    assert widgets.open == set() and not widgets.takes("c", "x")
    widgets.learn(frame(own))
    for damaged in (b"", b"short", frame(own)[:-20], bytes(100), b"\xff" * 40):
        widgets.learn(damaged)
    assert widgets.open == {"b"}


def test_operator_drives_a_widget_but_only_its_value(door: Door, checkbox):
    with door.client("otto") as client, door.scene(client) as scene:
        scene.send(message("ViewerCameraMessage", **CAMERA))
        driven(scene, checkbox)
        uuid = checkbox._impl.uuid
        for updates in ({"label": "Mine", "value": False}, {"visible": False}, {"value": "no"}):
            scene.send(message("GuiUpdateMessage", uuid=uuid, updates=updates))
        scene.send(message("GuiUpdateMessage", uuid=uuid, updates={"value": False}))
        until(lambda: not checkbox.value, "the good one arrived")
        assert checkbox.label == "Sw" and checkbox.visible


def test_nobody_opens_a_public_tunnel(door: Door, checkbox):
    asked = []
    for kind in (viser._messages.ShareUrlRequest, viser._messages.ShareUrlDisconnect):
        door.viser._websock_server._incoming_handlers[kind] = [lambda *_: asked.append(1)]
    with door.client("anna") as client, door.scene(client) as scene:
        scene.send(message("ViewerCameraMessage", **CAMERA))
        scene.send(message("ShareUrlRequest"))
        scene.send(message("ShareUrlDisconnect"))
        driven(scene, checkbox)
    assert asked == []


def test_every_allowed_name_is_a_message_of_this_viser():
    assert set(VIEWER_MAY) < set(OPERATOR_MAY)
    for name in set(OPERATOR_MAY) | MAKES_INPUT:
        assert hasattr(viser._messages, name), name
    for name, rules in OPERATOR_MAY.items():
        fields = {field.name for field in dataclasses.fields(getattr(viser._messages, name))}
        assert fields == set(rules), name


def frame(*messages) -> bytes:
    """A message of viser's to the browser."""
    text = msgspec.msgpack.encode({"messages": messages, "timestampSec": 0.0})
    packed = zstandard.compress(text)
    sizes = len(text).to_bytes(8, "little") + len(packed).to_bytes(8, "little")
    return sizes + packed + b"more"


def made(kind: str, uuid: str, **props) -> dict:
    return {"type": f"Gui{kind}Message", "uuid": uuid, "props": {"label": uuid} | props}


def sent(role: Role, kind: str, widgets: Widgets | None = None, **fields) -> bool:
    name, read = message_type(message(kind, **fields))
    return may_send(role, name, read, widgets or Widgets([]))


def test_viewer_may_use_widgets_that_concern_only_his_view():
    widgets = Widgets(["pause"])
    widgets.learn(frame(made("Checkbox", "pause"), made("Checkbox", "record")))
    update = {"uuid": "pause", "updates": {"value": True}}
    assert sent(Role.viewer, "GuiUpdateMessage", widgets, **update)
    assert not sent(Role.viewer, "GuiUpdateMessage", widgets, **update | {"uuid": "record"})
    assert not sent(Role.viewer, "GuiUpdateMessage", widgets, **update | {"uuid": ["pause"]})
    named = update | {"updates": {"label": "x"}}
    assert not sent(Role.viewer, "GuiUpdateMessage", widgets, **named)
    assert sent(Role.operator, "GuiUpdateMessage", widgets, **update | {"uuid": "record"})


ODD = [
    None,
    True,
    False,
    0,
    -1,
    2**63,
    1.5,
    -0.1,
    float("nan"),
    float("inf"),
    "",
    "a",
    "10 s",
    "1 h",
]
ODD += ["x" * 6001, "9" * 7000, b"bytes", [], [1.0], {}, {"a": 1}]
TAKEN = {
    "button": [True, False],
    "box": [True, False],
    "slider": [0, 1.5],
    "text": ["", "a", "10 s", "1 h"],
    "choice": ["10 s"],
    "buttons": ["10 s"],
}


def test_a_widget_takes_the_values_that_a_person_can_give_it():
    widgets = Widgets([])
    widgets.learn(
        frame(
            made("Button", "button"),
            made("Checkbox", "box"),
            made("Slider", "slider", min=0.0, max=2.0),
            made("Text", "text"),
            made("Dropdown", "choice", options=["10 s", "30 s"]),
            made("ButtonGroup", "buttons", options=["10 s"]),
        )
    )
    for uuid, taken in TAKEN.items():
        for value in ODD:
            update = {"uuid": uuid, "updates": {"value": value}}
            good = any(value is one or (value == one and type(value) is type(one)) for one in taken)
            assert sent(Role.operator, "GuiUpdateMessage", widgets, **update) == good, update
    changes = {"type": "GuiUpdateMessage", "uuid": "choice", "updates": {"options": ["1 h"]}}
    longer = {"type": "GuiUpdateMessage", "uuid": "slider", "updates": {"max": 9.0, "value": 3.0}}
    widgets.learn(frame(changes, longer, {"type": "GuiRemoveMessage", "uuid": "box"}))
    for uuid, value, good in (
        ("choice", "1 h", True),
        ("choice", "10 s", False),
        ("slider", 5, True),
        ("box", True, False),
        ("nobody", True, False),
    ):
        update = {"uuid": uuid, "updates": {"value": value}}
        assert sent(Role.operator, "GuiUpdateMessage", widgets, **update) == good, update


def test_numbers_of_a_browser_are_finite_and_its_texts_short():
    gizmo = {"name": "/bench/gizmo", "wxyz": [1, 0, 0, 0], "position": [0.0, 1.0, 2.0], "owner": ""}
    good = {
        "ViewerCameraMessage": CAMERA,
        "TransformControlsUpdateMessage": gizmo,
        "CommandTriggerMessage": {"uuid": "a"},
        "FileTransferPartAck": {
            "source_component_uuid": None,
            "transfer_uuid": "a",
            "transferred_bytes": 1,
            "total_bytes": 2,
        },
    }
    bad = [
        None,
        float("nan"),
        float("inf"),
        1e300,
        -(2**63),
        "x" * 1000,
        [float("nan")] * 3,
        {},
        [[]],
    ]
    for kind, fields in good.items():
        assert sent(Role.operator, kind, **fields)
        assert not sent(Role.operator, kind, **fields, more=1)
        for key in fields:
            assert not sent(Role.operator, kind, **{k: v for k, v in fields.items() if k != key})
            for value in bad:
                if not (key == "source_component_uuid" and value is None):
                    assert not sent(Role.operator, kind, **fields | {key: value}), (
                        kind,
                        key,
                        value,
                    )


@pytest.mark.parametrize(
    "data",
    [b"", b"\xc1", b"\x91" * 20000 + b"\x00", message("X")[:-1], b"\x80", b"\x81\xa4type\x01"],
)
def test_what_is_no_message_is_named_so(data):
    with pytest.raises(BadMessage):
        message_type(data)


@pytest.mark.parametrize(
    ("data", "code"), [(b"\x91" * 20000 + b"\x00", 1007), ("text", 1009), (b"\x00" * 100_000, 1009)]
)
def test_hostile_messages_close_the_connection_and_nothing_else(door: Door, data, code):
    with door.client("otto") as client, door.scene(client) as scene, door.scene(client) as other:
        scene.send(data)
        assert closed_with(scene) == code
        other.send(message("ViewerCameraMessage", **CAMERA))
        assert isinstance(other.recv(timeout=20.0), bytes)


def test_text_that_is_none_ends_the_connection_with_one_line(door: Door, caplog):
    with door.client("otto") as client, door.scene(client) as other:
        for k, bad in enumerate((b"\xff", b"\xed\xa0\x80", b"\xe2\x82", [b"a", b"\xc3\x28"])):
            with door.scene(client) as scene:
                scene.send(bad, text=True)
                assert closed_with(scene) == 1007
            lines = [r for r in caplog.records if "not UTF-8" in r.message]
            assert len(lines) == (1, 2, 2, 3)[k]  # the 1st, 2nd, 4th
        assert not any(record.exc_info for record in caplog.records)
        assert "(4 so far)" in lines[-1].message
        with door.client("anna") as admin:
            assert '<td data-label="Why">text is not UTF-8</td>' in admin.get("/users").text
        assert door.front.ended["text is not UTF-8"] == 4
        other.send(message("ViewerCameraMessage", **CAMERA))
        assert isinstance(other.recv(timeout=20.0), bytes)


def test_flood_closes_the_connection(door: Door):
    with door.client("vera") as client, door.scene(client) as scene:
        camera = message("ViewerCameraMessage", **CAMERA)
        with pytest.raises(ConnectionClosed):
            for _ in range(50_000):
                scene.send(camera)
        assert closed_with(scene) == 1008


def test_removed_user_is_cut_off_though_silent(tmp_path):
    with open_door(tmp_path) as door, door.client("vera") as client, door.scene(client) as scene:
        scene.recv(timeout=20.0)
        remove_user(door.settings.users, "vera")
        assert closed_with(scene) == 1008


def test_browser_that_takes_nothing_is_dropped_and_does_not_fill_the_memory(tmp_path):
    with open_door(tmp_path, stall_s=0.5) as door, door.client("vera") as client:
        slow = door.scene(client, max_queue=1, close_timeout=0.1)
        slow.send(message("ViewerCameraMessage", **CAMERA))
        only_client(door)
        points = np.random.default_rng(1).random((300_000, 3))
        colors = np.zeros((300_000, 3), np.uint8)
        for i in range(12):  # far more than the kernel's buffers take
            door.viser.scene.add_point_cloud(f"/p{i}", points, colors, precision="float32")
        until(lambda: not door.viser.get_clients(), "the slow browser is gone", 120.0)
        with pytest.raises(ConnectionClosed):
            while True:
                slow.recv(timeout=20.0)


def test_scene_that_is_gone_is_said_and_does_not_hang(tmp_path):
    with open_door(tmp_path) as door, door.client("vera") as client:
        port, server, door.viser = door.viser.get_port(), door.viser, None
        server.stop()
        until(lambda: not answers(port), "viser ended")
        with pytest.raises(InvalidStatus):
            door.scene(client)
        assert client.get("/api/me").status_code == 200


JUNK = st.recursive(
    st.none()
    | st.booleans()
    | st.floats()
    | st.integers(-(2**63), 2**64 - 1)
    | st.text(max_size=9),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner),
    max_leaves=6,
)


@settings(max_examples=40, deadline=None, suppress_health_check=list(HealthCheck))
@given(
    st.sampled_from(sorted(OPERATOR_MAY)), st.dictionaries(st.text(max_size=6), JUNK), JUNK, JUNK
)
def test_no_message_ends_the_scene(door: Door, kind, more, value, other):
    uuids = list(door.viser.gui._gui_input_handle_from_uuid)
    box = door.viser.gui.add_checkbox("Sw", False)
    try:
        with door.client("anna") as client, door.scene(client) as scene:
            scene.recv(timeout=20.0)
            for fields in (
                more,
                CAMERA | {"position": value},
                dict.fromkeys(OPERATOR_MAY[kind], value) | {"name": other},
                {"uuid": box._impl.uuid, "updates": {"value": value}},
                {"uuid": (uuids or [""])[0], "updates": {"value": other, "label": value}},
            ):
                scene.send(message(kind, **{k: v for k, v in fields.items() if k != "type"}))
            update = {"uuid": box._impl.uuid, "updates": {"value": not box.value}}
            was = box.value
            until(
                lambda: scene.send(message("GuiUpdateMessage", **update)) or box.value != was,
                "the good message arrived",
            )
            assert box.label == "Sw"
    finally:
        box.remove()
