"""What earlier versions wrote is read by this one, all of it; what a later one writes is refused
with a sentence (docs/operations.md, tests/data/README.md).
"""

import json
import shutil
import tarfile
from pathlib import Path

import pytest

from dashboard.alarms import state_file
from dashboard.web.users import Role, UserStore
from gyrofree.config import ConfigError, Settings, load
from messages.contract import gyrofree_pb2 as pb
from messages.history.journal import Journal
from messages.history.spool import Spool
from sessions.export.table import Selection
from sessions.export.table import messages as messages_of
from sessions.library.catalogue import Catalogue
from sessions.library.verify import verify

DATA = Path(__file__).resolve().parents[1] / "data"
PASSWORD = "correct horse battery"
SETS = ("2026-11-22-a", "2026-11-22-b", "2026-11-28", "2026-11-29-a", "2026-11-29-b")


@pytest.fixture(scope="module")
def older(tmp_path_factory):
    folder = tmp_path_factory.mktemp("older")
    with tarfile.open(DATA / "older.tar.xz") as archive:
        archive.extractall(folder, filter="data")
    assert sorted(path.name for path in folder.iterdir()) == sorted(SETS)
    return folder


@pytest.fixture(params=SETS)
def folder(older, request, tmp_path):
    """A copy of one set: today's code may write beside it."""
    return Path(shutil.copytree(older / request.param, tmp_path / request.param))


def test_a_recording_is_whole_and_every_sample_is_there(folder):
    [info] = Catalogue(folder / "sessions").list()
    assert info.state == "closed" and info.messages == 42 and not info.problem, info
    assert info.devices == ("cube",) and info.note == "made then"
    found = verify(folder / "sessions" / info.id)
    assert found.hash_ok and found.ok and found.messages == 42, found
    counts: dict[str, int] = {}
    for _, topic, message in messages_of(info.path, Selection()):
        counts[topic.name] = counts.get(topic.name, 0) + 1
        if topic.name == "accel":
            assert len(message.f_mps2) == 12
        if topic.name == "rate":
            assert message.omega_ib_b_radps[2] == pytest.approx(0.1 * message.for_index)
    assert counts == {"accel": 30, "rate": 10, "gnss": 1, "link": 1}


def test_a_journal_goes_on_where_it_ended(folder):
    journal = Journal(folder / "journal")
    try:
        records = journal.tail(1 << 20)
        assert [r.data for r in records] == [b"frame %d" % k for k in range(20)]
        assert journal.append(0, b"after", 1, 2) == len(records) + 1
    finally:
        journal.close()


def test_what_was_published_is_still_answered(folder):
    if folder.name == SETS[0]:
        assert not (folder / "published").exists()  # it kept none
        return
    spool = Spool(folder / "published")
    try:
        reply = spool.answer(pb.HistoryQuery(), "cube")
        assert len(reply.items) == 42 and not reply.next
        assert spool.last_sequences()["accel", "cube"] == 30
    finally:
        spool.close()


def test_people_sign_in_with_their_old_passwords(folder):
    user = UserStore(folder / "users.json").verify("anna", PASSWORD)
    assert user is not None and user.role is Role.operator


def test_the_settings_that_were_shipped_are_still_taken(folder):
    assert isinstance(load(folder / "gyrofree.toml"), Settings)


def test_alarms_of_this_version_are_read_by_later_ones(older, tmp_path):
    path = Path(shutil.copy(older / SETS[-1] / "alarms.json", tmp_path))
    *_, fault = state_file.load(path)
    assert fault == "" and path.exists()


def test_what_a_later_version_writes_is_refused_with_a_sentence(older, tmp_path):
    folder = Path(shutil.copytree(older / SETS[-1], tmp_path / "later"))
    [session] = Catalogue(folder / "sessions").list()
    manifest = folder / "sessions" / session.id / "session.json"
    manifest.write_text(json.dumps(json.loads(manifest.read_text()) | {"format": 2}))
    [later] = Catalogue(folder / "sessions").list()
    assert later.state == "unreadable" and "format" in later.problem
    alarms = folder / "alarms.json"
    alarms.write_text(json.dumps(json.loads(alarms.read_text()) | {"format": 2}))
    *_, fault = state_file.load(alarms)
    assert "format 2, want 1" in fault and (folder / "alarms.json.damaged").exists()
    config = folder / "gyrofree.toml"
    config.write_text(config.read_text() + "\n[tomorrow]\nkey = 1\n")
    with pytest.raises(ConfigError, match="has no section 'tomorrow'"):
        load(config)
