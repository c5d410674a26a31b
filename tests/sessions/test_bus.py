"""Recorder and replay on a real router: orders, crashes, and a replay that changes nothing but the
device's name.
"""

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from mcap.reader import make_reader
from support.waiting import until

from messages.bus import orders
from messages.bus.session import BusSettings, Publishers, open_client, open_router
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import (
    ACCEL,
    GNSS,
    LOCATION,
    RATE,
    RECORDER,
    STATUS,
    TRUTH,
)
from sessions.library.annotations import change_annotations
from sessions.library.catalogue import Catalogue
from sessions.recording import service as recorder
from sessions.recording.manifest import write_manifest
from sessions.recording.mcap_log import read
from sessions.recording.settings import RecorderSettings
from sessions.recording.store import start
from sessions.replay import replay
from sessions.replay.playback import Playback
from sessions.replay.source import Source
from tests.sessions.test_store import accel

ROOT = Path(__file__).resolve().parents[2]
PATIENCE = 30.0  # s; generous, the tests wait for states


@pytest.fixture
def bus(free_port):
    endpoint = f"tcp/127.0.0.1:{free_port}"
    settings = BusSettings(prefix="t", router=endpoint, listen=[endpoint])
    with open_router(settings):
        yield settings


@pytest.fixture
def client(bus):
    with open_client(bus) as session:
        yield session


@pytest.fixture
def recording(bus, tmp_path):
    """Start a recorder in this process; called with settings' fields, stopped at the end."""
    stop = threading.Event()
    threads = []

    def begin(**fields):
        settings = RecorderSettings(root=tmp_path / "root", **{"auto_start": True} | fields)
        threads.append(
            threading.Thread(target=recorder.run, args=(settings, bus, stop, {"who": "test"}))
        )
        threads[-1].start()
        return settings, stop, threads[-1]

    yield begin
    stop.set()
    for thread in threads:
        thread.join(PATIENCE)


def order(session, action=pb.RecorderCommand.ACTION_STATUS, **fields) -> pb.RecorderStatus | None:
    command = pb.RecorderCommand(action=action, **fields)
    try:
        return orders.give(session, "t", orders.RECORDER, command)
    except orders.OrderError:
        return None


START, STOP = pb.RecorderCommand.ACTION_START, pb.RecorderCommand.ACTION_STOP


def recorded_accel(path) -> list[int]:
    return [
        pb.AccelBatch.FromString(row.payload).header.sequence
        for row in read(path)
        if row.key.endswith("/accel")
    ]


def test_start_stop_and_refusals_by_query(client, recording):
    settings, _, _ = recording(auto_start=False)
    status = until(lambda: order(client), "the recorder's answer")
    assert not status.recording and status.header.device == RECORDER
    assert "not recording" in order(client, STOP).message
    assert "character 2 is U+202E" in order(client, START, name="a\u202eb").message
    assert "note or user: character 1" in order(client, START, note="\x1b[2J").message
    assert "at most 100" in order(client, START, name="x" * 101).message
    begun = order(client, START, name="run-1", note="first", user="ann")
    assert begun.recording and begun.session.endswith("-run-1") and begun.message == ""
    again = order(client, START, name="../Prüfstand (2)")
    assert again.recording and f"already recording {begun.session}" in again.message
    publishers = Publishers(client, "t")

    def sent():
        publishers.put(
            ACCEL, "cube", pb.AccelBatch(header=pb.Header(device="cube", run=1), axes=12)
        )
        return order(client).messages >= 20

    until(sent, "20 messages in the recording")
    client.put("t/cube/accel", b"\xff")  # a foreign publisher's nonsense does not stop it
    until(lambda: (s := order(client)).durable_messages == s.messages, "the disk to have all of it")
    ended = order(client, STOP)
    assert not ended.recording and ended.message == ""
    info = Catalogue(settings.root).get(begun.session)
    assert (
        info.state == "closed"
        and info.note == "first"
        and info.devices == ("cube",)
        and info.lost == 0
    )
    assert info.messages == ended.messages >= 21
    assert Catalogue(settings.root).manifest(begun.session).configuration == {"who": "test"}


def test_payloads_are_the_very_bytes_and_status_is_published(client, recording):
    settings, stop, thread = recording(name="auto")
    seen = []
    held = client.declare_subscriber(
        f"t/{RECORDER}/status", lambda s: seen.append(s.payload.to_bytes())
    )
    until(
        lambda: any(pb.RecorderStatus.FromString(s).recording for s in seen),
        "a status that says recording",
    )
    payloads = [accel(n) for n in range(1, 51)]
    for payload in payloads:
        client.put("t/cube/accel", payload)
    until(lambda: order(client).messages >= 50, "the messages")
    stop.set()
    thread.join(PATIENCE)
    held.undeclare()
    (info,) = Catalogue(settings.root).list()
    rows = list(read(info.path))
    assert [row.payload for row in rows if row.key == "t/cube/accel"] == payloads
    assert info.state == "closed" and info.id.endswith("-auto")
    assert not [row for row in rows if row.key.endswith(STATUS.name)]
    assert all(a.log_ns <= b.log_ns for a, b in zip(rows, rows[1:], strict=False))


def test_a_root_that_is_a_file_is_said_in_the_status_and_mended_later(client, recording, tmp_path):
    (tmp_path / "root").write_text("in the way")
    recording(auto_start=False)
    until(lambda: order(client), "the recorder's answer")
    refused = order(client, START)
    assert (
        not refused.recording
        and "cannot record" in refused.message
        and "[recorder] root" in refused.message
    )
    (tmp_path / "root").unlink()
    assert order(client, START).recording


def test_a_full_file_goes_on_in_a_new_session(client, recording):
    settings, stop, thread = recording(max_file_bytes=64 * 1024, auto_start=True, name="long")
    until(lambda: (s := order(client)) and s.recording, "the start")
    sent = 0
    noise = os.urandom(400)  # incompressible enough to fill files
    while len(list(settings.root.iterdir())) < 3:
        for _ in range(100):
            sent += 1
            client.put(
                "t/cube/accel",
                accel(sent)
                + b"\xa2\x06\xf4\x03"
                + noise[sent % 200 :]
                + noise[: sent % 200]
                + os.urandom(100),
            )
        time.sleep(0.05)
    until(lambda: not order(client).message, "an answer")
    stop.set()
    thread.join(PATIENCE)
    infos = sorted(Catalogue(settings.root).list(), key=lambda info: info.start_utc_ns)
    got = [
        n
        for info in infos
        for n in (
            pb.Header.FromString(r.payload[2 : 2 + r.payload[1]]).sequence for r in read(info.path)
        )
    ]
    assert got == list(range(1, sent + 1))
    assert Catalogue(settings.root).manifest(infos[1].id).continues == infos[0].id


def test_the_recorder_applies_the_rules_of_retention_when_it_starts(client, recording, tmp_path):
    root = tmp_path / "root"
    old = make_session(root).parent
    kept = make_session(root).parent
    change_annotations(kept, lambda was: was.model_copy(update={"tags": ["keep"]}))
    for folder in (
        old,
        kept,
    ):  # both are of the year 2023 by their first message; their manifests say when they began
        manifest = Catalogue(root).manifest(folder.name)
        write_manifest(
            folder, manifest.model_copy(update={"start_utc_ns": 1_700_000_000_000_000_000})
        )
    recording(keep_days=30.0)
    until(lambda: not old.exists(), "the old session to go")
    until(lambda: (s := order(client)) and s.recording, "the recording")
    assert kept.is_dir() and len(Catalogue(root).list()) == 2


RECORD = """
import sys
from pathlib import Path
from gyrofree.running.process import stop_on_signals
from messages.bus import orders
from messages.bus.session import BusSettings
from sessions.recording import service as recorder
from sessions.recording.settings import RecorderSettings
stop = stop_on_signals()
bus = BusSettings(prefix="t", router=sys.argv[2])
recorder.run(RecorderSettings(root=Path(sys.argv[1]), auto_start=True), bus, stop)
"""


def spawn(root: Path, bus: BusSettings) -> subprocess.Popen:
    return subprocess.Popen([sys.executable, "-c", RECORD, str(root), bus.router], cwd=ROOT)


def test_a_killed_recorder_loses_less_than_a_second_and_is_recovered_at_the_next_start(
    client, bus, tmp_path
):
    process = spawn(tmp_path, bus)
    try:
        until(lambda: (s := order(client)) and s.recording, "the recording")
        sent, begun = 0, time.monotonic()
        last_sent_ns = 0
        while time.monotonic() - begun < 3.0:
            sent += 1
            last_sent_ns = time.time_ns()
            client.put("t/cube/accel", accel(sent))
            time.sleep(0.002)
    finally:
        process.send_signal(signal.SIGKILL)
        process.wait(PATIENCE)
    (cut,) = Catalogue(tmp_path).list()
    assert cut.state == "open"
    original = (tmp_path / cut.id / "recording.mcap").read_bytes()
    process = spawn(tmp_path, bus)
    try:
        until(
            lambda: (s := order(client)) and s.recording and s.session != cut.id,
            "the new recording",
        )
        until(lambda: Catalogue(tmp_path).get(cut.id).state == "recovered", "the recovery")
    finally:
        process.terminate()
    assert process.wait(PATIENCE) == 0
    info = Catalogue(tmp_path).get(cut.id)
    assert info.state == "recovered" and "was not closed" in info.problem
    rows = list(read(info.path))
    assert recorded_accel(info.path) == list(range(1, len(rows) + 1))
    lost_s = (last_sent_ns - rows[-1].log_ns) / 1e9
    assert lost_s < 1.0, f"{lost_s:.2f} s of messages lost"
    assert (tmp_path / cut.id / "recording.mcap").read_bytes() == original
    with info.path.open("rb") as stream:
        assert len(list(make_reader(stream, validate_crcs=True).iter_messages())) == len(rows)


def test_sigterm_closes_the_file(client, bus, tmp_path):
    process = spawn(tmp_path, bus)
    try:
        until(lambda: (s := order(client)) and s.recording, "the recording")
        for n in range(1, 101):
            client.put("t/cube/accel", accel(n))
        until(lambda: order(client).messages >= 100, "the messages")
    finally:
        process.terminate()
    assert process.wait(PATIENCE) == 0
    (info,) = Catalogue(tmp_path).list()
    assert info.state == "closed" and recorded_accel(info.path) == list(range(1, 101))


def make_session(root: Path) -> Path:
    """Inputs of two kinds, an estimate and a location, 10 ms apart, with receive times."""
    store = start(RecorderSettings(root=root))
    t0 = 1_700_000_000_000_000_000
    for n in range(1, 101):
        store.add(t0 + n * 10_000_000, "t/cube/accel", accel(n))
        if n % 25 == 0:
            fix = pb.GnssFix(
                header=pb.Header(device="cube", sequence=n // 25, run=7, utc_ns=t0),
                latitude_deg=48.1,
            )
            store.add(t0 + n * 10_000_000 + 1, GNSS.key("t", "cube"), fix.SerializeToString())
            place = LOCATION.type(latitude=48.1, frame_id="cube")
            store.add(t0 + n * 10_000_000 + 2, LOCATION.key("t", "cube"), place.SerializeToString())
        estimate = pb.RateBatch(header=pb.Header(device="cube", sequence=n), estimator="e")
        store.add(t0 + n * 10_000_000 + 3, RATE.key("t", "cube", "e"), estimate.SerializeToString())
    assert store.close()
    return store.folder / "recording.mcap"


def test_replay_publishes_under_a_new_name_and_changes_nothing_else(client, bus, tmp_path):
    path = make_session(tmp_path)
    got, said = [], []
    held = client.declare_subscriber(
        "t/**", lambda s: got.append((str(s.key_expr), s.payload.to_bytes()))
    )
    with open_client(bus) as session:
        Playback(path, replay.Outlet(session, "t").put, speed=10.0).run(
            threading.Event(), said.append
        )
        until(lambda: len(got) >= 208, "all messages")
    held.undeclare()
    assert len(got) == 208 and said[-1].position_s == pytest.approx(0.99, abs=0.001)
    assert {key for key, _ in got} == {
        f"t/cube-replay/{name}" for name in ("accel", "gnss", "location", "rate/e")
    }
    back = [pb.AccelBatch.FromString(p) for key, p in got if key.endswith("accel")]
    for message in back:
        assert message.header.device == "cube-replay"
        message.header.device = "cube"
    assert [m.SerializeToString() for m in back] == [accel(n) for n in range(1, 101)]
    places = [LOCATION.type.FromString(p) for key, p in got if key.endswith("location")]
    assert all(place.frame_id == "cube-replay" and place.latitude == 48.1 for place in places)


def test_a_replay_is_paced_and_stops_when_told(tmp_path):
    path = make_session(tmp_path)
    sent, stop = [], threading.Event()

    def put(address, device, message):
        sent.append(address.topic)

    begun = time.monotonic()
    Playback(path, put, speed=2.0).run(stop)
    assert time.monotonic() - begun >= 0.99 / 2 - 0.05 and len(sent) == 208
    stop.set()
    Playback(path, put, speed=0.1).run(stop)
    assert len(sent) == 208
    with pytest.raises(ValueError, match="speed"):
        Playback(path, put, speed=0.0)


def test_what_is_no_recording_is_refused_with_its_name(tmp_path):
    (tmp_path / "x.mcap").write_bytes(b"not an mcap at all, sorry")
    with pytest.raises(ValueError, match="x.mcap: no message in it"):
        Source(tmp_path / "x.mcap", replay.INPUTS)


def test_long_device_names_stay_within_what_a_key_allows():
    assert replay.renamed("cube") == "cube-replay"
    assert TRUTH.key("t", replay.renamed("a" * 32)) == "t/" + "a" * 25 + "-replay/truth"
