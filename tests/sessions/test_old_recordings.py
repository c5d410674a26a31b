"""Recordings of version 1 (one message per estimate) open, replay, report, compare and export.

tests/sessions/data holds two sessions as that version wrote them: a table turning after two seconds
of rest with two rate estimators, and a drive with two navigation filters. What they say is read a
second time here with the descriptors that stand in the files, which nobody can change any more.
"""

import csv
import shutil
import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from mcap.reader import make_reader

from estimator.pipeline import Pipeline
from estimator.settings import EstimatorSettings
from messages.contract.topics import INNOVATION, NAV, RATE
from sessions.export.export import export
from sessions.export.table import Selection, tables
from sessions.library.catalogue import Catalogue
from sessions.library.compare import compare
from sessions.library.curves_build import build as curves_of
from sessions.library.verify import verify
from sessions.recording.manifest import read_manifest
from sessions.replay.playback import RECORDED, Playback
from sessions.replay.reproduce import reproduce
from sessions.replay.rerun import estimates_again, write_session
from sessions.report.build import build as report_of
from sessions.report.data import load_run
from sessions.report.verdict import load_spec

DATA = Path(__file__).parent / "data"
TABLE, DRIVE = "20240101-000000-table", "20240101-000000-drive"
RATES = ("products-ekf", "least-squares")
FILTERS = ("kf", "fpe-fuzzy")
ESTIMATES = 200  # of each rate estimator: 8 s at 25 Hz
SETTINGS = EstimatorSettings(
    rate=list(RATES), navigators=list(FILTERS), attitudes=["vqf"], nav_limit_hz=2.0
)


def recording(session: str) -> Path:
    return DATA / session / "recording.mcap"


@pytest.fixture
def root(tmp_path) -> Path:
    """A copy, for what writes beside a recording."""
    return Path(shutil.copytree(DATA, tmp_path / "sessions"))


def as_written(session: str, key: str) -> list:
    """Messages of a key, by the descriptors in the file."""
    found = []
    with recording(session).open("rb") as stream:
        for schema, _, message in make_reader(stream).iter_messages(topics=[key]):
            pool = descriptor_pool.DescriptorPool()
            for file in descriptor_pb2.FileDescriptorSet.FromString(schema.data).file:
                pool.Add(file)
            type_ = message_factory.GetMessageClass(pool.FindMessageTypeByName(schema.name))
            found.append(type_.FromString(message.data))
    return found


@pytest.mark.parametrize("name", RATES)
def test_every_rate_of_the_old_form_is_read_as_it_was_written(name):
    key = f"gyrofree/cube/rate/{name}"
    written = as_written(TABLE, key)
    assert len(written) == ESTIMATES and written[0].DESCRIPTOR.name == "RateEstimate"
    table = tables(recording(TABLE), Selection(frozenset({RATE.name})))[key]
    for field in ("omega_ib_b_radps", "alpha_b_radps2", "f_b_mps2"):
        read = table.vector(*(f"{field}_{end}" for end in "xyz"))
        assert np.array_equal(read, [list(getattr(m, field)) for m in written])
    covariance = table.vector(*(f"omega_covariance_{k}" for k in range(9)))
    assert np.array_equal(covariance, [list(m.omega_covariance) for m in written])
    for field in ("angle_z_rad", "nis", "nis_dof", "still", "for_index", "for_sequence"):
        assert np.array_equal(table.data[field], [getattr(m, field) for m in written])
    assert np.allclose(table.data["utc_s"], [m.header.utc_ns / 1e9 for m in written], atol=1e-6)
    assert table.data["epoch"].tolist() == [m.header.epoch for m in written]
    assert table.data["estimator"].tolist() == [m.estimator for m in written]


def test_the_library_lists_and_verifies_them(root):
    for session, device in ((TABLE, "cube"), (DRIVE, "car")):
        info = Catalogue(root).get(session)
        assert list(info.devices) == [device] and info.state == "closed"
        assert verify(root / session).ok


def test_a_replay_gives_every_estimate_again():
    """The very bits of another version of the filters cannot be asked for, the estimates can."""
    found = reproduce(recording(TABLE), Pipeline(SETTINGS)).keys
    assert set(found) == {f"gyrofree/cube/rate/{name}" for name in RATES}
    for one in found.values():
        assert (one.equal + one.different, one.missing, one.extra) == (ESTIMATES, 0, 0)
    found = reproduce(recording(DRIVE), Pipeline(SETTINGS)).keys
    assert set(found) == {
        f"gyrofree/car/{topic.name}/{name}" for topic in (NAV, INNOVATION) for name in FILTERS
    }
    assert all(not one.missing and one.equal + one.different for one in found.values())


def test_a_rerun_stands_beside_the_old_estimates_and_agrees_with_them(tmp_path):
    again = estimates_again(recording(TABLE), Pipeline(SETTINGS), "new")
    folder = write_session(tmp_path, TABLE, again, "again", {})
    found = load_run(folder / "recording.mcap")
    by_name = {rate.name: rate for rate in found.rates}
    assert set(by_name) == {*RATES, *(f"{name}-new" for name in RATES)}
    for name in RATES:
        before, after = by_name[name], by_name[f"{name}-new"]
        assert np.array_equal(before.t, after.t)
        apart = np.abs(before.omega_b - after.omega_b)
        assert (apart <= before.sigma + 1e-3).all()  # where the sign is decided, rounding counts
        assert apart[-25:].max() < 1e-3
        assert abs(before.angle_z[-1] - after.angle_z[-1]) < 1e-2


def test_a_playback_shows_the_old_estimates_beside_the_new_ones():
    shown: dict[str, int] = {}

    def put(address, device, message):
        if address.topic is RATE:
            shown[message.estimator] = shown.get(message.estimator, 0) + 1
            assert message.estimator == address.estimator and device == "cube-replay"

    playback = Playback(
        recording(TABLE), put, lambda: Pipeline(SETTINGS), speed=100.0, show_recorded=True
    )
    playback.run(threading.Event())
    assert shown == dict.fromkeys((*RATES, *(name + RECORDED for name in RATES)), ESTIMATES)


def test_a_report_has_the_figures_of_the_turn(root):
    run = load_run(root / TABLE / "recording.mcap")
    assert [rate.name for rate in run.rates] == sorted(RATES)
    assert run.seconds == pytest.approx(7.96, abs=0.01)
    products = next(rate for rate in run.rates if rate.name == "products-ekf")
    assert np.degrees(products.omega_b[-25:, 2]).mean() == pytest.approx(-171.0, abs=8.0)
    report = report_of(root / TABLE / "recording.mcap", load_spec(None))
    assert "products-ekf" in report.html and report.pdf.startswith(b"%PDF")
    report = report_of(root / DRIVE / "recording.mcap", load_spec(None))
    assert "fpe-fuzzy" in report.html


def test_two_of_them_are_compared(root):
    table, drive = (curves_of(root / name / "recording.mcap") for name in (TABLE, DRIVE))
    assert {line.title for line in table.of_kind("rate")} == set(RATES)
    assert {name for name in drive.tracks} == {"car/gnss", *(f"car/nav/{f}" for f in FILTERS)}
    found = compare([table, replace(table, session="again")])
    same = [d for d in found.differences if d.line == d.against]
    assert same and all(d.rms["z"] == pytest.approx(0.0, abs=1e-6) for d in same)


def test_exports_have_a_row_per_estimate(root, tmp_path):
    export(root / TABLE / "recording.mcap", "csv", tmp_path)
    export(root / TABLE / "recording.mcap", "parquet", tmp_path)
    export(root / DRIVE / "recording.mcap", "gpx", tmp_path)
    for name in RATES:
        with (tmp_path / f"cube.rate.{name}.csv").open() as stream:
            rows = list(csv.DictReader(stream))
        written = as_written(TABLE, f"gyrofree/cube/rate/{name}")
        assert [int(row["for_index"]) for row in rows] == [m.for_index for m in written]
        assert [float(row["omega_ib_b_radps_z"]) for row in rows] == [
            m.omega_ib_b_radps[2] for m in written
        ]
    assert read_manifest(root / TABLE).keys["gyrofree/cube/rate/products-ekf"].messages == ESTIMATES
