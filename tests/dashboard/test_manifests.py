"""Folders of recordings that somebody brought along: one that is odd hides no other, and no page
fails by it.
"""

import json
import subprocess
import sys

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from support.front_door import open_door
from support.hostile import HOSTILE

from sessions.recording.manifest import Manifest

ID = "20260101-000000-odd"
NUMBERS = st.integers(-(2**70), 2**70) | st.sampled_from([2**63 - 1, -(2**63), 10**400, 0])
FLOATS = st.floats() | NUMBERS.filter(lambda n: abs(n) < 2**100)
TEXT = st.sampled_from(HOSTILE) | st.text(max_size=8)
JUNK = st.recursive(
    st.none() | st.booleans() | FLOATS | TEXT,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(TEXT, inner, max_size=3),
    max_leaves=6,
)
FIELDS = sorted(set(Manifest.model_fields) - {"id"})
ODD = st.dictionaries(st.sampled_from(FIELDS), JUNK | NUMBERS, max_size=6)
KEYS = st.dictionaries(TEXT, st.dictionaries(st.sampled_from(["messages", "lost"]), NUMBERS))


@pytest.fixture(scope="module")
def door(tmp_path_factory):
    folder = tmp_path_factory.mktemp("door")
    for name in (ID, "20260101-000001-good"):
        (folder / "sessions" / name / "report").mkdir(parents=True)
        (folder / "sessions" / name / "recording.mcap").write_bytes(b"no recording")
    good = Manifest(id="20260101-000001-good", state="closed", devices=["cube"])
    (folder / "sessions" / good.id / "session.json").write_text(good.model_dump_json())
    with open_door(folder, scene=False) as opened, opened.client("anna") as client:
        yield folder / "sessions", client


@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
@given(ODD, KEYS, JUNK, JUNK)
def test_every_page_is_shown_whatever_a_folder_says(door, odd, keys, report, said):
    root, client = door
    content = {"id": ID, "state": "closed", "keys": keys} | odd
    (root / ID / "session.json").write_text(json.dumps(content))
    whole = {"device": "cube", "figures": {"accel_bias_x_mg": said}} if odd else report
    (root / ID / "report" / "report.json").write_text(json.dumps(whole))
    notes = {"title": "t", "notes": [{"text": "x", "at_s": said}]} if odd else said
    (root / ID / "annotations.json").write_text(json.dumps(notes))
    for path in ("sessions", f"sessions/{ID}", "trend", "api/sessions", f"api/sessions/{ID}"):
        answer = client.get(f"/{path}")
        assert answer.status_code == 200, (path, answer.text[:300])
        if path.endswith("sessions"):
            assert "20260101-000001-good" in answer.text
    assert client.get(f"/api/sessions/{ID}/annotations").status_code in (200, 409)


def test_the_command_line_lists_it_too(door, tmp_path):
    root, _ = door
    content = {"id": ID, "state": "closed", "start_utc_ns": 10**30, "devices": HOSTILE}
    (root / ID / "session.json").write_text(json.dumps(content))
    (tmp_path / "gyrofree.toml").write_text(f'[recorder]\nroot = "{root}"\n')
    for start in (10**30, 2**63 - 1, -(2**63)):
        (root / ID / "session.json").write_text(json.dumps(content | {"start_utc_ns": start}))
        for order in (["sessions", "list"], ["replay", "--list"]):
            ran = subprocess.run(
                [sys.executable, "-P", "-m", "gyrofree", *order],
                cwd=tmp_path,
                capture_output=True,
                text=True,
            )
            assert ran.returncode == 0 and "20260101-000001-good" in ran.stdout, ran.stderr
