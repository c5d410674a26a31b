"""Recordings in other programs' formats, read back by those formats' own libraries."""

import csv
import math
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import duckdb
import numpy as np
import pyarrow.parquet as pq
import pytest
from mcap.reader import make_reader
from scipy.io import loadmat
from support.hostile import HOSTILE
from support.mcap_protobuf_free import decoded
from support.table_session import table_recording

from estimator.pipeline import Pipeline
from estimator.settings import EstimatorSettings
from gyrofree.running.importer import rows_of
from inertial.simulation.table import TableTest
from logs.board_log import read_board_log
from messages.contract import gyrofree_pb2 as pb
from messages.contract import rates
from messages.contract.topics import ACCEL, GNSS, NAV, NOTE, RATE
from messages.text import cell
from sessions.export.export import ExportError, export
from sessions.export.table import Selection, tables
from sessions.recording.mcap_append import McapLog
from sessions.recording.mcap_log import read

DATA = Path(__file__).parent / "data"
KEY = "gyrofree/cube/rate/products-ekf"


@pytest.fixture(scope="module")
def recording():
    return table_recording()


def recorded(path, key, type_):
    return [type_.FromString(row.payload) for row in read(path) if row.key == key]


def test_csv_holds_every_number_that_was_recorded(recording, tmp_path):
    export(recording, "csv", tmp_path)
    with (tmp_path / "cube.accel.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    sent = recorded(recording, "gyrofree/cube/accel", pb.AccelBatch)
    assert len(rows) == sum(len(m.counts) // m.axes for m in sent)
    assert [int(rows[7][f"a{j}{k}_counts"]) for j in range(1, 5) for k in range(1, 4)] == list(
        sent[7].counts
    )
    assert float(rows[7]["utc_s"]) == pytest.approx(sent[7].header.utc_ns / 1e9, abs=1e-6)


def test_parquet_is_read_by_duckdb_and_has_the_units_in_its_names(recording, tmp_path):
    files = export(recording, "parquet", tmp_path)
    path = tmp_path / "cube.rate.products-ekf.parquet"
    assert path in files
    sent = recorded(recording, KEY, pb.RateBatch)
    query = f"select count(*), max(omega_ib_b_radps_z), min(omega_ib_b_radps_z) from '{path}'"
    ((count, high, low),) = duckdb.sql(query).fetchall()
    z = [m.omega_ib_b_radps[2] for m in sent]
    assert (count, high, low) == (len(sent), max(z), min(z))
    assert pq.read_schema(path).metadata[b"key"] == KEY.encode()


def test_mat_has_a_struct_per_key(recording, tmp_path):
    (path,) = export(recording, "mat", tmp_path, Selection(frozenset({"rate"})))
    found = loadmat(path, simplify_cells=True)["cube_rate_products_ekf"]
    sent = recorded(recording, KEY, pb.RateBatch)
    assert np.array_equal(found["angle_z_rad"], [m.angle_z_rad[0] for m in sent])


def test_cut_mcap_has_the_same_bytes_of_that_time_only(recording, tmp_path):
    (path,) = export(recording, "mcap", tmp_path, Selection(frozenset({"accel"}), 10.0, 12.0))
    whole = [row for row in read(recording) if row.key == "gyrofree/cube/accel"]
    start = next(iter(read(recording))).log_ns
    wanted = [row.payload for row in whole if 10e9 <= row.log_ns - start <= 12e9]
    with path.open("rb") as stream:
        got = [message.data for _, _, message in make_reader(stream).iter_messages()]
    assert got == wanted and len(got) > 150


def test_the_plain_mcap_reader_decodes_with_the_schema_in_the_file(recording):
    """Nothing of ours: descriptors come from the recording."""
    message = decoded(recording, KEY)
    assert message.DESCRIPTOR.full_name == "gyrofree.v1.RateBatch"
    assert message is not None and type(message).__module__ != pb.RateBatch.__module__
    assert len(message.omega_ib_b_radps) == 3


def test_rerun_opens_a_recording_unmodified(recording, tmp_path):
    """The `rerun` program of rerun-sdk converts it and finds no fault in it."""
    out = tmp_path / "recording.rrd"
    command = [
        str(Path(sys.executable).parent / "rerun"),
        "mcap",
        "convert",
        str(recording),
        "-o",
        str(out),
    ]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert out.stat().st_size > 100_000


def test_an_exported_mcap_has_rate_estimates_one_by_one_for_other_viewers(tmp_path):
    """Batches of a pipeline: every sample stands alone, at its own time, in a schema of numbers."""
    pipeline, block = Pipeline(EstimatorSettings(rate=["products-ekf"])), TableTest(1).block(0)
    path, batches_sent = tmp_path / "batches.mcap", []
    with path.open("wb") as stream:
        log = McapLog(stream.fileno(), 65536)
        for k in range(0, 300, 10):
            header = pb.Header(device="cube", utc_ns=10**18 + k * 10**7, device_us=k * 10_000)
            f = block.readings[k : k + 10].ravel()
            batch = pb.AccelBatch(header=header, first_index=k, period_s=0.01, axes=12, f_mps2=f)
            for o in pipeline.on(ACCEL, batch):
                if o.topic is RATE:
                    batches_sent.append(o.message)
                    log.add(
                        log.open_channel(KEY, RATE),
                        header.utc_ns + 10**8,
                        header.utc_ns,
                        o.message.SerializeToString(),
                    )
        log.finish()
        log.push()
    (single,) = export(path, "mcap", tmp_path)
    sent = [one for batch in batches_sent for one in rates.rows(batch)]
    with single.open("rb") as stream:
        got = list(make_reader(stream).iter_messages())
    assert {schema.name for schema, _, _ in got} == {"gyrofree.v1.RateEstimate"}
    assert [m.data for _, _, m in got] == [one.SerializeToString() for one in sent]
    assert len(sent) == 300 and all(np.diff([m.log_time for _, _, m in got]) == 10**7)
    assert {len(one.innovation) for one in sent} == {0, 6}
    whole, again = (tables(p, Selection(frozenset({RATE.name})))[KEY] for p in (path, single))
    for name, column in whole.data.items():
        assert np.array_equal(column, again.data[name], equal_nan=column.dtype.kind == "f"), name
    out = tmp_path / "single.rrd"
    rerun = str(Path(sys.executable).parent / "rerun")
    command = [rerun, "mcap", "convert", str(single), "-o", str(out)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert out.stat().st_size > 10_000


def test_tracks_want_fixes(recording, tmp_path):
    with pytest.raises(ExportError, match="neither fixes nor a navigation solution"):
        export(recording, "kml", tmp_path)


def test_a_drive_becomes_a_track(tmp_path):
    path = tmp_path / "drive.mcap"
    with path.open("wb") as stream:
        log = McapLog(stream.fileno(), 65536)
        for k in range(20):
            fix = pb.GnssFix(
                latitude_deg=40.0 + k * 1e-5,
                longitude_deg=-105.0,
                height_m=1600.5,
                height_msl_m=1617.25,
                height_reference=pb.HEIGHT_REFERENCE_ELLIPSOID,
            )
            fix.header.utc_ns = 1_700_000_000_000_000_000 + k * 10**9
            log.add(
                log.open_channel("gyrofree/car/gnss", GNSS),
                fix.header.utc_ns,
                0,
                fix.SerializeToString(),
            )
        log.finish()
        log.push()
    (kml,) = export(path, "kml", tmp_path)
    (gpx,) = export(path, "gpx", tmp_path)
    line = ET.parse(kml).find(".//{*}coordinates").text.split()
    assert len(line) == 20 and line[3] == "-105.000000000,40.000030000,1617.2500"
    points = ET.parse(gpx).findall(".//{*}trkpt")
    assert (
        points[0].find("{*}time").text == "2023-11-14T22:13:20.000Z"
        and points[0].get("lat") == "40.000000000"
    )


def drive_of(path, **fix):
    """A recording of four fixes with a solution at 1601 m above the ellipsoid between them."""
    with path.open("wb") as stream:
        log = McapLog(stream.fileno(), 65536)
        for k in range(8):
            place = {"latitude_deg": 40.0 + k * 1e-5, "longitude_deg": -105.0}
            nav = pb.NavSolution(height_m=1601.0, height_reference=1, **place)
            message, topic, key = nav, NAV, "gyrofree/car/nav/kf"
            if k % 2 == 0:
                message, topic, key = (
                    pb.GnssFix(quality=1, **place, **fix),
                    GNSS,
                    "gyrofree/car/gnss",
                )
            message.header.utc_ns = 1_700_000_000_000_000_000 + k * 10**9
            channel = log.open_channel(key, topic)
            log.add(channel, message.header.utc_ns, 0, message.SerializeToString())
        log.finish()
        log.push()
    return path


def test_heights_of_tracks_are_above_the_sea(tmp_path):
    """Also those of a filter, by the geoid that the receiver gave."""
    fix = {"height_m": 1600.5, "height_msl_m": 1617.25, "height_reference": 1}
    path = drive_of(tmp_path / "a.mcap", **fix)
    (gpx,) = export(path, "gpx", tmp_path)
    heights = [float(ele.text) for ele in ET.parse(gpx).findall(".//{*}ele")]
    assert heights == [1617.25] * 4 + [1617.75] * 4
    (gpx,) = export(path, "gpx", tmp_path, Selection(frozenset({NAV.name})))
    assert [float(ele.text) for ele in ET.parse(gpx).findall(".//{*}ele")] == [1617.75] * 4


@pytest.mark.parametrize(
    "fix",
    [
        {"height_m": 1600.5, "height_msl_m": math.nan, "height_reference": 1},
        {"height_m": math.nan, "height_msl_m": math.nan, "height_reference": 3},
        {"height_m": 1600.5},  # of an older version, which left out what it did not know
    ],
)
def test_a_height_above_the_sea_that_is_not_known_is_left_out_and_said(tmp_path, fix):
    path = drive_of(tmp_path / "a.mcap", **fix)
    (gpx,) = export(path, "gpx", tmp_path)
    assert len(ET.parse(gpx).findall(".//{*}trkpt")) == 8
    assert not ET.parse(gpx).findall(".//{*}ele")
    assert all("not known" in d.text for d in ET.parse(gpx).findall(".//{*}desc"))
    (kml,) = export(path, "kml", tmp_path)
    modes = {mode.text for mode in ET.parse(kml).findall(".//{*}altitudeMode")}
    assert modes == {"clampToGround"}
    assert ET.parse(kml).find(".//{*}coordinates").text.split()[0] == "-105.000000000,40.000000000"


def test_nothing_selected_is_said(recording, tmp_path):
    with pytest.raises(ExportError, match="no message of the wanted topics and time"):
        export(recording, "csv", tmp_path, Selection(start_s=1e6))
    with pytest.raises(ExportError, match="want one of csv"):
        export(recording, "xls", tmp_path)


def test_a_table_in_memory_is_the_recording(recording):
    found = tables(recording, Selection(frozenset({RATE.name, ACCEL.name})))
    sent = recorded(recording, KEY, pb.RateBatch)
    assert np.array_equal(found[KEY].data["nis"], [m.nis[0] for m in sent])
    readings = found["gyrofree/cube/accel"]
    assert readings.vector("a11_mps2", "a43_mps2").shape == (3000, 2)
    assert readings.data["utc_s"][-1] - readings.data["utc_s"][0] == pytest.approx(29.99, abs=1e-3)


def test_no_cell_of_a_csv_begins_a_formula(tmp_path):
    """Notes of whoever was on the bus, opened by a spreadsheet; numbers stay what they are."""
    path = tmp_path / "recording.mcap"
    words = ["=1+1", "+cmd|' /C calc'!A0", "-2+3", "@SUM(A1)", "\t=1", "plain, with comma", '="x"']
    # a note longer than the contract allows is no note
    words += [word for word in HOSTILE if len(word) < 4000]
    with path.open("wb") as stream:
        log = McapLog(stream.fileno(), 1024)
        channel = log.open_channel("gyrofree/cube/note", NOTE)
        for k, word in enumerate(words):
            at = 1_700_000_000_000_000_000 + k * 10**9
            note = pb.Note(header=pb.Header(device="cube", utc_ns=at, sequence=k + 1), text=word)
            log.add(channel, at, at, note.SerializeToString(), k + 1)
        log.finish()
        log.push()
    [file] = export(path, "csv", tmp_path / "out")
    with file.open(newline="", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == len(words)
    for row, word in zip(rows, words, strict=True):
        assert row["text"] == cell(word)
        assert row["text"][:1] not in ("=", "+", "-", "@", "\t", "\r", "\n")
        assert float(row["utc_s"]) > 1.6e9 and not {"\x1b", "\u202e"} & set(row["text"])


@pytest.mark.parametrize("session", ["table", "drive"])
def test_no_cell_holds_a_structure_and_zeros_are_spelt_out(tmp_path, session):
    path = DATA / f"20240101-000000-{session}" / "recording.mcap"
    for file in export(path, "csv", tmp_path):
        rows = list(csv.reader(file.open(newline="", encoding="utf-8")))
        assert not any(set("{[") & set(cell) for row in rows for cell in row), file.name
        assert len(set(rows[0])) == len(rows[0])
        if ".pose." in file.name:
            place = rows[0].index("rotation_x")
            assert all(row[place] != "" for row in rows[1:])


@pytest.mark.parametrize("session", ["table", "drive"])
def test_an_export_is_read_again_as_the_log_it_was(tmp_path, session):
    path = DATA / f"20240101-000000-{session}" / "recording.mcap"
    out = tmp_path
    files = {file.name: file for file in export(path, "csv", out)}
    log = read_board_log(files["cube.accel.csv"] if session == "table" else out)
    found = tables(path)
    key = "gyrofree/cube/accel" if session == "table" else "gyrofree/car/imu"
    np.testing.assert_allclose(log.t_s, found[key].data["utc_s"], atol=1e-6)
    if session == "table":
        np.testing.assert_array_equal(log.counts[:, 0], found[key].data["a11_counts"])
        reports = found["gyrofree/cube/tacho"].data
        rates = dict(zip(np.round(reports["utc_s"], 5), reports["omega_radps"], strict=True))
        wanted = [rates.get(t, 0.0) for t in np.round(log.t_s, 5)]  # no pulse: it stands
        assert len(reports["utc_s"]) > 100 and np.array_equal(log.tacho, wanted)
        return
    np.testing.assert_array_equal(log.f_b[:, 1], found[key].data["f_b_mps2_y"])
    fixes = found["gyrofree/car/gnss"].data
    assert len(log.fixes) == len(fixes["utc_s"])
    last = log.fixes[-1]
    assert np.degrees(last.latitude) == pytest.approx(fixes["latitude_deg"][-1], abs=1e-12)
    assert last.v_n[2] == fixes["v_n_mps_d"][-1] and last.sigma_p[2] == 3.2
    assert last.quality == 1 == fixes["quality"][-1]  # the bus's own numbers, not RTKLIB's
    again = list(rows_of(log, "gyrofree", "car"))
    assert again[0][0] == pytest.approx(round(found[key].data["utc_s"][0] * 1e9), abs=1000)
