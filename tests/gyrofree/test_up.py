"""`gyrofree up`: the real services of a real file, on a simulated board at a pseudo-terminal."""

import re
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time

import httpx
import pytest
from support.stack import free_port

from dashboard.web.users import add_user, load_users
from gyrofree.config import load
from gyrofree.running.up import FIRST
from messages.bus.session import open_client, subscribe
from messages.contract.topics import RATE

GYROFREE = [sys.executable, "-P", "-m", "gyrofree"]
START_S = 120.0


class Up:
    """`gyrofree up` with what it says."""

    def __init__(self, folder, *arguments):
        self.log = folder / "up.log"
        with self.log.open("wb") as log:
            self.process = subprocess.Popen(
                [*GYROFREE, "up", *arguments], cwd=folder, stdout=log, stderr=log
            )

    def text(self):
        return self.log.read_text(errors="replace")

    def until(self, pattern):
        end = time.monotonic() + START_S
        while not (found := re.search(pattern, self.text())):
            assert self.process.poll() is None and time.monotonic() < end, self.text()
            time.sleep(0.1)
        return found

    def end(self):
        self.process.send_signal(signal.SIGINT)
        return self.process.wait(30)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()


@pytest.fixture
def board(tmp_path):
    link = tmp_path / "by-id" / "usb-cube"
    process = subprocess.Popen(
        [*GYROFREE, "simulate", "--link", str(link)], cwd=tmp_path, stderr=subprocess.PIPE
    )
    process.stderr.readline()
    yield link
    process.terminate()
    process.wait(20)


def rate_is_heard(folder):
    """A rate of the cube crosses the bus of the file that was written."""
    bus, heard = load(folder / "gyrofree.toml").bus, threading.Event()
    with open_client(bus) as session:
        kept = subscribe(session, RATE, bus.prefix, lambda key, _: heard.set())
        arrived = heard.wait(60)
        kept.undeclare()
    return arrived


def test_from_the_box_to_live(board, tmp_path):
    """Two commands: setup, up. The printed link signs in as administrator, and samples arrive."""
    ports = ["--dashboard-port", str(free_port()), "--bus-port", str(free_port())]
    made = subprocess.run(
        [*GYROFREE, "setup", "--ports-in", "by-id", "--seconds", "1", "--yes", *ports],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert made.returncode == 0 and "next:  gyrofree up" in made.stderr, made.stderr
    with Up(tmp_path) as up:
        link = up.until(r"open  (http://\S+/login/link\?token=\S+)")[1]
        up.until("gyrofree users add NAME --role admin")
        assert "up         starting router, gateway" in up.text()
        url = link.split("/login")[0]
        with httpx.Client(base_url=url, follow_redirects=True, timeout=30.0) as client:
            enter(client, link)
            assert client.get("/api/me").json()["role"] == "admin"
        with httpx.Client(base_url=url, timeout=30.0) as stranger:
            assert stranger.get("/api/sessions").status_code == 401
        assert rate_is_heard(tmp_path)
        assert up.end() == 0
        assert "stopped cleanly" in up.text() and "Traceback" not in up.text()
    add_user(tmp_path / "var/state/users.json", "anna", "a long pass phrase", "admin")
    with Up(tmp_path, "--only", "router", "--only", "dashboard") as up:
        up.until(r"open  http://\S+")
        assert "login/link" not in up.text()
        assert FIRST not in load_users(tmp_path / "var/state/users.json")
        for absent in ("gateway", "estimator", "record"):
            assert not re.search(rf"^\S+ {absent} ", up.text(), re.MULTILINE)
        assert up.end() == 0


def enter(client, link):
    """What a click on the one-time link's page does."""
    token = link.partition("token=")[2]
    origin = {"origin": str(client.base_url).rstrip("/")}
    assert client.post("/login/link", data={"token": token}, headers=origin).status_code == 200


def test_the_first_board_in_the_browser(board, tmp_path):
    """`gyrofree up` without a board: the page asks for it, and its samples arrive."""
    port, bus = free_port(), free_port()
    (tmp_path / "gyrofree.toml").write_text(
        f"[dashboard]\nport = {port}\n"
        f'[bus]\nrouter = "tcp/127.0.0.1:{bus}"\nlisten = ["tcp/127.0.0.1:{bus}"]\n'
    )
    with Up(tmp_path) as up:
        link = up.until(r"open  (http://\S+/login/link\?token=\S+)")[1]
        assert "no board in" in up.text()
        url = f"http://127.0.0.1:{port}"
        origin = {"origin": url}
        with httpx.Client(
            base_url=url, follow_redirects=True, timeout=60.0, headers=origin
        ) as client:
            enter(client, link)
            page = client.get("/")
            assert page.url.path == "/setup" and "Listen at the ports" in page.text
            csrf = {"csrf": client.get("/api/me").json()["csrf"]}
            form = csrf | {"port": str(board), "half-side": "0.06", "pulses": "100"}
            wrong = client.post("/setup", data=form | {"name": "A B"})
            assert wrong.status_code == 422 and "want a-z" in wrong.text
            assert str(board) in wrong.text
            no_file = client.post("/setup", data=form | {"port": "file:///etc/passwd"})
            assert no_file.status_code == 422 and "root:" not in no_file.text
            weak = client.post("/setup", data=form | {"user": "anna", "password": "short"})
            assert weak.status_code == 422 and "password" in weak.text
            user = {"user": "anna", "password": "a long pass phrase"}
            done = client.post("/setup", data=form | user)
            assert done.status_code == 200 and done.url.path == "/"
        up.until("the first board: gyrofree.toml: cube on")
        assert rate_is_heard(tmp_path)
        assert up.end() == 0
    written = load(tmp_path / "gyrofree.toml")
    assert written.estimator.layout.half_side_m == 0.06 and written.dashboard.port == port
    assert load_users(tmp_path / "var/state/users.json")["anna"].role.name == "admin"


def test_a_taken_port_is_said_with_its_key(tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        (tmp_path / "gyrofree.toml").write_text(f"[dashboard]\nport = {port}\n")
        with Up(tmp_path, "--only", "dashboard") as up:
            assert up.process.wait(60) == 3
        assert str(port) in up.text() and "[dashboard] port" in up.text()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--only", "gatway"], "want one of router, gateway"),
        (["--only", "router", "--without", "router"], "leave no service"),
        (["--config", "absent.toml"], "absent.toml"),
    ],
)
def test_what_cannot_be_is_refused(arguments, words, tmp_path):
    with Up(tmp_path, *arguments) as up:
        assert up.process.wait(60) == 2
    assert words in up.text() and "Traceback" not in up.text()


@pytest.mark.parametrize("name", ["plain", "with blank", "50 % of $HOME", 'a "quoted" one'])
def test_the_unit_is_right(name, tmp_path):
    folder = tmp_path / name
    folder.mkdir()
    (folder / "my.toml").write_text("")
    done = subprocess.run(
        [*GYROFREE, "up", "--systemd", "--config", "my.toml", "--without", "record"],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 0, done.stderr
    unit = tmp_path / "gyrofree.service"
    unit.write_text(done.stdout)
    assert "--without=record" in done.stdout and "RestartPreventExitStatus=2" in done.stdout
    if shutil.which("systemd-analyze"):
        said = subprocess.run(
            ["systemd-analyze", "verify", "--man=no", str(unit)], capture_output=True, text=True
        )
        ours = [line for line in said.stderr.splitlines() if "gyrofree.service" in line]
        assert said.returncode == 0 and not ours, said.stderr
