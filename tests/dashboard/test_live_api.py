"""Live values and API tokens through a real server: who may ask, unknown as null, streams."""

import contextlib
import json
import stat
import subprocess
import sys
import time
from pathlib import Path

import httpx
import pytest
from support.front_door import open_door
from support.waiting import until
from typer.testing import CliRunner

from dashboard.data.store import Store
from dashboard.web.programs import tokens
from dashboard.web.programs.tokens import Token, issue_token, load_tokens, revoke_token, tokens_file
from dashboard.web.users import UsersError, remove_user, write_private
from gyrofree.commands.main import app
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import NAV, RATE, STATUS


def rate(k, sight=(0, 1, 2), estimator="products-ekf"):
    m = pb.RateBatch(estimator=estimator, for_index=k, period_s=0.01, index_step=1)
    m.header.device, m.header.utc_ns, m.header.sequence = "cube", 1_700_000_000_000_000_000 + k, k
    m.header.source = pb.SOURCE_SIMULATED
    m.omega_ib_b_radps.extend([0.0, 0.0, 0.0, 1.0, 2.0, 3.0])
    m.omega_covariance.extend([100.0, 0, 0, 0, 100.0, 0, 0, 0, 100.0])
    m.omega_covariance.extend([0.01, 0, 0, 0, 0.04, 0, 0, 0, 100.0])
    m.sight.extend([2, 2, 2, *sight])
    m.sight_reason = "turns about z"
    m.q_nb.extend([1.0, 0, 0, 0] * 2)
    return m


@pytest.fixture
def door(tmp_path):
    store = Store()
    store.put(RATE, "cube", "products-ekf", rate(1))
    with open_door(tmp_path, scene=False, store=store) as opened:
        yield opened


def token_of(door, user="vera", role="viewer", days=1.0):
    return issue_token(door.settings.users, user, "test", role, days)


@contextlib.contextmanager
def bearer(door, secret):
    headers = {"authorization": f"Bearer {secret}"}
    with httpx.Client(base_url=door.url, headers=headers, timeout=20.0) as client:
        yield client


def test_the_newest_values_say_unknown_as_null(door):
    secret, _ = token_of(door)
    with bearer(door, secret) as client:
        said = client.get("/api/devices/cube/rate").json()
        assert said["omega_radps"] == [1.0, 2.0, None]
        assert said["sight"] == ["valid", "ambiguous", "blind"] and said["why"] == "turns about z"
        assert said["sigma_radps"] == pytest.approx([0.1, 0.2, 10.0]) and said["simulated"]
        assert said["utc_s"] == pytest.approx(1_700_000_000.01)
        assert client.get("/api/devices/cube/attitude").json()["q_nb"] == [1.0, 0.0, 0.0, 0.0]
        door.front.store.put(RATE, "cube", "products-ekf", rate(2, (2, 2, 2)))
        assert client.get("/api/devices/cube/rate").json()["omega_radps"] == [None] * 3
        assert client.get("/api/devices/cube/attitude").json()["q_nb"] is None
        answer = client.get("/api/devices/cube/nav")
        assert answer.status_code == 404 and "its nav" in answer.json()["error"]
        waiting = pb.NavSolution(estimator="kf", mode=pb.NavSolution.MODE_COURSE, alignment="drive")
        waiting.header.device, waiting.header.utc_ns = "cube", 1_700_000_000_000_000_000
        door.front.store.put(NAV, "cube", "kf", waiting)
        nav = client.get("/api/devices/cube/nav").json()
        assert nav["mode"] == "course" and nav["why"] == "drive"
        assert nav["latitude_deg"] is None and nav["v_n_mps"] is None
        for path in ("none/rate", "cube/rate?estimator=other"):
            assert client.get(f"/api/devices/{path}").status_code == 404


def clocks(store, here_s, gateway_s, bound_s=0.02, recorder_s=float("nan")):
    """What this dashboard, the gateway and the recorder say of their clocks."""
    store.presence.own = "dashboard"
    store.presence.look(0.0)
    for role, ahead_s in (("dashboard", here_s), ("gateway", gateway_s), ("recorder", recorder_s)):
        beat = pb.Beat(role=role, session=role, clock_ahead_s=ahead_s, clock_bound_s=bound_s)
        beat.devices.extend(["cube"] if role == "gateway" else [])
        store.presence.beat("lab", f"{role}-1", beat)


def test_values_say_how_old_they_are_by_the_clock_of_the_site(door):
    secret, _ = token_of(door)
    store, ages = door.front.store, ("site_age_s", "site_age_bound_s")

    def two_seconds_old(k):
        m = rate(k)
        m.header.utc_ns, m.header.utc_sigma_s = time.time_ns() - 2_000_000_000, 0.01
        store.put(RATE, "cube", "products-ekf", m)

    with bearer(door, secret) as client:
        said = client.get("/api/devices/cube/rate").json()
        assert [said[name] for name in ages] == [None, None]
        assert "this clock" in said["site_age_why"]
        clocks(store, here_s=5.0, gateway_s=float("nan"))
        said = client.get("/api/devices/cube/rate").json()
        assert said["site_age_s"] is None and "gateway's clock" in said["site_age_why"]
        clocks(store, here_s=500.0, gateway_s=-100.0)
        for k in (3, 4):  # another time is believed when a second message agrees
            two_seconds_old(k)
        before = time.time()
        said = client.get("/api/devices/cube/rate").json()
        # ours is ahead by 500 s, its gateway's behind by 100 s; the newest row is 0.01 s younger
        age_s = said["site_age_s"] + 600.0 - 1.99
        assert 0.0 <= age_s + 1e-3 and age_s <= time.time() - before + 5.0
        assert said["site_age_bound_s"] == pytest.approx(0.02 + 0.02 + 3 * 0.01)
        assert said["site_age_why"] == ""
        with client.stream("GET", "/api/devices/cube/stream") as stream:
            line = next(line for line in stream.iter_lines() if line.startswith("data: "))
            assert json.loads(line[6:])["site_age_s"] == pytest.approx(said["site_age_s"], abs=5.0)
        where = client.get("/api/devices/cube/map").json()
        assert where["site_age_s"] == pytest.approx(said["site_age_s"], abs=5.0)
        assert "not been heard" in client.get("/api/recording").json()["site_age_why"]
        status = pb.RecorderStatus(recording=True, clock_offset_s=1.0)
        status.header.utc_ns = time.time_ns()
        store.put(STATUS, "", "", status)
        assert "recorder's clock" in client.get("/api/recording").json()["site_age_why"]
        clocks(store, here_s=0.0, gateway_s=0.0, recorder_s=4.0)
        assert client.get("/api/recording").json()["site_age_s"] == pytest.approx(3.0, abs=5.0)
        assert client.get("/api/recording").json()["site_age_bound_s"] == pytest.approx(0.04)
        store.put(RATE, "cube-replay", "products-ekf", rate(4))
        said = client.get("/api/devices/cube-replay/rate").json()
        assert said["site_age_s"] is None and "replay" in said["site_age_why"]
        schemas = client.get("/api/openapi.json").json()["components"]["schemas"]
        for name in ("RateOut", "AttitudeOut", "NavOut", "RecordingOut"):
            assert set(ages) <= schemas[name]["properties"].keys()


def test_a_token_gives_what_its_role_gives_and_no_page(door):
    secret, entry = token_of(door)
    with bearer(door, secret) as client:
        assert client.get("/api/me").json() == {"user": "vera", "role": "viewer", "csrf": ""}
        refused = client.post("/api/recording/start", json={})
        assert refused.status_code == 403 and "takes the role operator" in refused.json()["error"]
        assert client.get("/users").status_code == 401  # pages are for people
        assert client.post("/users/tokens", data={"user": "vera"}).status_code == 401
    operator, _ = token_of(door, "otto", "operator")
    with bearer(door, operator) as client:  # no bus here: it passed, and that is said
        assert client.post("/api/recording/start", json={}).status_code == 503
    with pytest.raises(UsersError, match="cannot be operator"):
        token_of(door, "vera", "operator")
    text = tokens_file(door.settings.users).read_text()
    assert secret not in text and load_tokens(door.settings.users)[entry.id].hash in text
    assert stat.S_IMODE(tokens_file(door.settings.users).stat().st_mode) == 0o600


@pytest.mark.parametrize("end", ["revoked", "over", "user gone", "wrong", "in the address"])
def test_a_token_that_is_none_opens_nothing(door, end):
    secret, entry = token_of(door)
    users = door.settings.users
    if end == "revoked":
        revoke_token(users, entry.id)
    elif end == "over":
        old = Token(
            **{
                **entry.__dict__,
                "created": time.time() - 9e4,
                "ends": time.time() - 1.0,
                "moment": [],
            }
        )
        whole = {"version": 1, "tokens": [old.__dict__]}
        write_private(tokens_file(users), json.dumps(whole))
    elif end == "user gone":
        remove_user(users, "vera")
    elif end == "wrong":
        secret += "x"
    before = door.front.gate.tokens.refused
    if end == "in the address":
        with httpx.Client(base_url=door.url) as client:
            answer = client.get("/api/devices/cube/rate", params={"token": secret})
            assert answer.status_code == 401
        return
    with bearer(door, secret) as client:
        answer = client.get("/api/devices/cube/rate")
        assert answer.status_code == 401 and answer.headers["www-authenticate"] == "Bearer"
        assert door.front.gate.tokens.refused == before + 1
        codes = [client.get("/api/devices").status_code for _ in range(6)]
        assert codes[-1] == 429  # who tries has to wait


def test_too_many_requests_are_refused_counted_and_shown(door, monkeypatch):
    secret, entry = token_of(door)
    monkeypatch.setattr(tokens, "PER_SECOND", 1e-3)
    door.front.gate.tokens.uses[entry.id] = tokens.Use(left=3.0)
    with bearer(door, secret) as client:
        codes = [client.get("/api/health").status_code for _ in range(3)]
        assert codes == [200] * 3
        codes = [client.get("/api/devices/cube/rate").status_code for _ in range(3)]
        assert codes == [200] * 3
        answer = client.get("/api/devices/cube/rate")
        assert answer.status_code == 429 and int(answer.headers["retry-after"]) >= 1
    use = door.front.gate.tokens.uses[entry.id]
    assert use.requests == 3 and use.limited == 1
    with door.client("anna") as client:
        page = client.get("/users", headers={"accept": "text/html"}).text
        assert entry.id in page and "1 too many" in page and secret not in page


def test_tokens_are_made_and_revoked_on_the_users_page(door):
    with door.client("anna") as client:
        form = {"csrf": client.headers["x-csrf-token"], "user": "otto", "name": "logger"}
        made = client.post("/users/tokens", data={**form, "role": "operator", "days": "7"})
        secret = made.text.partition('id="secret">')[2].partition("<")[0]
        assert secret.startswith("gyf_") and secret not in client.get("/users").text
        with bearer(door, secret) as program:
            assert program.get("/api/me").json()["role"] == "operator"
        bad = client.post("/users/tokens", data={**form, "role": "admin", "days": "7"})
        assert bad.status_code == 422 and "cannot be admin" in bad.text
        (entry,) = load_tokens(door.settings.users).values()
        client.post("/users/tokens", data={"csrf": form["csrf"], "revoke": entry.id})
        assert not load_tokens(door.settings.users)
        with bearer(door, secret) as program:
            assert program.get("/api/me").status_code == 401
    with door.client("otto") as client:
        form = {"csrf": client.headers["x-csrf-token"], "revoke": "x"}
        assert client.post("/users/tokens", data=form).status_code == 403


def events(lines):
    """(name, data) of a stream of server-sent events."""
    name = ""
    for line in lines:
        if line.startswith("event: "):
            name = line.removeprefix("event: ")
        elif line.startswith("data: "):
            yield name, json.loads(line.removeprefix("data: "))


def test_a_stream_gives_each_value_once_and_ends_with_its_token(door):
    secret, entry = token_of(door)
    with bearer(door, secret) as client:
        path = "/api/devices/cube/stream?topics=rate,attitude&rate_hz=50"
        with client.stream("GET", path) as answer:
            assert answer.headers["content-type"].startswith("text/event-stream")
            found = events(answer.iter_lines())
            assert [next(found)[0] for _ in range(2)] == ["rate", "attitude"]
            door.front.store.put(RATE, "cube", "products-ekf", rate(50_000_000, (0, 0, 0)))
            name, data = next(found)
            assert name == "rate" and data["omega_radps"] == [1.0, 2.0, 3.0]
            assert next(found)[0] == "attitude"
            revoke_token(door.settings.users, entry.id)
            name, data = next(found)
            assert name == "end" and "revoked" in data["why"]
            assert next(found, None) is None
    with bearer(door, token_of(door)[0]) as client:
        assert client.get("/api/devices/cube/stream?topics=spin").status_code == 422
        assert client.get("/api/devices/none/stream").status_code == 404


def test_streams_are_limited_and_freed(door):
    kept = []
    with contextlib.ExitStack() as stack:
        client = stack.enter_context(bearer(door, token_of(door)[0]))
        for _ in range(8):
            answer = stack.enter_context(client.stream("GET", "/api/devices/cube/stream"))
            assert answer.status_code == 200
            kept.append(answer.iter_lines())  # one that is forgotten closes its line
            next(kept[-1])
        with client.stream("GET", "/api/devices/cube/stream") as many:
            assert many.status_code == 429 and "at most 8" in many.read().decode()
    with bearer(door, token_of(door)[0]) as client:

        def opens():
            with client.stream("GET", "/api/devices/cube/stream") as answer:
                return answer.status_code == 200

        until(opens, "streams that ended make room")


def test_tokens_from_the_command_line(door, tmp_path):
    config = tmp_path / "gyrofree.toml"
    config.write_text(f'[dashboard]\nusers = "{door.settings.users}"\n')
    run, more = CliRunner(), ["--config", str(config)]
    made = run.invoke(app, ["users", "token", "create", "vera", "--name", "ci job", *more])
    assert made.exit_code == 0, made.output
    secret = made.stdout.split()[-1]
    with bearer(door, secret) as client:
        assert client.get("/api/me").json()["user"] == "vera"
    listed = run.invoke(app, ["users", "token", "list", "--json", *more])
    (entry,) = json.loads(listed.stdout)
    assert entry["name"] == "ci job" and "hash" not in entry and secret not in listed.stdout
    assert run.invoke(app, ["users", "token", "revoke", entry["id"], *more]).exit_code == 0
    with bearer(door, secret) as client:
        assert client.get("/api/me").status_code == 401
    for arguments in (
        ["create", "nobody", "--name", "x"],
        ["create", "vera", "--name", "x", "--role", "admin"],
        ["revoke", "zz"],
    ):
        assert run.invoke(app, ["users", "token", *arguments, *more]).exit_code != 0


def test_the_example_reads_a_real_dashboard(door):
    secret, _ = token_of(door)
    example = Path(__file__).resolve().parents[2] / "examples" / "live_values.py"
    code = (
        "import runpy, sys\n"
        "main = runpy.run_path(sys.argv[1])['main']\n"
        "main(*sys.argv[2:4], 'cube', 2)\n"
    )
    command = [sys.executable, "-c", code, str(example), door.url, secret]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    assert "57.30 114.59 - deg/s" in done.stdout and "q_nb [1.0" in done.stdout
