"""What a person may name at the page: files as they are called in a laboratory, and no others of
the server's disk.
"""

import json
import shutil
import sys
import unicodedata
from urllib.parse import quote

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from support.front_door import ended, open_door
from support.hostile import HOSTILE
from support.table_session import SESSION, table_root
from support.waiting import until

from dashboard.web.jobs import Jobs
from dashboard.web.uploads import UploadError, samples_and_fixes
from gyrofree.config import load
from gyrofree.running.rerun_settings import from_library, with_changes

HEADER = "t_s," + ",".join(f"a{t}{k}_counts" for t in (1, 2, 3, 4) for k in (1, 2, 3))
STILL = [0, 0, 256] * 2 + [0, 0, -256] * 2


def cube_log() -> bytes:
    rows = [
        f"{n / 100:.2f}," + ",".join(str((n * 7 + k) % 5 + up) for k, up in enumerate(STILL))
        for n in range(200)
    ]
    return "\n".join([HEADER, *rows, ""]).encode()


@pytest.fixture(scope="module")
def door(tmp_path_factory):
    folder = tmp_path_factory.mktemp("door")
    shutil.copytree(table_root(), folder / "sessions")
    (folder / "cards").mkdir()
    (folder / "secret.txt").write_text("root:x:0:0:the content of another file\n")
    (folder / "cards" / "link.toml").symlink_to(folder / "secret.txt")
    (folder / "cards" / "no card.toml").write_text("x = 1\n")
    config = folder / "gyrofree.toml"
    config.write_text(
        f'[recorder]\nroot = "{folder / "sessions"}"\n[estimator]\ncards = "{folder / "cards"}"\n'
    )
    jobs = Jobs([sys.executable, "-m", "gyrofree"], ["--config", str(config)])
    with open_door(folder, scene=False, jobs=jobs) as door:
        door.folder = folder
        yield door
    jobs.close()


def sent(client, *names: str, content: bytes = b"") -> tuple[int, list]:
    upload = client.post("/api/imports").json()["upload"]
    path = f"/api/imports/{upload}/files/"
    data = content or cube_log()
    answers = []
    for name in names:
        for at in range(0, len(data), 60_000):
            answer = client.post(
                path + quote(name, safe=""), params={"at": at}, content=data[at : at + 60_000]
            )
        answers.append(answer)
    return upload, answers


@pytest.mark.parametrize("form", ["NFC", "NFD"])
@pytest.mark.parametrize("name", ["Messung Prüfstand.csv", "base (1).csv", "gps_cube.csv"])
def test_files_are_taken_as_they_are_called(door, form, name):
    with door.client("otto") as client:
        upload, (answer,) = sent(client, unicodedata.normalize(form, name))
        assert answer.status_code == 200, answer.text
        found = client.get(f"/api/imports/{upload}/look").json()["files"]
        assert [unicodedata.normalize("NFC", one) for one in found] == [name]


@pytest.mark.parametrize(
    "form, name", [("NFD", "Messung Prüfstand.csv"), ("NFC", "100 % #7 [a]&b;c'd.CSV")]
)
def test_a_file_becomes_a_session_of_its_name(door, form, name):
    with door.client("otto") as client:
        upload, _ = sent(client, unicodedata.normalize(form, name))
        order = {"device": "cube", "name": unicodedata.normalize(form, name[:-4])}
        job = ended(client, client.post(f"/api/imports/{upload}/finish", json=order))
        assert job["state"] == "done", job
        again = client.post(f"/api/imports/{upload}/files/x.csv", content=b"x")
        assert again.status_code == 404  # it is read and gone
        made = client.get(f"/api/sessions/{job['made']}").json()
        named = made["title"] or made["id"].split("-", 2)[2].removesuffix("-2")
        assert named == unicodedata.normalize("NFC", name[:-4])
        download = client.get(f"/api/sessions/{job['made']}/download")
        assert f'filename="{job["made"]}.mcap"' in download.headers["content-disposition"]
        assert client.get(f"/sessions/{job['made']}").status_code == 200


def test_a_cube_s_tachometer_may_be_in_a_file_of_its_own(door):
    """Together with the samples, whatever both are called."""
    table = b"t_s;tacho_rad_s\n" + b"".join(b"%d,%d;1,5\n" % divmod(k, 10) for k in range(40))
    with door.client("otto") as client:
        upload, _ = sent(client, "cube.csv")
        at = f"/api/imports/{upload}/files/turntable.csv"
        assert client.post(at, params={"at": 0}, content=table).is_success
        found = client.get(f"/api/imports/{upload}/look").json()["files"]
        columns = {
            name: {c["name"]: c["guess"] for c in one["columns"]} for name, one in found.items()
        }
        assert columns["turntable.csv"] == {"t_s": "t_s", "tacho_rad_s": "tacho_rad_s"}
        order = {"device": "cube", "columns": columns}
        job = ended(client, client.post(f"/api/imports/{upload}/finish", json=order))
        assert job["state"] == "done", job
    recording = door.folder / "sessions" / job["made"] / "session.json"
    assert "/tacho" in recording.read_text()


def test_one_file_in_two_spellings_is_one_file(door):
    with door.client("otto") as client:
        _, (_, again) = sent(client, "Prüf.csv", unicodedata.normalize("NFD", "Prüf.csv"))
        assert again.status_code == 409 and "are here" in again.json()["error"]


@pytest.mark.parametrize(
    "name",
    ["../x.csv", "a\0.csv", ".csv", "..", "x.txt", "/etc/passwd", "a\\b.csv", "-rf.csv"]
    + ["a\u202evsc.csv", "x" * 300 + ".csv", "a\nb.csv", "ü" * 200 + ".csv"],
)
def test_a_path_is_refused(door, name):
    with door.client("otto") as client:
        _, (answer,) = sent(client, name)
        assert answer.status_code in (404, 405, 422), answer.text
    assert not list(door.folder.glob("*.csv"))


def test_what_has_latitudes_is_the_file_of_fixes(tmp_path):
    def file(name, header, encoding="utf-8"):
        path = tmp_path / name
        path.write_text(header + "\n1,2,3\n", encoding=encoding)
        return path

    cube = file("gps_cube.csv", HEADER)
    track = file("Strecke.csv", "t_s;lat_deg;lon_deg", "utf-16")
    plate = file("plate.csv", "t_s,plate,flat")
    named = file("my gnss.csv", "t,x,y")
    assert samples_and_fixes([cube, track]) == samples_and_fixes([track, cube]) == (cube, track)
    assert samples_and_fixes([named, plate]) == (plate, named)
    assert samples_and_fixes([track]) == (track, None)
    for wrong in ([], [cube, named, plate], [track, file("b.csv", "latitude,longitude")]):
        with pytest.raises(UploadError, match="want one CSV of samples"):
            samples_and_fixes(wrong)


FOREIGN = [  # {} stands for a file that is not of the library
    ("calibration", "{}"),
    ("calibration", "../secret.txt"),
    ("calibration", "link.toml"),
    ("calibration", "nowhere.toml"),
    ("calibration", "cards"),
    ("calibrations.cube", "{}"),
    ("axis_maps.cube", "{}"),
    ("layout.file", "{}"),
    ("layouts.cube.file", "{}"),
    ("journal", "/tmp/journal"),
    ("cards", "/"),
    ("axes", "/etc"),
    ("layouts", '{{ cube = {{ file = "{}" }} }}'),
]


@pytest.mark.parametrize("key, value", FOREIGN)
def test_a_setting_names_files_of_the_library_only(door, key, value):
    configured = load(door.folder / "gyrofree.toml").estimator
    word = value.format(door.folder / "secret.txt")
    with pytest.raises(ValueError) as refused:
        from_library(configured, with_changes(configured, [f"{key}={word}"]))
    assert "root:x" not in str(refused.value) and "content of" not in str(refused.value)


def test_a_rerun_opens_files_of_the_library_only(door):
    tries = [
        ("calibration", str(door.folder / "secret.txt")),
        ("calibration", "link.toml"),
        ("journal", str(door.folder / "journal")),
    ]
    with door.client("otto") as client:
        for key, value in tries:
            order = {"settings": {key: value}, "estimators": ["least-squares"]}
            job = ended(client, client.post(f"/api/sessions/{SESSION}/rerun", json=order))
            assert job["state"] == "failed" and job["message"], (key, value, job)
            assert "root:x" not in job["message"] and "content of" not in job["message"]
        assert not (door.folder / "journal").exists()
        order = {"settings": {"calibration": "no card.toml"}}
        job = ended(client, client.post(f"/api/sessions/{SESSION}/rerun", json=order))
        assert job["state"] == "failed" and "no card.toml" in job["message"]  # it was opened


WORD = st.sampled_from([*HOSTILE, "\0", "a\0b", "../x", "--config", "\ud800"]) | st.text(
    max_size=30
)


@settings(max_examples=50, deadline=None, suppress_health_check=list(HealthCheck))
@given(WORD, WORD)
def test_no_word_in_an_order_stops_the_dashboard(silent_door, key, value):
    bodies = {
        f"sessions/{SESSION}/export": {"format": "csv", "topics": [key]},
        f"sessions/{SESSION}/rerun": {"estimators": [key], "settings": {key: value}, "name": value},
        f"sessions/{SESSION}/labels": {"title": key, "tags": [value]},
        f"sessions/{SESSION}/notes": {"text": value},
    }
    with silent_door.client("otto") as client:
        for path, body in bodies.items():
            answer = client.post(
                f"/api/{path}",
                content=json.dumps(body),  # of ASCII: also what UTF-8 cannot say
                headers={"content-type": "application/json"},
            )
            assert answer.status_code in (200, 409, 422), (answer.status_code, answer.text, body)
        for name in (key, value):
            if "/" not in name and name.strip(".") and name.isprintable():
                answer = client.get(f"/api/sessions/{quote(name, safe='')}")
                assert answer.status_code in (200, 404, 405, 400)


@pytest.fixture(scope="module")
def silent_door(tmp_path_factory):
    folder = tmp_path_factory.mktemp("silent")
    shutil.copytree(table_root(), folder / "sessions")
    jobs = Jobs(["true"])
    with open_door(folder, scene=False, jobs=jobs) as door:
        yield door
    jobs.close()


@pytest.mark.parametrize(
    ("command", "arguments", "said"),
    [
        (["/no/such/program"], [], "No such file"),
        ([sys.executable], ["a\0b"], "null byte"),
        ([sys.executable, "-c"], ["import os; os.kill(os.getpid(), 9)"], "-9"),
        (
            [sys.executable, "-c"],
            ["import sys; sys.stderr.buffer.write(b'\\xff\\x1b[2J'); 1/0"],
            "",
        ),
        ([sys.executable, "-c"], ["import time; time.sleep(60)"], "not done after"),
    ],
)
def test_every_job_ends_with_a_reason(command, arguments, said):
    jobs = Jobs(command, longest_s=1.0 if "60" in str(arguments) else 60.0)
    try:
        job = jobs.start("export", "x", arguments, "otto")
        until(lambda: job.ended is not None, "the end of the job")
        until(lambda: job.state == "failed", "failed")
        assert said in job.message and job.message.isprintable() and job.message
        after = jobs.start("export", "x", arguments, "otto")
        until(lambda: after.state == "failed", "the next one")
    finally:
        jobs.close()
