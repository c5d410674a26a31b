"""Alarms with real processes: an axis is spoilt, a limit is set, the service is killed; what people
did is there again, recorded, and in the report.
"""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from contextlib import closing

import httpx
from support.stack import RunningDemo
from support.waiting import until

from messages.bus.session import BusSettings, open_client, subscribe
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import AXES

# One run for as long as the test takes: at its end the axis would be sound for a while.
TURNING = """
pieces = [
    { seconds = 5.0, to_dps = 0.0 },
    { seconds = 1.0, to_dps = 180.0 },
    { seconds = 900.0, to_dps = 180.0 },
    { seconds = 1.0, to_dps = 0.0 },
]
"""
BAD = {"device": "cube", "id": "axis-a21"}


def signed_in(demo: RunningDemo) -> httpx.Client:
    url, token = demo.link.split("/login/link?token=")
    client = httpx.Client(base_url=url, timeout=30.0, headers={"origin": url})
    assert client.post("/login/link", data={"token": token}).status_code == 303
    client.headers["x-csrf-token"] = client.get("/api/me").json()["csrf"]
    return client


def gyrofree(demo: RunningDemo, *words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-P", "-m", "gyrofree", *words, "--config", str(demo.config)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120)


def point(client: httpx.Client, id: str, test: Callable[[dict], bool], seconds: float = 60.0):
    """The alarm of this id, once it is as the test wants it."""

    def find():
        answer = client.get("/api/alarms")
        found = answer.json()["alarms"] if answer.status_code == 200 else []
        return next((one for one in found if one["id"] == id and test(one)), None)

    return until(find, f"{id}: {client.get('/api/alarms').text[:2000]}", seconds)


def test_a_spoilt_axis_is_an_alarm_that_survives_its_service_and_stands_in_the_report(tmp_path):
    (tmp_path / "turning.toml").write_text(TURNING)
    arguments = ("--profile", str(tmp_path / "turning.toml"), "--fault", "a21:stuck@6-900")
    with RunningDemo(tmp_path, *arguments) as demo, closing(signed_in(demo)) as client:
        said: list[pb.AxisHealth] = []
        bus = BusSettings(router=f"tcp/127.0.0.1:{demo.bus_port}")
        with open_client(bus, timeout_s=20.0) as session:
            heard = subscribe(session, AXES, bus.prefix, lambda _, m: said.append(m))
            found = point(client, "axis-a21", lambda one: one["state"] == "unacknowledged")
            heard.undeclare()
        assert found["active"] and found["level"] == "warning" and found["page"] == "health"
        shown = client.get("/api/devices").json()[0]["alarms"]
        until(
            lambda: any(
                a["id"] == "axis-a21" and a["state"] == "unacknowledged"
                for a in client.get("/api/devices").json()[0]["alarms"]
            ),
            f"the head of the page says it: {shown}",
        )

        # a limit by a person, on a rate of the table, which turns at 180 °/s
        limit = {"name": "fast", "field": "abs(omega_z)", "above": 30.0, "dead_band": 5.0}
        assert client.post("/api/alarms/limits", json=limit).status_code == 200
        wrong = client.post("/api/alarms/limits", json=limit | {"name": "w", "field": "link.nix"})
        assert wrong.status_code == 409 and "no field nix" in wrong.json()["error"]
        point(client, "limit-fast", lambda one: one["active"] and one["unit"] == "°/s")

        noted = client.post("/api/alarms/acknowledge", json=BAD | {"note": "known"})
        assert noted.status_code == 200
        shelf = {"device": "cube", "id": "limit-fast", "seconds": 600.0, "reason": "a test"}
        assert client.post("/api/alarms/shelve", json=shelf).status_code == 200

        killed = demo.children()["alarms"].pid
        os.kill(killed, signal.SIGKILL)
        until(lambda: demo.children().get("alarms", None) is not None, "it is started again")
        until(lambda: demo.children()["alarms"].pid != killed, "by another process")
        again = point(client, "axis-a21", lambda one: not one["unknown"])
        assert (again["state"], again["acknowledged_by"], again["note"]) == (
            "acknowledged",
            "demo",
            "known",
        )
        assert again["raised_s"] == found["raised_s"]
        fast = point(client, "limit-fast", lambda one: one["state"] == "shelved")
        assert 0.0 < fast["shelved_s"] < 600.0 and fast["reason"] == "a test"

        listed = gyrofree(demo, "alarms", "list", "--json")
        assert {"axis-a21", "limit-fast"} <= {a["id"] for a in json.loads(listed.stdout)["alarms"]}
        history = json.loads(gyrofree(demo, "alarms", "history", "--json").stdout)
        assert {"raised", "acknowledged", "shelved", "limit set"} <= {e["what"] for e in history}
        nobody = gyrofree(demo, "alarms", "acknowledge", "axis-a21", "--device", "cube")
        assert nobody.returncode == 1 and "already by demo" in nobody.stderr, history
        assert gyrofree(demo, "alarms", "test").returncode == 1  # no way out is set

        stopped = client.post("/api/recording/stop", json={}).json()
        out = tmp_path / "report"
        made = gyrofree(demo, "report", stopped["session"], "--out", str(out))
        assert made.returncode in (0, 1), made.stderr
        (report,) = [json.loads(path.read_text()) for path in out.glob("*.json")]
        mine = {one["id"]: one for one in report["alarms"]}
        assert mine["axis-a21"]["acknowledged_by"] == "demo" and "limit-fast" in mine
        assert 5.0 < mine["axis-a21"]["from_s"] < 16.0  # spoilt at 6 s
    assert any(axis.name == "a21" and axis.excluded for m in said for axis in m.axes)
