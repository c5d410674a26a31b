"""Sessions over one another: alignment by correlation, the kept curves, differences, what a browser
gets to draw.
"""

import json
import shutil

import numpy as np
import pytest
from support.table_session import SESSION, table_recording, table_root

from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import NAV, NOTE, RATE, TACHO, parse
from sessions.library import curves as kept
from sessions.library.compare import CompareError, as_dict, compare, errors
from sessions.library.compare_figure import draw
from sessions.library.correlation import correlate
from sessions.library.curves_build import build, ensure, main
from sessions.library.overlay import drawing
from sessions.library.scan import extent, scan
from sessions.recording.mcap_log import read
from sessions.replay.rerun import write_session

DT = 0.01


def motion(t):
    swing = np.where((t > 3) & (t < 12), 3.0 * np.sin(0.4 * (t - 3)) ** 2, 0.0)
    return swing + np.where((t > 14) & (t < 20), 2.0, 0.0)


def noisy(t, seed):
    return motion(t) + 0.05 * np.random.default_rng(seed).standard_normal(len(t))


@pytest.mark.parametrize("offset", [0.0, 2.3456, -4.321, 11.117])
def test_the_shift_is_found_between_samples_in_spite_of_gaps_and_lengths(offset):
    a = noisy(np.arange(0, 30, DT), 1)
    b = noisy(np.arange(0, 22, DT) + offset, 2)
    b[500:600] = np.nan
    found = correlate(a, b, DT)
    assert found.offset_s == pytest.approx(offset, abs=0.005)
    assert found.correlation > 0.99 and found.quality == "good"
    wanted = min(30.0, 22.0 + offset) - max(0.0, offset)
    assert wanted - 1.1 < found.overlap_s < wanted + 0.1


def test_repeated_motion_is_ambiguous_and_noise_has_no_alignment():
    a = np.tile(noisy(np.arange(0, 30, DT), 1), 4)
    b = np.tile(noisy(np.arange(0, 30, DT), 2), 2)
    found = correlate(a, b, DT)
    assert found.quality == "ambiguous"
    assert (found.rival_s - found.offset_s) % 30.0 == pytest.approx(0.0, abs=0.05)
    noise = correlate(
        noisy(np.arange(0, 30, DT), 3), np.random.default_rng(4).standard_normal(2000), DT
    )
    assert noise.quality == "none"
    assert correlate(a, np.zeros(3000), DT) is None
    assert correlate(a, np.full(3000, np.nan), DT) is None


BEGIN_S, END_S, HOLE = 3.37, 26.0, (11.0, 12.0)


@pytest.fixture(scope="module")
def root(tmp_path_factory):
    """The table's session; `later`: a part of it, begun later by another gateway run, with a hole
    and a remark.
    """
    root = tmp_path_factory.mktemp("compare")
    shutil.copytree(table_root() / SESSION, root / SESSION)
    first = extent(table_recording()).first_ns

    def rows():
        for row in read(table_recording()):
            at = (row.log_ns - first) / 1e9
            if not BEGIN_S <= at <= END_S or HOLE[0] < at < HOLE[1]:
                continue
            message = parse(row.key).topic.type.FromString(row.payload)
            if "header" in message.DESCRIPTOR.fields_by_name:
                message.header.run = 77
                message.header.utc_ns += 86_400_000_000_000
            yield row.log_ns + 86_400_000_000_000, row.key, message.SerializeToString()
        moment = first + 86_400_000_000_000 + 13_370_000_000
        note = pb.Note(
            header=pb.Header(device="cube", run=77, utc_ns=moment),
            text="nudged",
            author="ann",
            at_utc_ns=moment,
        )
        yield (
            first + 86_400_000_000_000 + 26_000_000_000,
            NOTE.key("gyrofree", "cube"),
            note.SerializeToString(),
        )

    write_session(root, "20240102-000003-later", rows(), "", {})
    return root


@pytest.fixture(scope="module")
def pair(root):
    return [ensure(root / name / "recording.mcap") for name in (SESSION, "20240102-000003-later")]


def test_curves_are_the_recordings_and_kept_until_it_changes(root, tmp_path):
    path = root / SESSION / "recording.mcap"
    made = build(path)
    sent = [
        pb.RateBatch.FromString(row.payload)
        for row in read(path)
        if row.key.endswith("rate/products-ekf")
    ]
    line = made.lines["cube/rate/products-ekf"]
    assert made.bin_s == 0.01 and len(line.mean) == 3000
    omega = np.array([m.omega_ib_b_radps for m in sent])
    assert np.nanmean(np.abs(line.mean[:, :3] - omega[: len(line.mean)])) < 1e-3
    assert np.nanmax(line.high[:, 2]) == pytest.approx(omega[:, 2].max(), abs=1e-6)
    copy = tmp_path / SESSION
    copy.mkdir()
    shutil.copy(path, copy)
    mine = copy / "recording.mcap"
    assert kept.state(mine) == "none" and kept.load(mine) is None
    assert main([str(mine)]) == 0 and kept.state(mine) == "fresh"
    again = kept.load(mine)
    for key, one in made.lines.items():
        assert np.array_equal(again.lines[key].mean, one.mean, equal_nan=True)
    said = np.array([m.sight[2] if m.sight else 0 for m in sent], dtype=np.uint8)
    # some bins hold two samples
    assert said.any() and np.mean(line.sight[:, 2] != said[: len(line.sight)]) < 0.02
    assert np.array_equal(again.lines[line.key].sight, line.sight)
    with mine.open("ab") as stream:
        stream.write(b"x")
    assert kept.state(mine) == "stale" and kept.load(mine) is None
    cut = (copy / kept.FILE).read_bytes()[:5000]
    (copy / kept.FILE).write_bytes(cut)
    assert kept.state(mine) == "none"


def test_what_is_no_recording_is_said_in_one_line(tmp_path, capsys):
    (tmp_path / "x.mcap").write_bytes(b"nothing of the kind")
    assert main([str(tmp_path / "x.mcap")]) == 1
    said = capsys.readouterr().err
    assert "x.mcap" in said and len(said.splitlines()) == 1


def test_a_scan_gives_the_same_messages_as_reading_from_front_to_end(root, tmp_path):
    path = root / SESSION / "recording.mcap"
    wanted = [(row.key, row.payload) for row in read(path) if parse(row.key).topic in (RATE, TACHO)]
    found = [
        (block.key, payload) for block in scan(path, (RATE, TACHO)) for payload in block.payloads
    ]
    assert sorted(found) == sorted(wanted)
    data = path.read_bytes()
    (tmp_path / "cut.mcap").write_bytes(data[: len(data) // 2])  # no index any more
    cut = [payload for block in scan(tmp_path / "cut.mcap", (RATE,)) for payload in block.payloads]
    assert (
        cut
        == [row.payload for row in read(tmp_path / "cut.mcap") if parse(row.key).topic is RATE]
        != []
    )
    spoilt = bytearray(data)
    spoilt[len(data) // 2] ^= 0xFF  # inside a chunk: that one is left out
    (tmp_path / "spoilt.mcap").write_bytes(spoilt)
    left = sum(len(block.payloads) for block in scan(tmp_path / "spoilt.mcap", (RATE, TACHO)))
    assert 0.8 * len(wanted) < left < len(wanted)


@pytest.mark.parametrize("method", ["auto", "tacho", "rate"])
def test_another_sessions_motion_is_laid_over_the_first(pair, method):
    found = compare(pair, method)
    other = found.sessions[1]
    begin = BEGIN_S  # its first message is the first after this moment
    assert other.offset_s == pytest.approx(begin, abs=0.012) and other.by == (
        "tacho" if method == "auto" else method
    )
    assert other.shift.correlation > 0.999 and other.quality in ("good", "ambiguous")
    (lead,) = [d for d in found.differences if d.line == "cube/rate/products-ekf"]
    assert 20.0 < lead.seconds < 22.7  # the hole is left out
    assert max(lead.rms.values()) < np.radians(0.5)
    assert other.curves.marks[0].text == "nudged" and other.curves.marks[0].t == pytest.approx(
        10.0, abs=0.02
    )


def test_one_clock_needs_no_correlation_and_a_hand_moves_what_it_likes(root, pair):
    old = root / SESSION / "recording.mcap"
    first = extent(old).first_ns

    def rows():
        for row in read(old):
            if (row.log_ns - first) / 1e9 >= 5.0:
                key = row.key + "-new" if "/rate/" in row.key else row.key
                yield row.log_ns, key, row.payload

    write_session(root, "20240101-000005-again", rows(), "", {})
    again = ensure(root / "20240101-000005-again" / "recording.mcap")
    found = compare([pair[0], again])
    assert found.sessions[1].by == "clock" and found.sessions[1].quality == "exact"
    assert found.sessions[1].offset_s == pytest.approx(5.0, abs=0.011)
    new = [d for d in found.differences if d.line.endswith("products-ekf-new")]
    assert new and max(new[0].rms.values()) < 0.02  # bins of the two begin at different times
    moved = compare([pair[0], again], given={again.session: 4.0})
    assert moved.sessions[1].by == "given" and moved.sessions[1].offset_s == 4.0
    assert moved.differences[0].rms["z"] > 10 * found.differences[0].rms["z"]


def test_what_cannot_be_compared_says_why(pair):
    with pytest.raises(CompareError, match="the same session twice"):
        compare([pair[0], pair[0]])
    with pytest.raises(CompareError, match="auto, clock, tacho, rate, start"):
        compare(pair, "guess")
    with pytest.raises(CompareError, match="do not share a run"):
        compare(pair, "clock")
    with pytest.raises(CompareError, match="not among"):
        compare(pair, given={"20990101-000000": 1.0})
    with pytest.raises(CompareError, match="want two to 4"):
        compare([pair[0]] * 5)


def test_a_browser_gets_few_points_that_keep_the_extremes(pair):
    drawn = json.loads(
        json.dumps(drawing(compare(pair), points=200, everything=True), allow_nan=False)
    )
    for line in drawn["lines"]:
        for part in (*line["rate"].values(), *line["error"].values(), *line["angle"].values()):
            assert len(part["low"]) <= 101
    (z,) = [
        one for one in drawn["lines"] if one["session"] == 0 and one["title"] == "products filter"
    ]
    highest = np.degrees(np.nanmax(pair[0].lines["cube/rate/products-ekf"].high[:, 2]))
    assert max(v for v in z["rate"]["z"]["high"] if v is not None) == pytest.approx(
        highest, abs=1e-3
    )
    narrow = drawing(compare(pair), 10.0, 11.0)
    one = narrow["lines"][0]
    assert (
        one["dt"] == pytest.approx(0.01)
        and len(one["rate"]["z"]["low"]) <= 102
        and one["t0"] == pytest.approx(10.0, abs=0.02)
    )
    assert errors(pair[0])["cube/rate/products-ekf"]["against"] == "tacho"


def test_a_gap_stays_a_gap(pair):
    t = pair[1].t + BEGIN_S
    inside = (t > HOLE[0] + 0.1) & (t < HOLE[1] - 0.1)
    assert np.isnan(pair[1].lines["cube/rate/products-ekf"].mean[inside]).all()
    there = (t > 4.0) & (t < HOLE[0] - 0.1)
    assert np.isfinite(pair[1].lines["cube/rate/products-ekf"].mean[there]).all()


def test_tracks_are_compared_from_one_origin_and_drawn(tmp_path):
    def drive(shift_deg, east_m):
        for n in range(200):
            nav = pb.NavSolution(
                header=pb.Header(
                    device="car", sequence=n + 1, run=9, utc_ns=10**18 + n * 50_000_000
                ),
                mode=pb.NavSolution.MODE_NAVIGATING,
                origin_latitude_deg=48.0 + shift_deg,
                origin_longitude_deg=11.0,
            )
            north = n * 0.5 - np.radians(shift_deg) * 6_366_000.0
            nav.p_ned_m.extend((north, 3.0 + east_m, 0.0))
            if n >= 50:
                nav.position_covariance.extend((4.0, 0.5, 0.0, 0.5, 1.0, 0.0, 0.0, 0.0, 9.0))
            yield nav.header.utc_ns, NAV.key("gyrofree", "car", "kf"), nav.SerializeToString()

    one = write_session(tmp_path, "20010909-014640-a", drive(0.0, 0.0), "", {}) / "recording.mcap"
    two = (
        write_session(tmp_path, "20010909-014640-b", drive(0.001, 0.25), "", {}) / "recording.mcap"
    )
    told = build(one).tracks["car/nav/kf"].told
    assert np.isnan(told[:50, :3]).all() and np.array_equal(told[50], (4.0, 0.5, 1.0, 0.0))
    found = compare([build(one), build(two)])
    (track,) = found.tracks
    north, east, down = track.rms_ned_m
    assert east == pytest.approx(0.25, abs=0.01) and north < 0.6 and down < 1e-6
    assert found.sessions[1].by == "clock"
    tracks = drawing(found)["tracks"]
    assert [t["session"] for t in tracks] == [0, 1] and tracks[1]["east"][0] == pytest.approx(
        3.25, abs=0.01
    )
    assert draw(found, tmp_path / "tracks.png").stat().st_size > 10_000


@pytest.mark.parametrize("place", [(0.0, -1.2e6, 0.0), ()])
def test_a_filter_that_waits_for_its_first_fix_is_nowhere(tmp_path, place):
    """Old ones said 0, 0 with a sigma of 10,000 km, those of today no place."""

    def drive():
        for n in range(60):
            nav = pb.NavSolution(
                header=pb.Header(device="car", sequence=n + 1, run=9, utc_ns=10**18 + n * 10**8),
                origin_latitude_deg=48.0,
                origin_longitude_deg=11.0,
                sigma=[1.0] * 6 + [1e7 if n < 28 else 2.0] * 3 + [1.0] * 6,
            )
            nav.p_ned_m.extend(place if n < 28 else (n * 0.5, 3.0, 0.0))
            yield nav.header.utc_ns, NAV.key("gyrofree", "car", "kf"), nav.SerializeToString()

    folder = write_session(tmp_path, "20010909-014640-a", drive(), "", {})
    (track,) = build(folder / "recording.mcap").tracks.values()
    assert len(track.points) == 32 and np.abs(track.points[:, 1:]).max() < 40.0


def test_the_picture_and_the_facts_of_a_comparison(pair, tmp_path):
    found = compare(pair)
    assert draw(found, tmp_path / "two.png").read_bytes().startswith(b"\x89PNG")
    facts = json.loads(json.dumps(as_dict(found), allow_nan=False))
    assert [one["id"] for one in facts["sessions"]] == [SESSION, "20240102-000003-later"]
    assert set(facts["differences"][0]["rms_radps"]) == {"x", "y", "z"}
