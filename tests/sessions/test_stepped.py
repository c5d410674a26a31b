"""Recordings made while a wall clock was set: read on one axis, in memory that goes with data."""

import json
import resource
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from support.wall_clock import YEAR_S

from messages.contract.topics import ACCEL, RATE, TACHO, parse
from sessions.export.table import Selection, tables
from sessions.library.catalogue import Catalogue
from sessions.library.curves_build import build
from sessions.library.remove import Retention, too_many
from sessions.library.scan import extent
from sessions.recording.manifest import RECORDING, read_manifest, write_manifest
from sessions.recording.mcap_append import McapLog
from sessions.recording.mcap_log import read
from sessions.recording.timeline import straight
from sessions.replay.source import Source

DATA = Path(__file__).parent / "data"
TABLE = DATA / "20240101-000000-table" / RECORDING
STEPS = {"back": -YEAR_S, "forward": YEAR_S, "minutes": -300.0}


def stepped(folder: Path, step_s: float, frozen: bool, source: Path = TABLE) -> Path:
    """The recording as it would be had the wall clock been set in its middle: own times and receive
    times jump; `frozen`: receive times stood still instead, as recorders of before made them.
    """
    rows = list(read(source))
    middle = (rows[0].log_ns + rows[-1].log_ns) // 2
    folder.mkdir(parents=True, exist_ok=True)
    out = folder / RECORDING
    last: dict[str, int] = {}
    with out.open("wb") as stream:
        log = McapLog(stream.fileno(), 4096)
        for k, row in enumerate(rows):
            late = row.log_ns >= middle
            log_ns = row.log_ns + (round(step_s * 1e9) if late else 0)
            device = row.key.split("/")[1]
            if frozen:
                log_ns = last[device] = max(last.get(device, 0), log_ns)
            topic, payload, own = parse(row.key).topic, row.payload, row.publish_ns
            message = topic.type.FromString(payload)
            if late and "header" in message.DESCRIPTOR.fields_by_name and message.header.utc_ns:
                message.header.utc_ns += round(step_s * 1e9)
                payload, own = message.SerializeToString(), message.header.utc_ns
            log.add(log.open_channel(row.key, topic), log_ns, own, payload, k)
            if k % 20 == 0:
                log.close_chunk()
        log.finish()
        log.push()
    return out


@pytest.fixture(scope="module", params=[(s, f) for s in STEPS for f in (False, True)], ids=str)
def bent(request, tmp_path_factory) -> Path:
    name, frozen = request.param
    return stepped(tmp_path_factory.mktemp("stepped"), STEPS[name], frozen)


def test_a_recording_without_steps_passes_through_byte_for_byte():
    for path in DATA.glob("*/*.mcap"):
        assert list(straight(path)) == list(read(path))


def test_times_are_those_without_the_step(bent):
    right = tables(TABLE, Selection(frozenset({ACCEL.name, RATE.name, TACHO.name})))
    found = tables(bent, Selection(frozenset({ACCEL.name, RATE.name, TACHO.name})))
    assert found.keys() == right.keys()
    for key, table in right.items():
        assert len(found[key]) == len(table)
        np.testing.assert_allclose(found[key].data["utc_s"], table.data["utc_s"], atol=2e-6)
    rows = list(straight(bent))
    log_ns = np.array([row.log_ns for row in rows])
    assert (np.diff(log_ns) >= -1e9).all()
    whole = extent(TABLE).seconds
    assert (log_ns.max() - log_ns.min()) / 1e9 == pytest.approx(whole, abs=3.5)


def test_curves_and_replay_span_what_has_elapsed(bent):
    right, found = build(TABLE), build(bent)
    assert found.seconds == pytest.approx(right.seconds, abs=3.5)
    assert found.lines.keys() == right.lines.keys()
    source = Source(bent, (ACCEL,))
    assert source.length_s == pytest.approx(right.seconds, abs=3.5)
    assert len(list(source.items())) == len(list(Source(TABLE, (ACCEL,)).items()))


def run(*arguments: object, folder: Path) -> subprocess.CompletedProcess:
    """The command, in 2.5 GB of address space at most."""

    def bound() -> None:
        resource.setrlimit(resource.RLIMIT_AS, (2500 * 1024**2,) * 2)

    return subprocess.run(
        [sys.executable, "-P", "-m", "gyrofree", *map(str, arguments)],
        cwd=folder,
        capture_output=True,
        text=True,
        preexec_fn=bound,
        env={"OPENBLAS_NUM_THREADS": "1", "PATH": "/usr/bin:/bin", "HOME": str(folder)},
    )


@pytest.mark.parametrize("frozen", [False, True])
def test_a_report_of_a_recording_whose_clock_was_set_back_a_year(tmp_path, frozen):
    path = stepped(tmp_path / "20240101-000000-table", -YEAR_S, frozen)
    done = run("report", path, "--out", tmp_path / "report", folder=tmp_path)
    assert done.returncode in (0, 1) and not done.stderr, done.stderr[-2000:]  # 1: its verdict
    facts = json.loads((tmp_path / "report" / "report.json").read_text())
    run("report", TABLE, "--out", tmp_path / "right", folder=tmp_path)
    right = json.loads((tmp_path / "right" / "report.json").read_text())
    assert facts["seconds"] == pytest.approx(right["seconds"], abs=1e-3)
    figures = [one["figures"]["rate_rms_z_dps"] for one in (facts, right)]
    assert figures[0] == pytest.approx(figures[1], rel=1e-3)
    assert facts["verdict"] == right["verdict"]


def absurd(folder: Path) -> Path:
    """The board's own clock, and with it all stamps, jump by a year: no clock tells it from a
    pause.
    """
    folder.mkdir(parents=True)
    rows = list(read(TABLE))
    middle = (rows[0].log_ns + rows[-1].log_ns) // 2
    with (folder / RECORDING).open("wb") as stream:
        log = McapLog(stream.fileno(), 128 * 1024)
        for k, row in enumerate(rows):
            topic, payload = parse(row.key).topic, row.payload
            message = topic.type.FromString(payload)
            shift = round(YEAR_S * 1e9) if row.log_ns >= middle else 0
            if "header" in message.DESCRIPTOR.fields_by_name:
                message.header.utc_ns += shift
                message.header.device_us += shift // 1000
                payload = message.SerializeToString()
            number = log.open_channel(row.key, topic)
            log.add(number, row.log_ns + shift, row.publish_ns + shift, payload, k)
        log.finish()
        log.push()
    return folder / RECORDING


def test_memory_does_not_go_with_the_span_of_time_stamps(tmp_path):
    path = absurd(tmp_path / "20240101-000000-table")
    done = run("report", path, "--out", tmp_path / "report", folder=tmp_path)
    assert done.returncode in (0, 1) and not done.stderr, done.stderr[-2000:]
    assert build(path).seconds == pytest.approx(YEAR_S, rel=0.01)


def test_retention_goes_by_the_order_of_recording(tmp_path):
    """The newest was recorded with a clock that had been set back a year."""
    now_s = 1_800_000_000.0
    for number, (name, age_s) in enumerate(
        {
            "20260101-000000": 300 * 86400.0,
            "20260601-000000": 5.0,
            "20250601-000000": YEAR_S,
            "20280601-000000": -YEAR_S,
        }.items(),
        1,
    ):
        folder = tmp_path / name
        shutil.copytree(TABLE.parent, folder)
        manifest = read_manifest(TABLE.parent).model_copy(update={"id": name, "number": number})
        manifest.start_utc_ns = manifest.end_utc_ns = round((now_s - age_s) * 1e9)
        write_manifest(folder, manifest)
    catalogue = Catalogue(tmp_path)

    def going(rule: Retention) -> list[str]:
        return [info.id for info in too_many(catalogue, rule, now_s)]

    assert going(Retention(days=30.0)) == ["20260101-000000"]
    size = catalogue.get("20260101-000000").bytes
    assert going(Retention(max_bytes=2 * size + 1)) == ["20260101-000000", "20260601-000000"]
