"""Foreign CSV on the page: seen before it is read, columns meant by a person, no server path."""

import sys

import pytest
from support.front_door import open_door
from support.waiting import until

from dashboard.web.jobs import Jobs
from gyrofree.running import simulate_csv
from logs.tables.preview import guess


@pytest.fixture(scope="module")
def door(tmp_path_factory):
    folder = tmp_path_factory.mktemp("door")
    (folder / "gyrofree.toml").write_text(f'[recorder]\nroot = "{folder / "sessions"}"\n')
    command = [sys.executable, "-m", "gyrofree"]
    jobs = Jobs(command, ["--config", str(folder / "gyrofree.toml")])
    with open_door(folder, scene=False, jobs=jobs) as opened:
        yield opened
    jobs.close()


@pytest.fixture(scope="module")
def foreign(tmp_path_factory):
    """A cube's log as a German spreadsheet saves it, with names of its own."""
    log = tmp_path_factory.mktemp("log") / "log.csv"
    simulate_csv.write(log, "cw-ccw", 3)
    lines = [line for line in log.read_text().splitlines() if not line.startswith("#")][:400]
    head, *rows = [line.split(",")[:14] for line in lines]
    head = ["Zeit [ms]", *(name.replace("_counts", " Zähler") for name in head[1:13]), "Tisch"]
    rows = [[f"{1e3 * float(row[0]):.1f}", *row[1:]] for row in rows]
    text = "\n".join(";".join(row).replace(".", ",") for row in [head, *rows])
    return ("\ufeff" + text + "\n").encode(), head


def sent(client, data, name="Prüfstand.csv"):
    upload = client.post("/api/imports", json={}).json()["upload"]
    for at in range(0, len(data), 60_000):
        piece = data[at : at + 60_000]
        assert client.post(f"/api/imports/{upload}/files/{name}?at={at}", content=piece).is_success
    return upload


def test_a_foreign_log_is_shown_mapped_and_made_a_session(door, foreign):
    data, head = foreign
    with door.client("otto") as client:
        upload = sent(client, data)
        answer = client.get(f"/api/imports/{upload}/look").json()
        (found,) = answer["files"].values()
        assert (found["encoding"], found["separator"], found["decimal"]) == (
            "utf-8-sig",
            "semicolon",
            "comma",
        )
        assert [one["name"] for one in found["columns"]] == head and len(found["rows"]) == 8
        assert found["columns"][0]["guess"] == "t_ms"
        assert found["columns"][0]["values"][1] == pytest.approx(10.0)
        meant = {name: f"{name[:3]}_counts" for name in head[1:13]}
        meant |= {head[0]: "t_ms", head[13]: "tacho_rad_s"}
        assert set(meant.values()) <= set(answer["targets"])
        order = {"device": "cube", "name": "foreign", "start": "2026-11-28T09:30:00"}
        order["columns"] = {"Prüfstand.csv": meant}
        job = client.post(f"/api/imports/{upload}/finish", json=order).json()

        def ended():
            state = client.get(f"/api/jobs/{job['number']}").json()
            return state if state["state"] in ("done", "failed") else None

        end = until(ended, "the import ends", 120.0)
        assert end["state"] == "done", end
        assert end["made"].startswith("20261128-093000-foreign")


@pytest.mark.parametrize("fault", ["a cell", "a meaning", "twice", "a file"])
def test_an_error_says_what_to_do_and_nothing_of_the_server(door, foreign, fault):
    data, head = foreign
    with door.client("otto") as client:
        if fault == "a cell":
            data = data.replace(b"\n20,0;", b"\nx;", 1)
        upload = sent(client, data)
        meant = {head[0]: "t_ms"} | {name: f"{name[:3]}_counts" for name in head[1:13]}
        name = "Prüfstand.csv"
        if fault == "a meaning":
            meant[head[1]] = "nonsense"
        elif fault == "twice":
            meant[head[1]] = "t_ms"
        elif fault == "a file":
            name = "../../etc/passwd"
        order = {"device": "cube", "name": "bad", "columns": {name: meant}}
        answer = client.post(f"/api/imports/{upload}/finish", json=order)
        assert answer.status_code == 409
        said = answer.json()["error"]
        assert "/tmp" not in said and "gyrofree-upload" not in said and said
        if fault == "a cell":
            assert "Prüfstand.csv:4" in said and "'x'" in said


def test_guesses_are_of_the_usual_names():
    wanted = {
        "Time (s)": "t_s",
        "timestamp_us": "t_us",
        "acc_x (g)": "fx_g",
        "AccZ [m/s^2]": "fz_mps2",
        "gyro_y [deg/s]": "wy_degps",
        "Latitude": "lat_deg",
        "a11_counts": "a11_counts",
        "wx_radps": "wx_radps",
        "comment": "",
    }
    assert {name: guess(name) for name in wanted} == wanted


def test_a_file_that_is_none_is_named_alone(door):
    with door.client("otto") as client:
        upload = sent(client, b"PK\x03\x04" + b"0" * 50, "book.csv")
        said = client.get(f"/api/imports/{upload}/look").json()["error"]
        assert said.startswith("book.csv:") and "save its sheet as CSV" in said
