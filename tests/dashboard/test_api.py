"""REST: who may do what, what bad bodies meet, recordings through the real recorder on a real
bus.
"""

import json
import socket
import sys
import threading
import time

import httpx
import pytest
import zenoh
from support.front_door import Door, open_door
from support.waiting import until

from dashboard.data.feed import Feed
from dashboard.data.store import Store
from dashboard.desk import Desk
from dashboard.web.control import ControlError, ProcessReplay
from messages.bus import orders
from messages.bus.session import BusSettings, Publishers, open_client, open_router
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import BOARD, ESTIMATOR, LINK
from sessions.recording import service as recorder
from sessions.recording.settings import RecorderSettings


@pytest.fixture(scope="module")
def door(tmp_path_factory):
    with open_door(tmp_path_factory.mktemp("door"), scene=False, body_timeout_s=3.0) as opened:
        yield opened


@pytest.fixture
def bus(free_port):
    endpoint = f"tcp/127.0.0.1:{free_port}"
    settings = BusSettings(router=endpoint, listen=[endpoint])
    with open_router(settings), open_client(settings, timeout_s=20.0) as session:
        yield settings, session


def exchange(door: Door, data: bytes, more: bytes = b"", seconds: float = 15.0) -> bytes:
    """Raw bytes to the door, `more` again and again until it answers or closes; the answer."""
    with socket.create_connection(("127.0.0.1", door.settings.port)) as link:
        link.sendall(data)
        link.settimeout(0.02 if more else seconds)
        answer, end = b"", time.monotonic() + seconds
        while time.monotonic() < end:
            try:
                part = link.recv(65536)
                answer += part
                if not part or b"\r\n\r\n" in answer:
                    return answer
            except TimeoutError:
                link.sendall(more)
            except ConnectionError:
                return answer
        raise AssertionError(f"no end of the connection within {seconds:g} s; got {answer[:200]!r}")


def test_nothing_but_health_without_sign_in(door: Door):
    with door.client("vera") as client:
        paths = client.get("/api/openapi.json").json()["paths"]
        assert {"/api/devices", "/api/sessions/{session}/download", "/api/recording/start"} <= set(
            paths
        )
    with door.client() as client:
        for path, verbs in paths.items():
            for verb in verbs:
                answer = client.request(verb, path.replace("{session}", "20260101-000000"), json={})
                assert answer.status_code == (200 if path == "/api/health" else 401), path


def test_viewer_and_missing_token_cannot_give_orders(door: Door):
    orders = ["recording/start", "recording/stop", "replay/stop", "sessions/20260101-000000/replay"]
    with door.client("vera") as client:
        for order in orders:
            answer = client.post(f"/api/{order}", json={})
            assert answer.status_code == 403 and "takes the role operator" in answer.json()["error"]
    with door.client("otto") as client:
        del client.headers["x-csrf-token"]
        for order in orders:
            answer = client.post(f"/api/{order}", json={})
            assert answer.status_code == 403 and "X-CSRF-Token" in answer.json()["error"]


@pytest.mark.parametrize(
    "body",
    [
        '{"speed": NaN}',
        '{"speed": 1e999}',
        '{"speed": -Infinity}',
        '{"speed": true}',
        '{"speed": "2"}',
        '{"speed": 1, "other": 1}',
        "[]",
        "",
        "{",
        '{"speed": 1000}',
        "[" * 30000,
        '{"a":' * 10000,
    ],
)
def test_bad_bodies_are_named_and_never_a_server_fault(door: Door, body):
    with door.client("otto") as client:
        answer = client.post(
            "/api/sessions/20260101-000000/replay",
            content=body,
            headers={"content-type": "application/json"},
        )
    assert answer.status_code in (400, 422), answer.text
    assert json.loads(answer.text, parse_constant=pytest.fail)["error"]


def test_endless_chunked_body_is_cut_off(door: Door):
    head = (
        b"POST /api/recording/start HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding:"
        b" chunked\r\n\r\n"
    )
    answer = exchange(door, head, b"4000\r\n" + b"x" * 0x4000 + b"\r\n")
    assert answer == b"" or b" 413 " in answer.split(b"\r\n")[0]


def test_announced_giant_and_dripping_bodies_are_refused(door: Door):
    head = b"POST /login HTTP/1.1\r\nHost: localhost\r\nContent-Length: %d\r\n\r\n"
    assert b" 413 " in exchange(door, head % 10**9)
    assert b" 408 " in exchange(door, head % 100 + b"name=")


@pytest.mark.parametrize(
    "name",
    [
        "..%2f..%2fetc%2fpasswd",
        "..%2fusers.json",
        "%2e%2e",
        "20260101-000000%2f..%2f..%2fusers.json",
        "%00",
        "x" * 3000,
    ],
)
def test_paths_do_not_leave_the_folder(door: Door, name):
    with door.client("anna") as client:
        for tail in ("", "/download"):
            answer = client.get(f"/api/sessions/{name}{tail}")
            assert answer.status_code in (404, 307) and "argon2" not in answer.text
            assert str(door.settings.sessions_root) not in answer.text
        for static in ("/static/../app.py", "/static/%2e%2e/app.py", "/static/..%2fapp.py"):
            assert client.get(static).status_code == 404


def test_foreign_host_names_are_refused_and_listed_ones_served(door: Door, tmp_path):
    for host in ("evil.example", "", "127.0.0.1@evil.example", "a b"):
        answer = httpx.get(door.url + "/api/health", headers={"host": host})
        assert answer.status_code == 400, host
    with open_door(tmp_path, scene=False, allowed_hosts=["cube.example"]) as other:
        for host in ("cube.example", "CUBE.example:8080", "localhost", "[::1]:8080", "192.0.2.7"):
            assert (
                httpx.get(other.url + "/api/health", headers={"host": host}).status_code == 200
            ), host


def test_without_a_bus_the_answers_say_so(door: Door):
    with door.client("otto") as client:
        assert client.get("/api/devices").json() == []
        assert client.get("/api/recording").json()["available"] is False
        assert client.post("/api/recording/start", json={}).status_code == 503
        assert client.get("/api/sessions").json() == []


def test_recorder_that_does_not_answer_is_said(bus):
    settings, session = bus
    desk = Desk(session, settings.prefix)
    with pytest.raises(orders.NoAnswer, match="gyrofree record"):
        desk.recorder(pb.RecorderCommand(action=pb.RecorderCommand.ACTION_START, user="otto"))


def test_the_reason_of_a_refusal_reaches_the_one_who_asked(bus, tmp_path):
    """The recorder was asked and said no: not that it does not answer."""
    settings, session = bus
    busy = orders.take(
        session, settings.prefix, orders.RECORDER, lambda order: order.refuse("it is stopping")
    )
    desk = Desk(session, settings.prefix)
    try:
        with open_door(tmp_path, scene=False, desk=desk) as door, door.client("otto") as client:
            answer = client.post("/api/recording/stop")
            assert answer.status_code == 503
            assert answer.json()["error"] == "the recorder: it is stopping"
    finally:
        busy.undeclare()


def publish(session: zenoh.Session, stop: threading.Event) -> None:
    """A device as its gateway and estimator would announce it, ten times a second."""
    publishers = Publishers(session, "gyrofree")
    header = pb.Header(device="cube", source=pb.SOURCE_SIMULATED, run=1)
    while not stop.wait(0.1):
        header.utc_ns = time.time_ns()
        publishers.put(
            LINK, "cube", pb.LinkStatus(header=header, connected=True, sample_rate_hz=100.0)
        )
        publishers.put(BOARD, "cube", pb.BoardInfo(header=header, firmware="1.0", axes=12))
        status = pb.EstimatorStatus(header=header, estimator="products-ekf", state="running")
        publishers.put(ESTIMATOR, "cube", status, "products-ekf")


def test_record_download_and_replay_through_the_real_recorder(bus, tmp_path):
    settings, session = bus
    stop = threading.Event()
    recording = RecorderSettings(root=tmp_path / "sessions", auto_start=False)
    threads = [
        threading.Thread(target=recorder.run, args=(recording, settings, stop)),
        threading.Thread(target=publish, args=(session, stop)),
    ]
    for thread in threads:
        thread.start()
    seen, store = tmp_path / "replayed", Store()
    feed = Feed(session, settings.prefix, store, threading.Event())
    command = [
        sys.executable,
        "-c",
        f"import sys, time; open({str(seen)!r}, 'w').write(repr(sys.argv)); time.sleep(60)",
    ]
    services = {
        "store": store,
        "desk": Desk(session, settings.prefix),
        "replay": ProcessReplay(command),
    }
    try:
        with open_door(tmp_path, scene=False, **services) as door, door.client("otto") as client:
            device = until(
                lambda: [d for d in client.get("/api/devices").json() if d["estimators"]],
                "the device",
            )[0]
            assert (device["name"], device["source"], device["stale"]) == (
                "cube",
                "simulated",
                False,
            )
            until(lambda: client.get("/api/recording").json()["available"], "the recorder's word")
            started = client.post(
                "/api/recording/start", json={"name": "bench", "note": "first <b>run</b>"}
            )
            assert started.status_code == 200 and started.json()["recording"], started.text
            until(lambda: client.get("/api/recording").json()["messages"] > 10, "messages recorded")
            running = f"/api/sessions/{started.json()['session']}"
            assert client.get(running).json()["state"] == "recording"
            assert client.get(running + "/download").status_code == 409
            assert client.post("/api/recording/stop").json()["recording"] is False
            (row,) = client.get("/api/sessions", params={"q": "BENCH cube"}).json()
            assert (
                row["state"] == "closed"
                and row["completeness"] == 1.0
                and row["sources"] == ["simulated"]
            )
            assert client.get("/api/sessions", params={"q": "elsewhere"}).json() == []
            data = client.get(f"/api/sessions/{row['id']}/download")
            path = door.front.catalogue.path(row["id"])
            assert (
                data.content == path.read_bytes()
                and row["id"] in data.headers["content-disposition"]
            )
            page = client.get("/sessions").text
            assert f'data-replay="{row["id"]}"' in page and "first &lt;b&gt;run" in page
            answer = client.post(f"/api/sessions/{row['id']}/replay", json={"speed": 4})
            assert answer.json()["replaying"] == row["id"], answer.text
            until(lambda: seen.exists() and seen.read_text().endswith("]"), "the replay process")
            assert str(path) in seen.read_text() and "'--speed', '4'" in seen.read_text()
            assert client.post(f"/api/sessions/{row['id']}/replay", json={}).status_code == 409
            assert client.post("/api/replay/stop").json()["replaying"] == ""
    finally:
        services["replay"].stop()
        feed.stop()
        stop.set()
        for thread in threads:
            thread.join(20.0)


def test_replay_that_fails_at_once_is_said(tmp_path):
    with pytest.raises(ControlError, match="a.mcap ended at once with code 2"):
        ProcessReplay([sys.executable, "-c", "raise SystemExit(2)"], look_s=60.0).start(
            tmp_path / "a.mcap", 1.0
        )
    with pytest.raises(ControlError, match="No such file"):
        ProcessReplay([str(tmp_path / "nothing")]).start(tmp_path / "a.mcap", 1.0)
