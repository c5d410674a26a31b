"""Backup and restore: all of it or nothing, whatever the archive is and whenever it is killed."""

import hashlib
import json
import os
import signal
import stat
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from dashboard.web.users import Role, add_user, load_users
from gyrofree.commands.main import app
from gyrofree.config import Settings
from gyrofree.operations.backup import archive, swap
from gyrofree.operations.backup.collecting import whole_part
from gyrofree.operations.backup.parts import LEFT_OUT, NAMED, PATHS, BackupError
from gyrofree.setup.keys import keys_of, tables
from sessions.library.catalogue import Catalogue
from sessions.recording.manifest import Manifest, write_manifest
from sessions.recording.mcap_append import McapLog
from sessions.recording.recover import recover_all

ROOT = Path(__file__).resolve().parents[2]
SESSION, RUNNING = "20260101-120000-spin", "20260101-130000"


def fill(folder: Path) -> Path:
    """An installation with something of everything; its configuration."""
    from messages.contract import gyrofree_pb2 as pb
    from messages.contract.topics import ACCEL

    config = folder / "gyrofree.toml"
    config.write_text(
        '[bus]\nlisten = ["tcp/127.0.0.1:9"]\ntls = "var/site"\n[dashboard]\nport = 9\n'
        'oidc_secret = "oidc.secret"\n'
    )
    (folder / "oidc.secret").write_text("hush")
    state = folder / "var" / "state"
    add_user(state / "users.json", "ann", "a long password 1", Role.admin.name)
    (state / "users.json.tokens").write_text("{}")
    (state / "alarms.json").write_text('{"format": 1}')
    site = folder / "var" / "site" / "authority"
    site.mkdir(parents=True)
    (site / "ca.key").write_text("key")
    (site / "ca.key").chmod(0o600)
    (folder / "var" / "cards").mkdir()
    (folder / "var" / "cards" / "cube.toml").write_text("card")
    for name, state in ((SESSION, "closed"), (RUNNING, "open")):
        session = folder / "var" / "sessions" / name
        session.mkdir(parents=True)
        with (session / "recording.mcap").open("wb") as stream:
            log = McapLog(stream.fileno(), 4096, session)
            channel = log.open_channel("gyrofree/cube/accel", ACCEL)
            for k in range(40):
                batch = pb.AccelBatch(axes=12, f_mps2=[0.5] * 12)
                batch.header.device, batch.header.sequence = "cube", k + 1
                log.add(channel, 10**9 * k, 10**9 * k, batch.SerializeToString())
            log.close_chunk()
            log.push()
            if state == "closed":
                log.finish()
                log.push()
            else:
                stream.flush()
                os.write(stream.fileno(), b"\x06half a chunk")
        write_manifest(session, Manifest(id=name, state=state))
    (folder / "var" / "sessions" / "number").write_text("2\n")
    return config


def tree(folder: Path) -> dict[str, tuple[str, int]]:
    """Every file with its hash and rights."""
    return {
        str(path.relative_to(folder)): (
            hashlib.sha256(path.read_bytes()).hexdigest(),
            stat.S_IMODE(path.stat().st_mode),
        )
        for path in sorted(folder.rglob("*"))
        if path.is_file() and not path.is_symlink()
    }


def run(folder: Path, *words: str):
    here = os.getcwd()
    os.chdir(folder)
    try:
        return CliRunner().invoke(app, list(words))
    finally:
        os.chdir(here)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """An installation and its backup."""
    folder = tmp_path_factory.mktemp("lab")
    fill(folder)
    outside = tmp_path_factory.mktemp("outside") / "secret"
    outside.write_text("not ours")
    (folder / "var" / "cards" / "link.toml").symlink_to(outside)
    result = run(folder, "backup", "../lab.zip")
    assert result.exit_code == 0, result.output
    assert "cards/link.toml: left out: is a link" in result.output
    assert f"{RUNNING}/recording.mcap: being recorded: up to its last" in result.output
    return folder, folder.parent / "lab.zip"


def test_what_is_kept_is_what_there_was(made, tmp_path):
    folder, file = made
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    result = run(tmp_path, "restore", str(file), "--json")
    assert result.exit_code == 0, result.output
    before, after = tree(folder), tree(tmp_path)
    cut = f"var/sessions/{RUNNING}/recording.mcap"
    assert before.keys() == after.keys()
    assert {k for k in before if before[k][0] != after[k][0]} == {cut}
    whole = (folder / cut).read_bytes()
    assert whole == (tmp_path / cut).read_bytes() + b"\x06half a chunk"
    assert after["var/site/authority/ca.key"][1] == 0o600 == after["oidc.secret"][1]
    assert load_users(tmp_path / "var" / "state" / "users.json")["ann"].role is Role.admin
    assert [m.state for m in recover_all(tmp_path / "var" / "sessions")] == ["recovered"]
    states = {info.id: info.state for info in Catalogue(tmp_path / "var" / "sessions").list()}
    assert states == {SESSION: "closed", RUNNING: "recovered"}


def test_what_is_there_stays_unless_that_is_asked_for(made, tmp_path):
    folder, file = made
    fill(tmp_path)
    users = tmp_path / "var" / "state" / "users.json"
    add_user(users, "bob", "another password 2", "viewer")
    (tmp_path / "var" / "state" / "users.json.views").write_text("{}")
    before = tree(tmp_path)
    refused = run(tmp_path, "restore", str(file))
    assert refused.exit_code == 1 and "--overwrite" in refused.output
    assert tree(tmp_path) == before
    only = run(tmp_path, "restore", str(file), "--only", "cards", "--only", "axes")
    assert only.exit_code == 0 and tree(tmp_path) == before, only.output
    assert run(tmp_path, "restore", str(file), "--overwrite").exit_code == 0
    assert set(load_users(users)) == {"ann"}  # and nobody else who could sign in
    assert not users.with_name("users.json.views").exists()
    again = run(tmp_path, "restore", str(file))
    assert again.exit_code == 0 and "0 restored" in again.output, again.output


def test_a_device_is_no_place_for_a_backup(made):
    refused = run(made[0], "backup", "/dev/null")
    assert refused.exit_code == 1 and "no file" in refused.output
    assert stat.S_ISCHR(os.stat("/dev/null").st_mode)


def test_nothing_is_written_where_a_link_leads(made, tmp_path):
    _, file = made
    (tmp_path / "lab").mkdir()
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "lab" / "var").symlink_to(tmp_path / "elsewhere")  # its owner's own: followed
    assert run(tmp_path / "lab", "restore", str(file)).exit_code == 0
    with zipfile.ZipFile(file) as source, zipfile.ZipFile(tmp_path / "b.zip", "w") as target:
        listed = json.loads(source.read("contents.json"))
        one = next(e for e in listed["entries"] if e["part"] == "cards")
        listed["entries"] = [one | {"unit": "sub/cube.toml"}]
        target.writestr("contents.json", json.dumps(listed))
        target.writestr("cards/sub/cube.toml", source.read("cards/cube.toml"))
    (tmp_path / "elsewhere" / "cards" / "sub").symlink_to(tmp_path)
    refused = run(tmp_path / "lab", "restore", str(tmp_path / "b.zip"))
    assert refused.exit_code == 1 and "is a link" in refused.output
    assert not (tmp_path / "cube.toml").exists()


HOSTILE = (
    "../../x",
    "/etc/x",
    "a//b",
    ".",
    "..",
    "a\\..\\b",
    "x\x00y",
    "a/../../b",
    "~/x\u202e",
    "n" * 300,
    "/".join("d" * 40),
)


@pytest.mark.parametrize("field", ["unit", "path", "part"])
@pytest.mark.parametrize("name", HOSTILE)
def test_a_name_that_leaves_its_place_is_refused(made, tmp_path, field, name):
    _, file = made
    with zipfile.ZipFile(file) as source, zipfile.ZipFile(tmp_path / "b.zip", "w") as target:
        listed = json.loads(source.read("contents.json"))
        entry = listed["entries"][-1] | {field: name}
        listed["entries"][-1] = entry
        target.writestr("contents.json", json.dumps(listed))
        for one in listed["entries"][:-1]:
            word = "/".join(filter(None, (one["part"], one["unit"], one["path"])))
            target.writestr(word, source.read(word))
        target.writestr("/".join((entry["part"], entry["unit"], entry["path"])), b"")
    with pytest.raises(BackupError), archive.opened(tmp_path / "b.zip"):
        pass


@pytest.fixture(scope="module")
def good(made):
    return made[1].read_bytes()


@settings(
    max_examples=20,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(st.data())
def test_a_damaged_archive_changes_nothing(good, made, tmp_path, data):
    damaged = bytearray(good)
    kind = data.draw(st.sampled_from(["flip", "cut", "swap", "zero", "noise"]))
    at = data.draw(st.integers(0, len(good) - 1))
    if kind == "cut":
        del damaged[at:]
    elif kind == "flip":
        damaged[at] ^= data.draw(st.integers(1, 255))
    elif kind == "zero":
        damaged[at : at + 64] = bytes(len(damaged[at : at + 64]))
    elif kind == "swap":
        other = data.draw(st.integers(0, len(good) - 1))
        damaged[at : at + 16], damaged[other : other + 16] = (
            good[other : other + 16],
            good[at : at + 16],
        )
    else:
        damaged = bytearray(data.draw(st.binary(max_size=400)))
    file, place = tmp_path / "damaged.zip", tmp_path / "place"
    file.write_bytes(damaged)
    place.mkdir(exist_ok=True)
    result = run(place, "restore", str(file))
    if result.exit_code == 0:  # what was hit is nothing that counts: a date, a comment
        assert tree(place).keys() == tree(made[0]).keys()
        run_away(place)
        return
    assert result.exit_code in (1, 2) and "gyrofree:" in result.output, result.output
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    assert list(place.iterdir()) == []


def run_away(folder: Path) -> None:
    for child in folder.iterdir():
        swap.remove(child)


KILLED = """
import os, signal, sys
from gyrofree.commands.main import app
def killed(folder, word, after):
    count, real = 0, getattr(os, word)
    def call(*given):
        nonlocal count
        count += 1
        if count > after:
            os.kill(os.getpid(), signal.SIGKILL)
        real(*given)
    setattr(os, word, call)
    os.chdir(folder)
    app(["restore", sys.argv[1], "--overwrite"])
for each in sys.argv[2:]:
    child = os.fork()
    if not child:
        _, word, after = each.rsplit("-", 2)
        killed(each, word, int(after))
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""


def test_killed_in_the_middle_the_old_state_is_whole(made, tmp_path):
    _, file = made
    # while it lays ready, which changes rights once a file, and while it moves
    words = ("fchmod-5", "rename-0", "rename-4", "rename-9")
    folders = [tmp_path / f"after-{word}" for word in words]
    for folder in folders:
        folder.mkdir()
        fill(folder)
        add_user(folder / "var" / "state" / "users.json", "bob", "another password 2", "viewer")
        (folder / "oidc.secret").write_text("another")
        (folder / "var" / "state" / "alarms.json").unlink()
        (folder / "var" / "site" / "authority" / "ca.key").write_text("another")
    before = [tree(folder) for folder in folders]
    words = [sys.executable, "-c", KILLED, str(file), *map(str, folders)]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True)
    assert done.stdout.split() == [str(-signal.SIGKILL)] * len(folders), done.stderr
    for folder, was in zip(folders, before, strict=True):
        assert (folder / swap.PLAN).exists()
        said = run(folder, "config", "check")
        assert "everything is as it was before it" in said.output
        assert tree(folder) == was


def test_a_restore_that_is_under_way_is_not_disturbed(tmp_path):
    config = tmp_path / "gyrofree.toml"
    target, draft = tmp_path / "place", tmp_path / "draft"
    draft.write_text("new")
    seen = []

    real = os.rename

    def rename(*paths):
        with pytest.raises(BackupError, match="under way"):
            swap.settle(tmp_path)
        seen.append(paths)
        real(*paths)

    os.rename, kept = rename, os.rename
    try:
        swap.swap(tmp_path, [swap.Move(str(target), str(draft))], lambda: None)
    finally:
        os.rename = kept
    assert seen and target.read_text() == "new" and not config.exists()
    assert swap.settle(tmp_path) == ""


def test_every_path_of_the_settings_is_kept_or_left_out_for_a_reason():
    known = {key for key, *_ in PATHS.values()} | {*NAMED, *LEFT_OUT}
    found = set()
    for path, model in [((), Settings), *tables(Settings)]:
        for key in keys_of(model):
            if "Path" in str(key.field.annotation) and "*" not in path:
                found.add(".".join((*path, key.name)))
    assert found == known and all(LEFT_OUT.values())


def test_a_folder_whose_settings_lead_elsewhere_is_not_taken_from_a_backup(made, tmp_path):
    other = tmp_path / "lab"
    other.mkdir()
    (other / "gyrofree.toml").write_text(f'[recorder]\nroot = "{tmp_path}/far"\n')
    assert run(other, "backup", "../b.zip", "--only", "settings").exit_code == 0
    place = tmp_path / "place"
    place.mkdir()
    refused = run(place, "restore", "../b.zip")
    assert refused.exit_code == 1 and "lead out of this folder" in refused.output
    assert list(place.iterdir()) == []


def test_the_whole_part_of_a_recording_ends_with_a_record(made, tmp_path):
    folder, _ = made
    whole = (folder / "var" / "sessions" / SESSION / "recording.mcap").read_bytes()
    file = tmp_path / "recording.mcap"
    ends = set()
    for cut in range(0, len(whole), 97):
        file.write_bytes(whole[:cut])
        ends.add(whole_part(file))
        assert whole_part(file) <= cut
    assert len(ends) < 20
