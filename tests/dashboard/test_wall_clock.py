"""Sign-ins and links while the wall clock is set: they live as long as time has really passed."""

import json
import subprocess
import sys

import pytest
from support.wall_clock import YEAR_S, WallClock

SERVE = """
import json, sys, time
from dashboard.settings import DashboardSettings
from dashboard.web.auth import Gate, WaitError
from dashboard.web.users import Role, UserStore, add_user, issue_link_token
from pathlib import Path
users = Path(sys.argv[1])
if not users.exists():
    add_user(users, "anna", "one long password", Role.operator)
gate = Gate(DashboardSettings(users=users), UserStore(users))
key = None
for line in sys.stdin:
    what = line.split()[0]
    if what == "link":
        said = issue_link_token(users, "anna")
    elif what == "redeem":
        key = gate.redeem(line.split()[1], "10.0.0.1")
        said = key is not None
    elif what == "known":
        said = [gate.look_up(one) is not None for one in list(gate._sessions)]
    elif what == "ages":
        said = [gate._clock() - one.created for one in gate._sessions.values()]
    elif what == "guess":
        try:
            gate.backoff.attempt("10.0.0.2", "anna")
            said = 0.0
        except WaitError as error:
            said = error.seconds
    print(json.dumps(said), flush=True)
"""


class Serving:
    def __init__(self, wall: WallClock, users) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-c", SERVE, str(users)],
            env=wall.environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def ask(self, what: str):
        self.process.stdin.write(what + "\n")
        self.process.stdin.flush()
        return json.loads(self.process.stdout.readline())

    def end(self) -> None:
        self.process.stdin.close()
        self.process.wait()


@pytest.mark.parametrize("offset_s", [-YEAR_S, YEAR_S])
def test_a_set_wall_clock_ends_no_sign_in_and_keeps_none_alive(tmp_path, offset_s):
    wall = WallClock(tmp_path / "wall")
    serving = Serving(wall, tmp_path / "users.json")
    link, later = serving.ask("link"), serving.ask("link")
    assert serving.ask(f"redeem {link}")
    waits = [serving.ask("guess") for _ in range(12)]
    assert waits[0] == 0.0 and 0.0 < waits[-1] <= 60.0
    wall.set(offset_s)
    assert serving.ask("known") == [True]
    assert 0.0 <= serving.ask("ages")[0] < 120.0
    assert serving.ask("guess") <= 60.0
    assert serving.ask(f"redeem {later}")  # made before the step
    assert serving.ask(f"redeem {serving.ask('link')}")  # and after it
    serving.end()
    again = Serving(wall, tmp_path / "users.json")
    assert all(0.0 <= age < 240.0 for age in again.ask("ages"))
    assert again.ask("known") == [True] * 3
    again.end()
