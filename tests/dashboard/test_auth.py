"""Sign-in: users file, cookie, waiting times, one-time links, expiry."""

import json
import stat
import time
from concurrent.futures import ThreadPoolExecutor

import pytest
from support.front_door import PASSWORDS, Door, form_token, open_door

from dashboard.web.auth import Backoff, WaitError
from dashboard.web.users import (
    UsersError,
    add_user,
    demo_link,
    issue_link_token,
    load_users,
    remove_user,
)


@pytest.fixture
def door(tmp_path):
    with open_door(tmp_path, scene=False) as opened:
        yield opened


def sign_in(client, name, password):
    return client.post("/login", data={"name": name, "password": password})


def test_users_file_is_private_and_holds_no_password(tmp_path):
    path = tmp_path / "state" / "users.json"
    add_user(path, "anna", "a long password", "admin")
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert "a long password" not in path.read_text()
    assert load_users(path)["anna"].hash.startswith("$argon2id$")
    remove_user(path, "anna")
    assert load_users(path) == {}


@pytest.mark.parametrize(
    ("name", "password", "role", "text"),
    [
        ("../anna", "a long password", "admin", "user name"),
        ("anna", "short", "admin", "5 characters"),
        ("anna", "a long password", "root", "viewer, operator, admin"),
        ("annaannaanna", "annaannaanna", "admin", "equals"),
        ("anna", "x" * 257, "admin", "257 characters"),
    ],
)
def test_unacceptable_users_are_refused_with_the_reason(tmp_path, name, password, role, text):
    with pytest.raises(UsersError, match=text):
        add_user(tmp_path / "users.json", name, password, role)


def test_damaged_users_file_names_itself(tmp_path):
    path = tmp_path / "users.json"
    path.write_text('{"users": [1')
    with pytest.raises(UsersError, match="users.json"):
        load_users(path)


def test_cookie_is_closed_to_scripts_and_other_sites(door: Door):
    with door.client() as client:
        answer = sign_in(client, "otto", PASSWORDS["otto"])
        cookie = answer.headers["set-cookie"].lower()
        assert "httponly" in cookie and "samesite=strict" in cookie
        assert client.get("/api/me").json()["role"] == "operator"


def test_behind_tls_the_cookie_is_bound_to_the_host(tmp_path):
    with open_door(tmp_path, scene=False, secure_cookies=True) as door, door.client() as client:
        answer = client.post(
            "/login",
            data={"name": "otto", "password": PASSWORDS["otto"]},
            headers={"origin": door.url.replace("http", "https")},
        )
        cookie = answer.headers["set-cookie"]
        assert cookie.startswith("__Host-gyrofree=") and "Secure" in cookie and "Path=/" in cookie
        assert "Domain" not in cookie
        assert "max-age" in answer.headers["strict-transport-security"]
        assert client.post("/login").status_code == 403  # an http origin is another site now


def test_wrong_name_and_wrong_password_look_the_same(door: Door):
    with door.client() as client:
        answers = [
            sign_in(client, "otto", "not the password"),
            sign_in(client, "nobody", "not the password"),
        ]
        texts = {
            answer.text.replace("otto", "NAME").replace("nobody", "NAME") for answer in answers
        }
    assert {answer.status_code for answer in answers} == {401} and len(texts) == 1


def test_guessing_has_to_wait_and_waiting_ends(door: Door):
    door.frozen = time.time()
    with door.client() as client:
        codes = [sign_in(client, "otto", f"guess number {i}").status_code for i in range(4)]
        assert codes == [401, 401, 401, 429]
        refused = sign_in(
            client, "otto", PASSWORDS["otto"]
        )  # not even the right one, else guessing goes on
        assert refused.status_code == 429 and int(refused.headers["retry-after"]) >= 1
        door.ahead += 5.0
        assert sign_in(client, "otto", PASSWORDS["otto"]).status_code == 303


def test_parallel_guesses_gain_nothing(door: Door):
    def guess(i: int) -> int:
        with door.client() as client:
            return sign_in(client, "otto", f"guess number {i}").status_code

    door.frozen = time.time()
    with ThreadPoolExecutor(8) as pool:
        codes = list(pool.map(guess, range(12)))
    assert (
        codes.count(401) == door.settings.free_attempts
        and codes.count(429) == 12 - door.settings.free_attempts
    )


def test_waiting_time_doubles_up_to_its_limit_and_counts_ipv6_networks():
    now = 0.0
    backoff = Backoff(2, 60.0, lambda: now)
    waits = []
    backoff.attempt("2001:db8::1", "otto")
    for host in range(12):
        backoff.attempt(f"2001:db8::{host}", f"{host}")
        with pytest.raises(WaitError) as wait:
            backoff.attempt("2001:db8::ffff:2", "otto")  # another address of the same /64
        waits.append(wait.value.seconds)
        now += wait.value.seconds
    assert waits[:4] == [1.0, 2.0, 4.0, 8.0] and max(waits) == 60.0


@pytest.mark.parametrize("hours", [2.01, 12.01])
def test_an_unused_or_old_session_ends(door: Door, hours):
    with door.client("otto") as client:
        if hours > 12:
            for _ in range(8):  # used all the time
                door.ahead += 1.49 * 3600
                assert client.get("/sessions").status_code == 200
            hours -= 8 * 1.49
        door.ahead += hours * 3600
        assert client.get("/api/me").status_code == 401


def test_signing_out_removing_a_user_and_a_new_password_end_the_session(door: Door):
    with door.client("otto") as client:
        cookies = dict(client.cookies)
        assert client.post("/logout", data={"csrf": "wrong"}).status_code == 403
        client.post("/logout", data={"csrf": client.headers["x-csrf-token"]})
        client.cookies.update(cookies)  # a stolen copy of the cookie
        assert client.get("/api/me").status_code == 401
    with door.client("vera") as client:
        remove_user(door.settings.users, "vera")
        assert client.get("/api/me").status_code == 401
    with door.client("anna") as client:
        entries = json.loads(door.settings.users.read_text())
        entries["users"]["anna"]["created"] = time.time() + 5
        door.settings.users.write_text(json.dumps(entries))
        assert client.get("/api/me").status_code == 401


def test_a_restarted_dashboard_still_knows_who_is_signed_in(door: Door):
    with door.client("otto") as client:
        (token,) = client.cookies.values()
        assert token not in door.settings.users.with_name("users.json.signed-in").read_text()
        door.front.gate._sessions = door.new_gate()._sessions
        assert client.get("/api/me").json()["user"] == "otto"


def test_one_time_link_works_once_and_looking_does_not_use_it(door: Door):
    link = demo_link(door.settings.users, door.url)
    token = link.split("token=")[1]
    with door.client() as client:
        for _ in range(2):
            assert client.get(link).status_code == 200
        assert client.get("/api/me").status_code == 401
        assert client.post("/login/link", data={"token": token}).status_code == 303
        assert client.get("/api/me").json() | {"csrf": ""} == {
            "user": "demo",
            "role": "operator",
            "csrf": "",
        }
    with door.client() as client:
        assert client.post("/login/link", data={"token": token}).status_code == 403
        assert client.get("/api/me").status_code == 401


def test_one_time_link_expires_and_cannot_be_made_for_nobody(door: Door):
    token = issue_link_token(door.settings.users, "otto", 60.0)
    door.ahead += 61.0
    with door.client() as client:
        assert client.post("/login/link", data={"token": token}).status_code == 403
        assert client.post("/login/link", data={"token": "../users.json"}).status_code == 403
    with pytest.raises(UsersError, match="no user 'nobody'"):
        issue_link_token(door.settings.users, "nobody")


def test_requests_from_other_sites_are_refused(door: Door):
    with door.client() as client:
        for headers in (
            {"origin": "http://evil.example"},
            {"origin": "null"},
            {"origin": door.url, "sec-fetch-site": "cross-site"},
            {"origin": door.url.replace("127.0.0.1", "127.0.0.1.evil.example")},
        ):
            data = {"name": "otto", "password": PASSWORDS["otto"]}
            assert client.post("/login", data=data, headers=headers).status_code == 403


def test_admin_manages_users_on_the_page_and_nobody_else(door: Door):
    new = {"name": "nina", "password": "a new password", "role": "viewer"}
    with door.client("otto") as client:
        assert client.get("/users").status_code == 403
        assert (
            client.post("/users", data=new | {"csrf": client.headers["x-csrf-token"]}).status_code
            == 403
        )
    with door.client("anna") as client:
        token = form_token(client.get("/users").text)
        assert client.post("/users", data=new).status_code == 403  # without the token
        assert client.post("/users", data=new | {"csrf": token}).status_code == 303
        assert "nina" in client.get("/users").text
        client.post("/users", data={"name": "nina", "remove": "1", "csrf": token})
        assert "nina" not in load_users(door.settings.users)
        assert (
            client.post("/users", data={"name": "anna", "remove": "1", "csrf": token}).status_code
            == 422
        )


def test_damaged_users_file_lets_nobody_in_and_says_where_to_look(door: Door):
    with door.client("otto") as client:
        door.settings.users.write_text("{")
        answer = client.get("/api/me")
        assert answer.status_code == 503 and "log" in answer.json()["error"]
