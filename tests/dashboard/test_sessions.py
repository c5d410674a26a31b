"""The pages and orders of one session, over the real front door, with the real command for reports
and exports.
"""

import io
import json
import shutil
import sys
import zipfile
from datetime import UTC, datetime
from pathlib import Path

import pytest
from support.front_door import ended, open_door
from support.table_session import SESSION, table_root

from dashboard.web.jobs import Jobs
from sessions.library.annotations import SessionNote, add_note
from sessions.library.copied import FILE, Copied, Hashes, write_copied
from sessions.recording.manifest import SessionError

ROOM = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def door(tmp_path_factory):
    folder = tmp_path_factory.mktemp("door")
    shutil.copytree(table_root(), folder / "sessions")
    jobs = Jobs([sys.executable, "-m", "gyrofree"])
    with open_door(folder, scene=False, jobs=jobs) as door:
        yield door
    jobs.close()


def test_a_report_is_made_and_served_in_three_forms(door):
    with door.client("otto") as client:
        assert client.get(f"/api/sessions/{SESSION}/report.html").status_code == 404
        job = ended(client, client.post(f"/api/sessions/{SESSION}/report", json={}))
        assert job["state"] == "done", job
        page = client.get(f"/api/sessions/{SESSION}/report.html")
        assert "default-src 'none'" in page.headers["content-security-policy"]
        assert SESSION in page.text and page.text.count("<img") >= 9
        assert client.get(f"/api/sessions/{SESSION}/report.pdf").content.startswith(b"%PDF")
        figures = json.loads(client.get(f"/api/sessions/{SESSION}/report.json").text)["figures"]
        shown = client.get(f"/sessions/{SESSION}").text
        assert "Verdict" in shown and "Make it again" in shown
        trend = client.get("/trend").text
        assert f"/sessions/{SESSION}" in trend and f"{figures['accel_bias_x_mg']:.5g}" in trend


def test_an_export_is_streamed_as_a_zip_of_what_was_asked_for(door):
    with door.client("otto") as client:
        order = {"format": "csv", "start_s": 5.0, "end_s": 8.0, "topics": ["accel", "tacho"]}
        job = ended(client, client.post(f"/api/sessions/{SESSION}/export", json=order))
        assert job["state"] == "done", job
        files = zipfile.ZipFile(
            io.BytesIO(client.get(f"/api/jobs/{job['number']}/download").content)
        )
        assert sorted(files.namelist()) == ["cube.accel.csv", "cube.tacho.csv"]
        rows = files.read("cube.accel.csv").decode().splitlines()
        assert len(rows) == 1 + 301 and "a11_mps2" in rows[0]


def test_a_failed_job_says_why(door):
    with door.client("otto") as client:
        job = ended(client, client.post(f"/api/sessions/{SESSION}/export", json={"format": "kml"}))
        assert (
            job["state"] == "failed" and "neither fixes nor a navigation solution" in job["message"]
        )
        assert client.get(f"/api/jobs/{job['number']}/download").status_code == 409
        assert client.get("/api/jobs/4711").status_code == 404


def test_notes_and_labels_are_kept_and_found(door):
    with door.client("otto") as client:
        remark = {"text": "a nudge <b>", "at_s": 12.5}
        assert client.post(f"/api/sessions/{SESSION}/notes", json=remark).status_code == 200
        labels = {"title": "First run", "tags": ["table", "keep"], "outcome": "pass"}
        assert client.post(f"/api/sessions/{SESSION}/labels", json=labels).json()["tags"] == [
            "keep",
            "table",
        ]
        page = client.get(f"/sessions/{SESSION}").text
        assert "a nudge &lt;b&gt;" in page and "12.5 s · otto" in page and "First run" in page
        for word in ("first", "keep", "pass", "2024-01-01", "cube table"):
            assert [
                row["id"] for row in client.get("/api/sessions", params={"q": word}).json()
            ] == [SESSION]
        assert client.get("/api/sessions", params={"q": "nothing-like-it"}).json() == []
        assert (
            client.post(f"/api/sessions/{SESSION}/labels", json={"tags": ["NO TAG"]}).status_code
            == 409
        )


ACTING = ["a\u202eb", "\u2066x", "a\x1b[2J", "a\x00b", "z" + "\u0301" * 9, "\ufeff"]


@pytest.mark.parametrize("word", ACTING)
def test_titles_and_notes_that_act_are_refused_with_a_sentence(door, word):
    with door.client("otto") as client:
        before = client.get(f"/api/sessions/{SESSION}/annotations").json()
        for path, body in (
            ("labels", {"title": word}),
            ("notes", {"text": word}),
        ):
            answer = client.post(f"/api/sessions/{SESSION}/{path}", json=body)
            assert answer.status_code == 422, answer.text
            assert "character" in answer.json()["faults"][0]["what"]
        answer = client.post("/api/recording/start", json={"note": word, "name": word})
        assert answer.status_code == 422 and len(answer.json()["faults"]) == 2
        assert client.get(f"/api/sessions/{SESSION}/annotations").json() == before
    with pytest.raises(SessionError, match="character"):
        note = SessionNote(text="x", author=word)
        add_note(door.front.catalogue.root / SESSION, note)


def test_words_of_every_language_are_kept_in_one_form(door):
    with door.client("otto") as client:
        for title in ("Prüfstand 2 (Ä)", "Pru\u0308fstand 2 (A\u0308)"):
            kept = client.post(f"/api/sessions/{SESSION}/labels", json={"title": title}).json()
            assert kept["title"] == "Prüfstand 2 (Ä)"
            found = client.get("/api/sessions", params={"q": title.split()[0]}).json()
            assert [row["id"] for row in found] == [SESSION]
        for text in ("测试 עברית عربي Tiếng Việt 👩\u200d🔬", "two\nlines\tand a tab"):
            notes = client.post(f"/api/sessions/{SESSION}/notes", json={"text": text}).json()[
                "notes"
            ]
            assert notes[-1]["text"] == text


def test_a_viewer_changes_nothing_and_only_an_admin_deletes(door):
    with door.client("vera") as client:
        for order, body in (
            ("report", {}),
            ("export", {"format": "csv"}),
            ("notes", {"text": "x"}),
            ("delete", {}),
        ):
            assert client.post(f"/api/sessions/{SESSION}/{order}", json=body).status_code == 403
        page = client.get(f"/sessions/{SESSION}").text
        assert "Completeness" in page and 'id="report"' not in page and 'id="delete"' not in page
    with door.client("otto") as client:
        assert client.post(f"/api/sessions/{SESSION}/delete", json={}).status_code == 403


def test_a_copy_shows_the_hashes_of_both_places(door):
    folder, same, other = door.settings.sessions_root / SESSION, "a" * 64, "b" * 64
    try:
        with door.client("vera") as client:
            for here, said in ((same, "proven equal"), (other, "different from it")):
                hashes = {"recording.mcap": Hashes(home_sha256=same, here_sha256=here)}
                at = datetime(2026, 11, 29, 12, tzinfo=UTC)
                copied = Copied(home="lab", here="office", equal_since=at, files=hashes)
                write_copied(folder, copied)
                page = client.get(f"/sessions/{SESSION}").text
                assert said in page and "recording at lab" in page and same in page and here in page
            (folder / FILE).write_text("{")
            assert "recording at lab" not in client.get(f"/sessions/{SESSION}").text
    finally:
        (folder / FILE).unlink()


@pytest.mark.parametrize("name", ["20990101-000000", "..%2f..%2fetc", "20240101-000000-table%00"])
def test_a_session_that_is_not_there_is_a_404(door, name):
    with door.client("anna") as client:
        assert client.get(f"/api/sessions/{name}/report.html").status_code == 404
        assert client.get(f"/sessions/{name}").status_code == 404
        assert client.post(f"/api/sessions/{name}/delete", json={}).status_code == 404


def test_deletion_frees_the_disk(door):
    with door.client("anna") as client:
        freed = client.post(f"/api/sessions/{SESSION}/delete", json={}).json()["freed_bytes"]
        assert freed > 1_000_000
        assert client.get("/api/sessions").json() == []
    assert not (door.settings.sessions_root / SESSION).exists()
