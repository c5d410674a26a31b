"""Pages and REST of sessions over one another, of imports and of new estimates, over the real front
door.
"""

import json
import shutil
import sys

import pytest
from support.front_door import ended, open_door
from support.table_session import SESSION, table_root
from support.waiting import until

from dashboard.web.jobs import Jobs
from sessions.library import curves
from sessions.library.annotations import SessionNote, add_note
from sessions.recording.mcap_log import read
from sessions.replay.rerun import write_session

OTHER = "20240101-000004-other"


@pytest.fixture(scope="module")
def door(tmp_path_factory):
    folder = tmp_path_factory.mktemp("door")
    shutil.copytree(table_root() / SESSION, folder / "sessions" / SESSION)
    rows = list(read(folder / "sessions" / SESSION / "recording.mcap"))
    later = (
        (row.log_ns, row.key, row.payload) for row in rows if row.log_ns > rows[0].log_ns + 4e9
    )
    write_session(folder / "sessions", OTHER, later, "", {})
    jobs = Jobs([sys.executable, "-m", "gyrofree"], ["--config", str(folder / "gyrofree.toml")])
    (folder / "gyrofree.toml").write_text(
        f'[recorder]\nroot = "{folder / "sessions"}"\n[estimator]\nrate ='
        ' ["least-squares"]\nnavigators = []\n'
    )
    with open_door(folder, scene=False, jobs=jobs) as door:
        yield door
        door.front.readings.close()
        door.front.uploads.close()
    jobs.close()


def drawn(client, **query):
    """The answer when all recordings have been read."""

    def ask():
        answer = client.get("/api/compare", params=query)
        assert answer.status_code in (200, 202), answer.text
        return answer.json() if answer.json()["state"] == "done" else None

    return until(ask, "the curves", 120)


def test_two_sessions_come_aligned_with_few_points_and_their_notes(door):
    add_note(
        door.settings.sessions_root / OTHER,
        SessionNote(text="a nudge <b>", author="anna", at_s=2.0),
    )
    with door.client("vera") as client:
        answer = drawn(client, ids=f"{SESSION},{OTHER}", points=300)
        first, second = answer["sessions"]
        assert (first["offset_s"], second["by"]) == (0.0, "clock")
        assert second["offset_s"] == pytest.approx(4.01, abs=0.02)
        assert second["marks"][-1]["text"] == "a nudge <b>"
        assert second["marks"][-1]["t"] == pytest.approx(2.0 + second["offset_s"])
        assert all(len(line["rate"]["z"]["low"]) <= 152 for line in answer["lines"])
        assert answer["differences"][0]["rms_radps"]["z"] < 0.02
        by_hand = drawn(client, ids=f"{SESSION},{OTHER}", offsets=f"{OTHER}:-1.5")
        assert (
            by_hand["sessions"][1]["offset_s"] == -1.5 and by_hand["sessions"][1]["by"] == "given"
        )
        assert by_hand["span"] == pytest.approx([-1.5, 29.99], abs=0.02)
        part = drawn(client, ids=SESSION, begin=10.0, end=12.0, everything=True)
        assert part["window"] == [10.0, 12.0] and len(part["lines"]) == 3
        shades = drawn(client, ids=SESSION)["sessions"][0]["shades"]
        assert set(shades) == set("xyz") and {word for *_, word in shades["z"]} <= {
            "blind",
            "ambiguous",
        }
        assert all(0.0 <= a < b <= 30.02 for parts in shades.values() for a, b, _ in parts)
        assert sum(b - a for a, b, _ in shades["z"]) < sum(b - a for a, b, _ in shades["x"]) + 30.0
        page = client.get("/compare", params={"ids": f"{SESSION},{OTHER}"}).text
        assert f"/sessions/{OTHER}" in page and "compare.js" in page
    assert curves.state(door.settings.sessions_root / SESSION / "recording.mcap") == "fresh"


def test_any_curve_of_a_stretch_has_a_spectrum_or_says_why_not(door):
    with door.client("vera") as client:
        drawn(client, ids=SESSION)
        path = f"/api/sessions/{SESSION}/spectrum"
        names = [
            one["name"]
            for one in client.get(f"/api/sessions/{SESSION}/channels").json()["channels"]
        ]
        for curve in ("omega_z", "a1_x", "omega_z - omega_x * 2"):
            assert curve in names or " " in curve
            answer = client.get(path, params={"curve": curve, "begin": 3, "end": 14})
            told = answer.json()
            assert answer.status_code == 200, told
            assert "1100 values without a hole, 11 s at 100 Hz" in told["said"], told["said"]
            f, level = told["density"]["x"], told["density"]["y"]
            assert len(f) == len(level) > 50 and f[-1] == pytest.approx(50.0, rel=0.01)
            assert min(level) > 0.0 and told["allan"]["random_walk"] > 0.0
        short = client.get(path, params={"curve": "omega_z", "begin": 3, "end": 4}).json()
        assert short["density"] is None and "200 are needed" in short["said"]
        assert client.get(path, params={"curve": "no_such"}).status_code == 409
        assert client.get(path, params={"curve": "__import__('os')"}).status_code == 409


@pytest.mark.parametrize(
    ("query", "status"),
    [
        ({"ids": "20990101-000000"}, 404),
        ({"ids": f"{SESSION},{SESSION}"}, 422),
        ({"ids": "a,b,c,d,e"}, 422),
        ({"ids": SESSION, "points": 100_000}, 422),
        ({"ids": f"{SESSION},{OTHER}", "offsets": f"{OTHER}:nan"}, 422),
        ({"ids": f"{SESSION},{OTHER}", "offsets": "x:1"}, 409),
        ({"ids": f"{SESSION},{OTHER}", "align": "guess"}, 409),
        ({"ids": "../../etc"}, 404),
    ],
)
def test_what_cannot_be_compared_is_refused(door, query, status):
    with door.client("vera") as client:
        drawn(client, ids=f"{SESSION},{OTHER}")
        answer = client.get("/api/compare", params=query)
        assert answer.status_code == status, answer.text
    with door.client() as nobody:
        assert nobody.get("/api/compare", params={"ids": SESSION}).status_code == 401


def test_a_damaged_recording_says_why_it_cannot_be_drawn(door):
    folder = door.settings.sessions_root / "20240101-000009-bad"
    shutil.copytree(door.settings.sessions_root / SESSION, folder)
    facts = json.loads((folder / "session.json").read_text()) | {"id": folder.name}
    (folder / "session.json").write_text(json.dumps(facts))
    (folder / "recording.mcap").write_bytes(b"nothing of the kind")
    with door.client("vera") as client:
        answer = until(
            lambda: (
                (a := client.get("/api/compare", params={"ids": folder.name})).status_code == 409
                and a
            ),
            "fault",
            60,
        )
        assert "no message in it" in answer.json()["error"]
    shutil.rmtree(folder)


def test_a_log_sent_in_pieces_becomes_a_session(door):
    header = "t_s," + ",".join(f"a{t}{k}_counts" for t in (1, 2, 3, 4) for k in (1, 2, 3))
    rows = [
        f"{n / 100:.2f},"
        + ",".join(
            str((n * 7 + k) % 5 + up) for k, up in enumerate([0, 0, 256] * 2 + [0, 0, -256] * 2)
        )
        for n in range(200)
    ]
    data = "\n".join([header, *rows, ""]).encode()
    with door.client("otto") as client:
        begun = client.post("/api/imports").json()
        path, piece = f"/api/imports/{begun['upload']}/files/run.csv", 4000
        for at in range(0, len(data), piece):
            sent = client.post(path, params={"at": at}, content=data[at : at + piece])
            assert sent.json()["bytes"] == min(len(data), at + piece)
        assert client.post(path, params={"at": 5}, content=b"x").status_code == 409
        assert client.post(path.replace("run.csv", "..%2Fx.csv"), content=b"x").status_code in (
            404,
            422,
        )
        job = ended(
            client,
            client.post(
                f"/api/imports/{begun['upload']}/finish", json={"device": "cube", "name": "mine"}
            ),
        )
        assert job["state"] == "done" and job["made"].endswith("-mine"), job
        assert [row["id"] for row in client.get("/api/sessions", params={"q": "mine"}).json()] == [
            job["made"]
        ]
    with door.client("vera") as client:
        assert client.post("/api/imports").status_code == 403
        assert client.post(f"/api/sessions/{SESSION}/rerun", json={}).status_code == 403


def test_a_session_is_estimated_again_and_laid_over_itself(door):
    with door.client("otto") as client:
        known = client.get("/api/estimators").json()
        assert "least-squares" in known["rate"] and "kf" in known["navigators"]
        order = {
            "estimators": ["least-squares"],
            "settings": {"layout.half_side_m": "0.05"},
            "name": "again",
        }
        job = ended(client, client.post(f"/api/sessions/{SESSION}/rerun", json=order))
        assert job["state"] == "done" and job["made"] == f"{SESSION}-again", job
        answer = drawn(client, ids=f"{SESSION},{job['made']}")
        assert answer["sessions"][1]["by"] == "clock" and answer["sessions"][1]["offset_s"] == 0.0
        (same,) = [d for d in answer["differences"] if d["line"].endswith("least-squares-again")]
        assert max(same["rms_radps"].values()) == 0.0
