"""Sign-ins of one's own, passwords, the log of acts, and that what is open ends with its right."""

import contextlib
import json
import re
import stat
import threading
import time

import httpx
import pytest
import websockets
from hypothesis import given, settings
from hypothesis import strategies as st
from support.front_door import PASSWORDS, Door, message, open_door
from support.waiting import until
from typer.testing import CliRunner

from dashboard.data.store import Store
from dashboard.web.accounts import audit as audit_module
from dashboard.web.accounts.audit import Audit
from dashboard.web.accounts.passwords import PASSWORD_MIN, fault_of
from dashboard.web.programs.tokens import issue_token, revoke_token
from dashboard.web.users import load_users, remove_user, set_role
from gyrofree.commands.main import app
from messages.contract.topics import RATE
from tests.dashboard.test_live_api import rate

NEW = "seven grey herons wade"


@pytest.fixture(scope="module")
def door(tmp_path_factory):
    store = Store()
    store.put(RATE, "cube", "products-ekf", rate(1))
    with open_door(tmp_path_factory.mktemp("accounts"), store=store) as opened:
        yield opened


class Open:
    """A scene and a stream of one browser, as real sockets; the stream asks once in 1000 s."""

    def __init__(self, door: Door, client: httpx.Client, secret: str = "") -> None:
        self.scene = door.scene(client)
        self.scene.send(message("ViewerCameraMessage"))
        self.said: list[str] = []
        self.begun = threading.Event()
        headers = {"authorization": f"Bearer {secret}"} if secret else {}
        cookies = None if secret else dict(client.cookies)
        self._stream = threading.Thread(target=self._listen, args=(door, headers, cookies))
        self._stream.start()
        assert self.begun.wait(20.0)

    def _listen(self, door: Door, headers: dict, cookies: dict | None) -> None:
        url = door.url + "/api/devices/cube/stream?rate_hz=0.001"
        with httpx.stream("GET", url, headers=headers, cookies=cookies, timeout=60.0) as answer:
            for line in answer.iter_lines():
                self.said.append(line)
                self.begun.set()

    def stream_ended(self) -> bool:
        return not self._stream.is_alive() and "event: end" in self.said

    def scene_ended(self) -> bool:
        with contextlib.suppress(TimeoutError):
            try:
                while True:
                    self.scene.recv(timeout=0.01)
            except websockets.ConnectionClosed as closed:
                return closed.rcvd is not None and closed.rcvd.code == 1008
        return False

    def ended(self) -> bool:
        return self.scene_ended() and self.stream_ended()


def form(client: httpx.Client, **fields: str) -> dict[str, str]:
    return fields | {"csrf": client.headers["x-csrf-token"]}


def by_sign_out(door, client, anna):
    assert client.post("/logout", data=form(client)).status_code == 303


def by_role(door, client, anna):
    fields = form(anna, name="otto", role="viewer", role_only="1")
    assert anna.post("/users", data=fields).status_code == 303


def by_admin(door, client, anna):
    assert anna.post("/users", data=form(anna, name="otto", end="1")).status_code == 303


def by_removal(door, client, anna):
    assert anna.post("/users", data=form(anna, name="otto", remove="1")).status_code == 303


def by_command(door, client, anna):
    set_role(door.settings.users, "otto", "viewer")  # as another process would


def by_idleness(door, client, anna):
    door.ahead += 2.01 * 3600  # nobody did anything, the scene and the stream looked on


def by_age(door, client, anna):
    for _ in range(9):
        door.ahead += 1.4 * 3600
        client.get("/sessions")


def by_new_password(door, client, anna):
    """Of the same user, in another browser."""
    with door.client("otto") as other:
        fields = {"old": PASSWORDS["otto"], "new": NEW, "again": NEW}
        assert other.post("/account/password", data=form(other, **fields)).status_code == 303
        assert other.get("/api/me").status_code == 200  # this one goes on, with another cookie


WAYS = (
    by_sign_out,
    by_role,
    by_admin,
    by_new_password,
    by_command,
    by_idleness,
    by_age,
    by_removal,
)


@pytest.mark.parametrize("way", WAYS)
def test_whatever_ends_a_right_ends_what_is_open_under_it(door: Door, way):
    before = door.settings.users.read_text()
    try:
        with door.client("anna") as anna, door.client("otto") as client:
            with door.client("vera") as vera:
                mine, hers = Open(door, client), Open(door, vera)
                way(door, client, anna)
                until(mine.ended, "the end of scene and stream")
                assert client.get("/api/me").status_code == 401
                if way not in (by_idleness, by_age):
                    assert not hers.scene_ended() and hers._stream.is_alive()
                vera.post("/logout", data=form(vera))
                until(hers.stream_ended, "the end of the other stream")
    finally:
        door.settings.users.write_text(before)
        door.ahead = 0.0


def test_a_revoked_token_ends_its_stream(door: Door):
    secret, entry = issue_token(door.settings.users, "otto", "test", "viewer", 1.0)
    with door.client("otto") as client, door.client("anna") as anna:
        mine = Open(door, client, secret)
        assert anna.post("/users/tokens", data=form(anna, revoke=entry.id)).status_code == 303
        until(mine.stream_ended, "the end of the stream")
        assert not mine.scene_ended()
        mine.scene.close()
    with pytest.raises(ValueError):
        revoke_token(door.settings.users, entry.id)


def test_one_sees_ones_sign_ins_and_ends_one_or_all_others(door: Door):
    with door.client("vera") as here, door.client("vera") as there, door.client("vera") as third:
        with door.client("otto") as other:
            there.headers["user-agent"] = "x"
            page = here.get("/account").text
            keys = re.findall(r'name="key" value="([0-9a-f]{16})"', page)
            assert len(keys) == 2 and page.count("this one") == 1 and "127.0.0.1" in page
            for key in keys:  # not those of somebody else
                other.post("/account/end", data=form(other, key=key))
            assert there.get("/api/me").status_code == third.get("/api/me").status_code == 200
            here.post("/account/end", data=form(here, key=keys[0]))
            assert {there.get("/api/me").status_code, third.get("/api/me").status_code} == {
                200,
                401,
            }
            here.post("/account/end", data=form(here, key="others"))
            codes = [one.get("/api/me").status_code for one in (here, there, third, other)]
            assert codes == [200, 401, 401, 200]


def test_a_sign_in_too_many_ends_the_oldest_of_that_user(tmp_path):
    with (
        open_door(tmp_path, scene=False, sign_ins_per_user=2) as door,
        contextlib.ExitStack() as up,
    ):
        other = up.enter_context(door.client("vera"))
        mine = []
        for _ in range(3):
            mine.append(up.enter_context(door.client("otto")))
            door.ahead += 1.0
        assert [one.get("/api/me").status_code for one in (*mine, other)] == [401, 200, 200, 200]


def test_values_asked_for_by_a_page_are_no_use_of_a_sign_in(tmp_path):
    with open_door(tmp_path, scene=False) as door, door.client("otto") as client:
        for _ in range(3):
            door.ahead += 0.7 * 3600
            code = client.get("/api/me").status_code
        assert code == 401


def test_a_password_is_changed_by_who_knows_the_old_one(tmp_path):
    with open_door(tmp_path, scene=False) as door, door.client("otto") as client:
        old = PASSWORDS["otto"]
        for fields, text in (
            ({"old": "wrong", "new": NEW, "again": NEW}, "old password is wrong"),
            ({"old": old, "new": NEW, "again": NEW + "x"}, "differ"),
            ({"old": old, "new": old, "again": old}, "is the old one"),
            ({"old": old, "new": "short", "again": "short"}, "5 characters"),
            ({"old": old, "new": "Password1234!", "again": "Password1234!"}, "tried first"),
        ):
            answer = client.post("/account/password", data=form(client, **fields))
            assert answer.status_code == 422 and text in answer.text
        before = client.cookies[door.settings.cookie]
        fields = form(client, old=old, new=NEW, again=NEW)
        assert client.post("/account/password", data=fields).status_code == 303
        assert client.cookies[door.settings.cookie] != before
        assert load_users(door.settings.users)["otto"].role.name == "operator"
        with door.client() as again:
            for word, code in ((old, 401), (NEW, 303)):
                answer = again.post("/login", data={"name": "otto", "password": word})
                assert answer.status_code == code


@pytest.mark.parametrize(
    "word",
    "Password1234! passwordpassword P@ssw0rd!!2024 qwertyuiop12 1234567890123 aaaaaaaaaaaaa"
    " abcdefghijklmn letmeinletmein iloveyou2024! admin@gyrofree 12qwertyuiop34 Summer2026!!!!"
    " asdfghjkl;1234 zyxwvutsrqpon 1qaz2wsx3edc annaannaanna7 anna-password9"
    " ababababababab".split(),
)
def test_passwords_that_are_tried_first_are_refused(word):
    assert len(word) >= PASSWORD_MIN and fault_of(word, "anna")


@pytest.mark.parametrize(
    "word",
    [*PASSWORDS.values(), NEW, "korrektes pferd batterie", "Vb7-kQ2x-mZ9p", "каша из топора"],
)
def test_long_ones_of_any_kind_are_taken(word):
    assert fault_of(word, "nina") == ""


@settings(max_examples=300, deadline=None)
@given(st.text(max_size=300), st.text(max_size=20))
def test_any_password_is_judged(word, name):
    assert (fault_of(word, name) == "") <= (PASSWORD_MIN <= len(word) <= 256)


def test_every_act_is_written_down_and_admins_read_it(tmp_path):
    with open_door(tmp_path, scene=False) as door:
        with door.client("anna") as anna, door.client("vera") as vera:
            with door.client() as nobody:
                nobody.post("/login", data={"name": "otto\n<b>x", "password": "guess"})
                nobody.get("/api/me", headers={"authorization": "Bearer gyf_none"})
            vera.post("/api/recording/stop")
            assert vera.get("/audit").status_code == 403
            anna.post("/users", data=form(anna, name="nina", password=NEW, role="viewer"))
            made = ["users", "token", "create", "nina", "--name", "log"]
            config = tmp_path / "gyrofree.toml"
            config.write_text(f'[dashboard]\nusers = "{door.settings.users}"\n')
            assert CliRunner().invoke(app, [*made, "--config", str(config)]).exit_code == 0
            remove_user(door.settings.users, "nina")
            page = anna.get("/audit?q=").text
        path = door.settings.users.with_name("users.json.audit")
        assert stat.S_IMODE(path.stat().st_mode) == 0o600
        lines = [json.loads(line) for line in path.read_text().splitlines()]
        said = {(one["who"], one["what"], one["result"]) for one in lines}
        for act in (
            ("otto\N{SYMBOL FOR NEWLINE}<b>x", "password", "refused"),
            ("", "API token", "refused"),
            ("vera", "POST /api/recording/stop", "refused"),
            ("vera", "GET /audit", "refused"),
            ("anna", "sign-in", "done"),
            ("anna", "user made or changed, viewer", "done"),
        ):
            assert act in said or act[0].startswith("otto"), act
        assert any(one["what"] == "token made" and not one["address"] for one in lines)
        assert all(abs(one["utc_s"] - time.time()) < 300 for one in lines)
        assert "<b>x" not in page and "&lt;b&gt;x" in page and "refused" in page
        assert NEW not in path.read_text() and "guess" not in path.read_text()


def test_the_log_of_acts_is_bounded_and_survives_damage(tmp_path, monkeypatch):
    monkeypatch.setattr(audit_module, "LARGEST", 20_000)
    log = Audit(tmp_path / "users.json")
    for k in range(1000):
        log.done("act", f"user {k}", "127.0.0.1", "x" * 1000)
    files = sorted(tmp_path.iterdir())
    assert len(files) == 2 and all(path.stat().st_size < 21_000 for path in files)
    with log.path.open("ab") as stream:
        stream.write(b'{"utc_s": 1\n\xff\xfe\n{"who": "half')
    newest = log.newest(5)
    assert [one.who for one in newest] == [f"user {k}" for k in range(999, 994, -1)]
    assert log.damaged == 3 and log.newest(5, "USER 998 act")[0].who == "user 998"
    stamp = json.loads(log._tail()[10])["utc_s"]
    assert not log.newest(5, str(stamp)), "a time in seconds is no text that people look for"
    away = Audit(tmp_path / "users.json.audit" / "not a folder")
    away.done("act", "user")
    assert away.lost == 1
