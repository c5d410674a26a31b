"""The first-run page: who may see it, what it fills in, and that it goes away."""

import sys

from support.front_door import open_door

from dashboard.web.first.control import FirstRun
from gateway.virtual.board_link import PtyLink

SETUP = [sys.executable, "-P", "-m", "gyrofree", "setup"]


def first_run(folder, ports):
    return FirstRun([*SETUP, f"--config={folder}/gyrofree.toml", f"--ports-in={ports}"])


def csrf(client):
    return {"csrf": client.headers["x-csrf-token"]}


def test_only_an_administrator_is_asked(tmp_path):
    with open_door(tmp_path, scene=False, first_run=first_run(tmp_path, tmp_path)) as door:
        with door.client() as nobody:
            assert nobody.get("/setup", headers={"accept": "text/html"}).status_code == 303
        with door.client("vera") as viewer:
            assert viewer.get("/").status_code == 200
            assert viewer.get("/setup").status_code == 403
            assert viewer.post("/setup", data=csrf(viewer) | {"later": "1"}).status_code == 403
        with door.client("anna") as admin:
            assert admin.get("/").headers["location"] == "/setup"
            assert admin.post("/setup", data={"later": "1"}).status_code == 403
            assert admin.post("/setup", data=csrf(admin) | {"later": "1"}).status_code == 303
            assert admin.get("/").status_code == 200
    assert not (tmp_path / "gyrofree.toml").exists()


def test_what_was_heard_fills_in_the_form(tmp_path):
    link = PtyLink(tmp_path / "by-id" / "usb-<b>")  # a name that would be markup
    try:
        first = first_run(tmp_path, tmp_path / "by-id")
        with (
            open_door(tmp_path, scene=False, first_run=first) as door,
            door.client("anna") as admin,
        ):
            assert "Listen at the ports" in admin.get("/setup").text
            done = admin.post("/setup", data=csrf(admin) | {"look": "1"}, timeout=60)
            assert done.status_code == 303
            page = admin.get("/setup").text
            assert "silence: is the board powered" in page
            assert "usb-&lt;b&gt;" in page and "usb-<b>" not in page
    finally:
        link.close()


def test_without_a_port_it_says_so(tmp_path):
    first = first_run(tmp_path, tmp_path / "none")
    with open_door(tmp_path, scene=False, first_run=first) as door, door.client("anna") as admin:
        admin.post("/setup", data=csrf(admin) | {"look": "1"}, timeout=60)
        assert "No serial port is there" in admin.get("/setup").text


def test_with_a_board_there_is_nothing_to_ask(tmp_path):
    with open_door(tmp_path, scene=False) as door, door.client("anna") as admin:
        assert admin.get("/").status_code == 200
        assert admin.get("/setup").status_code == 409
