"""What a hostile visitor or user of the page tries that has no test elsewhere."""

import hashlib
import socket
import time
from concurrent.futures import ThreadPoolExecutor

import httpx
import pytest
from support.front_door import PASSWORDS, Door, open_door
from support.waiting import until

from dashboard.web.accounts.audit import EACH, Audit
from dashboard.web.accounts.provider import Attempt
from dashboard.web.accounts.provider_pages import ATTEMPTS_EACH, _remember
from dashboard.web.jobs import Jobs
from dashboard.web.users import (
    UsersError,
    add_user,
    load_users,
    remove_user,
    set_password,
    set_role,
)


@pytest.fixture
def door(tmp_path):
    with open_door(tmp_path, scene=False) as opened:
        yield opened


def sign_in(client, name, password):
    return client.post("/login", data={"name": name, "password": password}).status_code


def test_who_has_a_password_cannot_guess_at_anothers_in_between(door: Door):
    door.frozen = time.time()
    guesses, waited = 0, 0.0
    with door.client() as client:
        while guesses < 10:
            code = sign_in(client, "anna", f"guess number {guesses}")
            if code == 429:
                door.ahead, waited = door.ahead + 1.0, waited + 1.0
                continue
            assert code == 401
            guesses += 1
            while sign_in(client, "vera", PASSWORDS["vera"]) == 429:
                door.ahead, waited = door.ahead + 1.0, waited + 1.0
    assert waited > 60.0  # each guess costs twice as long as the one before


def test_an_address_that_a_request_makes_up_is_not_believed(door: Door):
    """No proxy of ours is set: each guess under another name, from another made up address."""
    door.frozen = time.time()
    with door.client() as client:
        for number in range(200):
            client.headers["x-forwarded-for"] = f"10.0.{number}.1"
            client.headers["forwarded"] = f"for=10.0.{number}.1"
            if sign_in(client, f"name{number}", "a guess") == 429:
                break
        else:
            raise AssertionError("two hundred guesses from one address")


def test_of_two_who_change_users_at_once_neither_is_lost(tmp_path):
    path, names = tmp_path / "users.json", [f"user-{number}" for number in range(4)]
    for name in ("removed", "demoted", *names):
        add_user(path, name, "five words of their own", "admin")
    deeds = [
        lambda name=name: add_user(path, name, "six words of his own", "viewer") for name in names
    ]
    deeds += [lambda: remove_user(path, "removed"), lambda: set_role(path, "demoted", "viewer")]
    with ThreadPoolExecutor(len(deeds)) as several:
        for done in [several.submit(deed) for deed in deeds]:
            done.result()
    assert {user.role.name for user in load_users(path).values()} == {"viewer"}
    assert sorted(load_users(path)) == sorted(["demoted", *names])
    with pytest.raises(UsersError, match="no user 'removed' any more"):
        set_password(path, "removed", "seven words of his own")


def asked(door: Door, request: str) -> str:
    """The answer to these very lines."""
    with socket.create_connection(("127.0.0.1", door.settings.port)) as line:
        text = request.replace("HOST", f"localhost:{door.settings.port}").replace("\n", "\r\n")
        line.sendall(text.encode())
        line.settimeout(20.0)
        found = b""
        while part := line.recv(65536):
            found += part
    return found.decode()


def test_a_body_whose_length_is_said_in_two_ways_hides_no_request(door: Door):
    smuggled = "GET /api/health HTTP/1.1\nHost: HOST\n\n"
    head = "POST /login HTTP/1.1\nHost: HOST\nContent-Length: 5\nTransfer-Encoding: chunked\n\n"
    answer = asked(door, f"{head}0\n\n{smuggled}")
    assert answer.startswith("HTTP/1.1 400") and answer.count("HTTP/1.1") == 1


def test_what_is_no_http_is_refused_with_the_same_headers(door: Door):
    answer = asked(door, "GET /login\n\n")
    assert (
        answer.startswith("HTTP/1.1 400") and "content-security-policy: default" in answer.lower()
    )


def test_a_download_ends_with_the_sign_in(door: Door):
    script = 'mkdir -p "$2"; truncate -s 800M "$2/all.csv"'
    door.front.jobs = Jobs(["sh", "-c", script, "sh"])
    number = door.front.jobs.start("export", "a-session", [], "otto").number
    until(lambda: door.front.jobs.get(number).state == "done", "the files are there")
    with door.client("vera") as client, pytest.raises(httpx.RemoteProtocolError):
        with client.stream("GET", f"/api/jobs/{number}/download") as answer:
            assert answer.status_code == 200
            pieces = answer.iter_raw()
            next(pieces)
            remove_user(door.settings.users, "vera")
            time.sleep(1.2)
            for _ in pieces:
                pass
    door.front.jobs.close()


def test_a_flood_of_refusals_leaves_the_audit_log_readable(tmp_path):
    audit = Audit(tmp_path / "users.json")
    audit.done("recording started", "otto", "10.0.0.1")
    for number in range(3000):
        audit.refused(f"POST /api/{number}", f"name {number}", f"2001:db8::{number:x}")
    audit.refused("password", "anna", "10.0.0.2")
    entries = audit.newest(5000)
    assert EACH < len(entries) < EACH + 20
    assert (entries[0].who, entries[-1].who) == ("anna", "otto")
    assert "the 2048th refusal from there" in entries[1].detail


def test_a_flood_of_ways_to_the_provider_pushes_nobody_else_out():
    attempts: dict[str, Attempt] = {}
    _remember(attempts, mine := Attempt("/", "10.0.0.1"))
    for _ in range(2000):
        _remember(attempts, Attempt("/", "10.0.0.2"))
    assert mine in attempts.values() and len(attempts) == 1 + ATTEMPTS_EACH


def test_while_the_users_file_is_damaged_nobody_loses_the_command(door: Door):
    with door.client("otto") as client:
        (cookie,) = client.cookies.values()
        seat = door.front.seats.of_key(hashlib.sha256(cookie.encode()).hexdigest())
        whole = door.settings.users.read_text()
        door.settings.users.write_text(whole[:50])
        assert door.front.seats.alive(seat)  # its thread goes on
        door.settings.users.write_text(whole)
        remove_user(door.settings.users, "otto")
        assert not door.front.seats.alive(seat)
