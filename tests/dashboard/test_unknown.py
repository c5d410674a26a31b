"""What nobody knows on the pages: a dash with its reason, never a zero, and no drawing of it."""

import html
import json
import math
import re
from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dashboard.data.track import Track
from dashboard.scene.drawing import geometry as geo
from dashboard.scene.drawing.drawn import Curve, Name, drawn
from dashboard.scene.panels.base import rms_text, shades_of
from dashboard.scene.panels.navigation.position import height_text
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import GNSS, NAV
from sessions.library.compare import as_dict, compare
from sessions.library.curves_build import build
from sessions.library.overlay import drawing
from sessions.recording.mcap_append import McapLog

SEA, NONE = pb.HEIGHT_REFERENCE_SEA_LEVEL, pb.HEIGHT_REFERENCE_UNKNOWN


def test_a_height_says_what_it_counts_from_or_why_it_is_none():
    assert height_text(pb.NavSolution(height_m=357.6)) == "357.60 m"
    assert "sea level" in height_text(pb.NavSolution(height_m=310.5, height_reference=SEA))
    unknown = height_text(pb.NavSolution(height_m=math.nan, height_reference=NONE))
    assert unknown.startswith("–") and "no height" in unknown


def test_what_has_no_height_is_drawn_flat():
    assert geo.drawn_place([1.0, 2.0, math.nan]) == (1.0, 2.0, 0.0)
    covariance = [4.0, 0.0, 9.0, 0.0, 4.0, 9.0, 9.0, 9.0, 1e8]
    axes, _ = geo.ellipsoid(geo.flattened(covariance, True))
    assert max(axes) < 7.0
    assert geo.flattened(covariance, False) == covariance
    track = Track(spacing=0.1)
    track.add((1.0, 2.0, math.nan))
    assert track.last() == (1.0, 2.0, 0.0)


def test_tracks_without_heights_are_compared_and_drawn(tmp_path):
    path = tmp_path / "recording.mcap"
    with path.open("wb") as stream:
        log = McapLog(stream.fileno(), 65536)
        for k in range(40):
            place = {"latitude_deg": 40.0 + k * 1e-5, "longitude_deg": -105.0}
            unknown = {"height_m": math.nan, "height_reference": NONE}
            messages = {
                "t/car/gnss": (
                    GNSS,
                    pb.GnssFix(quality=1, height_msl_m=math.nan, **unknown, **place),
                ),
                "t/car/nav/kf": (
                    NAV,
                    pb.NavSolution(
                        p_ned_m=[k, 0.0, math.nan],
                        origin_latitude_deg=40.0,
                        origin_longitude_deg=-105.0,
                        origin_height_m=math.nan,
                        mode=3,
                        **unknown,
                        **place,
                    ),
                ),
            }
            for key, (topic, message) in messages.items():
                message.header.utc_ns = 1_700_000_000_000_000_000 + k * 10**9
                channel = log.open_channel(key, topic)
                log.add(channel, message.header.utc_ns, 0, message.SerializeToString())
        log.finish()
        log.push()
    curves = build(path)
    assert len(curves.tracks) == 2
    for track in curves.tracks.values():
        assert np.isfinite(track.points[:, :3]).all() and np.isnan(track.points[:, 3]).all()
        assert math.isfinite(track.origin[2])
    found = compare([curves, replace(curves, session="again")], given={"again": 0.0})
    for answer in (drawing(found), as_dict(found)):
        json.dumps(answer, allow_nan=False)
    assert [track["down"][0] for track in drawing(found)["tracks"]] == [None] * 4
    assert all(d.rms_ned_m == (0.0, 0.0, None) for d in found.tracks) and found.tracks


@given(st.lists(st.sampled_from([0, 1, 2]), min_size=3, max_size=60), st.integers(1, 9))
def test_no_heading_and_no_cursor_gives_a_number_that_an_estimator_does_not_vouch_for(said, size):
    """A value that nobody vouches for is 1e6 times as large here, so that any trace of it shows."""
    t, sight = np.arange(len(said), dtype=float), np.array(said)
    y = np.where(sight > 0, 1e6, float(size))
    curve = Curve("least squares", "#D55E00", t, y, sight=sight)
    ends = (0.0, float(len(said)))
    chart = drawn(
        Name("rate", "°/s"), [curve], *ends, True, shades=shades_of(t, sight), cursors=ends
    )
    heading = re.sub(r"data-chart='[^']*'|data-chart=\"[^\"]*\"", "", chart.heading)
    newest = re.search(r"<b>(.*?)</b>", heading)[1]
    words = {0: f"{size}.0", 1: "ambiguous", 2: "blind"}
    assert words[said[-1]] in newest and "000" not in newest
    told = json.loads(html.unescape(re.search(r'data-chart="([^"]*)"', chart.heading)[1]))
    measured = told["measured"]["least squares"]
    assert measured["mean"] in (None, size) and measured["n"] == said.count(0)
    assert told["unsure"] == ({"least squares": words[max(said)]} if any(said) else {})
    if 0 in said and len({*y[sight == 0]}) == 1:
        assert rms_text(y, sight).startswith(f"{size}.00")
    else:
        assert rms_text(y, sight) in ("blind", "ambiguous")


def test_a_filter_that_runs_away_blindly_does_not_flatten_the_others():
    t = np.arange(100.0)
    good = Curve("products filter", "#0072B2", t, np.sin(t))
    sight = np.where(t > 50, 2, 0)
    away = Curve("least squares", "#D55E00", t, np.where(t > 50, 1e4, np.sin(t)), sight=sight)
    data = drawn(Name("rate", "°/s"), [good, away], 0.0, 99.0, True).data
    assert max(float(one.max()) for one in data[1:3]) < 12.0


@given(st.integers(5, 40), st.integers(7, 40))
def test_a_curve_that_ends_has_no_newest_value_and_its_pauses_are_told(begin, long):
    """Innovations of an axis that is left out, for one: the others go on."""
    t = np.arange(100) * 0.1
    other = Curve("others", "#0072B2", t, np.sin(t))
    gone = np.where((np.arange(100) >= begin) & (np.arange(100) < begin + long), np.nan, 1.0)
    chart = drawn(
        Name("innovation", ""), [other, Curve("left out", "#D55E00", t, gone)], 0, 9.9, True
    )
    told = json.loads(html.unescape(re.search(r'data-chart="([^"]*)"', chart.heading)[1]))
    ((first, last),) = told["holes"]["left out"]
    assert first == round(t[begin - 1], 3) and last == round(t[begin + long], 3)
    ended = drawn(
        Name("innovation", ""),
        [Curve("left out", "#D55E00", t[: begin + long], gone[: begin + long])],
        0,
        9.9,
        True,
    )
    assert "<b>–</b>" in ended.heading
