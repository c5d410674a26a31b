"""The pages: who sees what, safe headers everywhere, nothing from elsewhere, the process and its
port.
"""

import re
import subprocess
import sys
import threading
from pathlib import Path

import httpx
import pytest
from support.front_door import Door, open_door
from support.waiting import until

import dashboard
from dashboard import service
from dashboard.settings import DashboardSettings
from dashboard.web.users import demo_link
from messages.bus.session import BusSettings, open_router
from sessions.library.catalogue import SessionInfo

FOLDER = Path(dashboard.__file__).parent / "web"
GUARDED = "<script>{{ guard|safe }}</script>"


@pytest.fixture(scope="module")
def door(tmp_path_factory):
    with open_door(tmp_path_factory.mktemp("door"), scene=False, demo=True) as opened:
        yield opened


HTML = {"accept": "text/html"}


def test_strangers_are_sent_to_sign_in(door: Door):
    with door.client() as client:
        for path in ("/", "/sessions", "/users", "/api/docs"):
            answer = client.get(path, headers=HTML)
            if path.startswith("/api"):
                assert answer.status_code == 401
            else:
                assert answer.status_code == 303 and answer.headers["location"].startswith("/login")
        assert "Password" in client.get("/login").text


def test_main_page_frames_the_scene_and_knows_the_role(door: Door):
    for name, operator in (("vera", "0"), ("otto", "1")):
        with door.client(name) as client:
            page = client.get("/").text
            assert 'id="scene"' in page and name in page
            assert re.search(r'id="desk" data-operator="(.)"', page)[1] == operator
            assert 'href="/users"' not in page
    with door.client("anna") as client:
        assert 'href="/users"' in client.get("/").text
        assert client.get("/login").headers["location"] == "/"


def test_every_answer_carries_the_headers(door: Door):
    with door.client("anna") as client:
        answers = [
            client.get(path, headers=HTML)
            for path in (
                "/",
                "/login",
                "/login/link",
                "/sessions",
                "/users",
                "/api/me",
                "/api/docs",
                "/nothing",
                "/static/gyrofree.css",
                "/scene/",
                "/api/sessions/none",
            )
        ]
        answers.append(client.post("/login", headers={"origin": "http://evil.example"}))
        for answer in answers:
            assert answer.headers["x-content-type-options"] == "nosniff", answer.url
            assert "default-src 'none'" in answer.headers["content-security-policy"], answer.url
            assert "server" not in answer.headers
            if answer.url.path != "/scene/":
                script = re.search(
                    r"script-src ([^;]*)", answer.headers["content-security-policy"]
                )[1]
                assert script == "'self'"


def test_pages_need_nothing_from_elsewhere_and_no_inline_code():
    ours = [*FOLDER.glob("templates/*.html"), *FOLDER.glob("static/*.*")]
    for file in ours:  # of what is vendored, test_charts.py sees that it asks for nothing
        text = file.read_text().replace("http://www.w3.org/2000/svg", "")
        text = text.replace(GUARDED, "")  # its hash is in that page's policy
        assert (
            "http://" not in text
            and "https://" not in text
            and "//" not in re.sub(r"(?m)//\s.*$", "", text)
        ), file
        assert not re.search(r"\son\w+=|<style|style=|<script>|javascript:", text), file


def test_pages_call_no_rest_that_does_not_exist(door: Door):
    with door.client("vera") as client:
        known = set(client.get("/api/openapi.json").json()["paths"])
    for file in FOLDER.glob("static/*.js"):
        for path in re.findall(r'call\("([^"]+)"', file.read_text()):
            assert f"/api/{path}" in known, (file, path)


def test_sessions_page_shows_what_is_lost_damaged_and_hostile(door: Door, monkeypatch):
    rows = [
        SessionInfo(
            "20260101-120000",
            ("cube",),
            1767268800 * 10**9,
            3725.0,
            "closed",
            12_345_678,
            999,
            1,
            Path("x.mcap"),
            "<script>alert(1)</script>",
        ),
        SessionInfo(
            "20260101-110000",
            (),
            0,
            0.0,
            "unreadable",
            0,
            0,
            0,
            None,
            "",
            problem="no session.json",
        ),
    ]
    monkeypatch.setattr(door.front.catalogue, "list", lambda: rows)
    with door.client("vera") as client:
        page = client.get("/sessions").text
        assert "99.900 %" in page and "1 lost" in page and "1:02:05" in page and "12.3 MB" in page
        assert (
            "no session.json" in page and "&lt;script&gt;" in page and "<script>alert" not in page
        )
        assert "data-replay" not in page  # a viewer, and there is no replay
        assert page.count("/download") == 1
        assert "No session matches" in client.get("/sessions", params={"q": "<b>"}).text
        assert "<b>" not in client.get("/sessions", params={"q": "<b>"}).text


def test_missing_pages_and_long_queries_are_pages_too(door: Door):
    with door.client("vera") as client:
        answer = client.get("/nothing", headers=HTML)
        assert answer.status_code == 404 and "Back to the live view" in answer.text
        assert client.get("/sessions", params={"q": "x" * 300}, headers=HTML).status_code == 422
        assert client.get("/nothing").json() == {"error": "Not Found"}


def test_taken_port_is_said_in_one_line(free_port):
    with service.listen("127.0.0.1", free_port), pytest.raises(OSError) as taken:
        service.listen("127.0.0.1", free_port)
    assert "\n" not in str(taken.value) and f"port {free_port} of 127.0.0.1 is taken" in str(
        taken.value
    )
    with pytest.raises(OSError, match="host"):
        service.listen("no.such.host.invalid", free_port)


@pytest.mark.parametrize("host", ["http://a", "a:80", "*", ""])
def test_allowed_hosts_are_bare_names(host):
    with pytest.raises(ValueError, match="bare host name"):
        DashboardSettings(allowed_hosts=[host])


SERVE = """
import sys, threading
from dashboard import service
from dashboard.settings import DashboardSettings
from gyrofree.running.process import stop_on_signals
from messages.bus.session import BusSettings
stop = stop_on_signals()
settings = DashboardSettings.model_validate_json(sys.argv[1])
service.run(settings, BusSettings(router=sys.argv[2]), stop)
print("ended", threading.active_count())
"""


def test_whole_process_serves_the_scene_and_ends_on_sigterm(tmp_path, free_port):
    with service.listen("127.0.0.1", 0) as probe:
        bus_port = probe.getsockname()[1]
    endpoint = f"tcp/127.0.0.1:{bus_port}"
    settings = DashboardSettings(port=free_port, users=tmp_path / "users.json", demo=True)
    link = demo_link(settings.users, settings.url)
    with open_router(BusSettings(router=endpoint, listen=[endpoint])):
        process = subprocess.Popen(
            [sys.executable, "-c", SERVE, settings.model_dump_json(), endpoint],
            stdout=subprocess.PIPE,
            text=True,
            cwd=FOLDER.parent,
        )
        try:
            until(lambda: healthy(settings.url), "the dashboard answers", 90.0)
            with httpx.Client(base_url=settings.url, timeout=30.0) as client:
                client.post("/login/link", data={"token": link.split("token=")[1]})
                assert "<title>Viser</title>" in client.get("/scene/").text
                assert client.get("/api/health").json() == {
                    "status": "ok",
                    "scene": True,
                    "bus": True,
                }
            process.terminate()
            assert "ended" in process.communicate(timeout=30.0)[0]
            assert process.returncode == 0
        finally:
            process.kill()
            process.wait()


def healthy(url: str) -> bool:
    """True when the dashboard answers."""
    try:
        return httpx.get(url + "/api/health").status_code == 200
    except httpx.TransportError:
        return False


def test_process_gives_up_waiting_for_a_router_when_told_to(tmp_path, free_port):
    stop = threading.Event()
    threading.Timer(1.0, stop.set).start()
    settings = DashboardSettings(port=free_port, users=tmp_path / "users.json")
    with pytest.raises(ConnectionError, match="router"):
        service.run(settings, BusSettings(router="tcp/127.0.0.1:1"), stop)
