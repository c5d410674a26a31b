"""What a hostile visitor or user of the page tries that has no test elsewhere."""

import time
from concurrent.futures import ThreadPoolExecutor

import pytest
from support.front_door import PASSWORDS, Door, open_door

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
