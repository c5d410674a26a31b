"""What nobody knows on the pages: a dash with its reason, never a zero, and no drawing of it."""

import json
import math
from dataclasses import replace

import numpy as np

from dashboard.data.track import Track
from dashboard.scene.drawing import geometry as geo
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
