"""Satellites as receivers tell them: series of GSV by talker and signal, GSA, NAV-SAT, and what is
refused of them.
"""

import datetime
import math
import random
import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.receivers import at, frame, gga, rmc, sentence

from gateway.gnss import sky_read
from gateway.gnss.decoder import GnssDecoder
from gateway.gnss.sky import Sky
from gateway.samples import convert
from gateway.virtual.satellites import of_sky
from messages.contract import gyrofree_pb2 as pb
from messages.contract.checks import check

PLACE = (37.759, 45.978, 1468.0)


def skies(*parts: str | bytes) -> tuple[GnssDecoder, list[Sky]]:
    """Each message on its own, and every sky that it makes whole."""
    decoder, found = GnssDecoder(), []
    for part in parts:
        decoder.feed(part if isinstance(part, bytes) else sentence(part))
        if decoder.sky is not None:
            found.append(decoder.sky)
            decoder.sky = None
    return decoder, found


def pieces(data: bytes, size: int) -> list[bytes]:
    return [data[k : k + size] for k in range(0, len(data), size)]


def by_name(sky: Sky) -> dict[str, pb.Sky.Satellite]:
    message = convert.sky(sky)
    assert not check(message)
    return {one.name: one for one in message.satellites}


ROUND = (
    "GNGSA,A,3,07,19,,,,,,,,,,,1.6,0.9,1.3,1",
    "GNGSA,A,3,11,,,,,,,,,,,,1.6,0.9,1.3,3",
    "GPGSV,2,1,05,07,61,123,45,19,05,009,,33,22,200,31,02,11,045,20,1",
    "GPGSV,2,2,05,30,,,18,1",
    "GPGSV,1,1,02,07,61,123,39,19,05,009,28,6",
    "GAGSV,1,1,01,11,77,359,44,7",
)


def test_a_round_is_told_by_talker_and_signal_with_what_is_used():
    decoder, found = skies(*ROUND, *ROUND)
    # the first round ends when the next begins, the second with the last of its series
    assert len(found) == 2 and not decoder.refused
    assert found[0].satellites == found[1].satellites
    sky = by_name(found[1])
    assert set(sky) == {"G02", "G07", "G19", "G30", "S120", "E11"}
    assert (sky["G07"].cn0_dbhz, sky["G07"].signals, sky["G07"].use) == (45.0, 2, pb.Sky.USE_YES)
    assert sky["G19"].cn0_dbhz == 28.0 and sky["G19"].signals == 1
    assert math.isnan(sky["G30"].elevation_deg) and sky["G30"].use == pb.Sky.USE_NO
    assert sky["E11"].constellation == pb.Sky.CONSTELLATION_GALILEO
    assert sky["E11"].use == pb.Sky.USE_YES and sky["E11"].azimuth_deg == 359.0


def test_a_full_gsa_leaves_open_who_else_is_used_and_none_leaves_all_open():
    full = "GPGSA,A,3,01,02,03,04,05,06,07,08,09,10,11,12,1.6,0.9,1.3"
    view = "GPGSV,1,1,02,01,10,010,40,14,20,020,41"
    assert [s.used for s in skies(full, view, view)[1][0].satellites] == [True, None]
    assert [s.used for s in skies(view, view)[1][0].satellites] == [None, None]


def test_a_series_with_a_part_missing_is_none_and_is_counted():
    first, second = ROUND[2], ROUND[3]
    damaged = sentence(first).replace(b"61", b"62")
    decoder, found = skies(first, second, damaged, second, first, second)
    assert decoder.refused == {"GSV sequence": 1} and decoder.stream.bad == 1
    assert all(len(sky.satellites) == 5 for sky in found)
    # whoever begins to listen in the middle of one has lost nothing
    assert not skies(second, first, second)[0].refused


@pytest.mark.parametrize(
    "body, why",
    [
        ("GPGSV,1,1,01,07,91,123,45", "GSV elevation"),
        ("GPGSV,1,1,01,07,61,361,45", "GSV azimuth"),
        ("GPGSV,1,1,01,07,61,123,145", "GSV C/N0"),
        ("GPGSV,1,1,01,x7,61,123,45", "GSV satellite"),
        ("GPGSV,1,1,01,07,61", "GSV length"),
        ("GPGSV,1,2,01,07,61,123,45", "GSV part"),
        ("GPGSV,99,1,01,07,61,123,45", "GSV parts"),
        ("GPGSV,1,1,01,07,61,123,45,Z", "GSV signal"),
        ("GPGSA,A,3,1e3,,,,,,,,,,,,1.6,0.9,1.3", "GSA satellite"),
    ],
)
def test_what_cannot_be_is_refused_by_name(body, why):
    decoder, found = skies(body, body)
    assert set(decoder.refused) == {why} and not found


def test_a_satellite_that_is_heard_before_it_is_known_has_no_number():
    bodies = "GLGSV,1,1,02,,,,27,,,,31,1", "GPGSV,1,1,02,06,,,25,,,,,1"
    decoder, found = skies(*bodies, *bodies)
    sky = by_name(found[0])
    assert set(sky) == {"R00", "G06"} and sky["R00"].cn0_dbhz == 31.0 and not decoder.refused


def nav_sat(*blocks: tuple, count: int | None = None, version: int = 1) -> bytes:
    head = struct.pack("<IBBxx", 1000, version, len(blocks) if count is None else count)
    return frame(1, 0x35, head + b"".join(struct.pack("<BBBbhhI", *block) for block in blocks))


def test_nav_sat_tells_all_at_once_and_outweighs_gsv():
    seen = nav_sat(
        (0, 7, 45, 61, 123, 0, 8),
        (6, 255, 0, -91, 0, 0, 0),
        (2, 11, 0, 3, 359, 0, 0),
        (9, 1, 20, 5, 6, 0, 0),
    )
    decoder, found = skies(*ROUND, seen, *ROUND)
    assert [sky.talker for sky in found] == ["UBX"] and not decoder.refused
    sky = by_name(found[0])
    assert sky["G07"].use == pb.Sky.USE_YES and sky["G07"].cn0_dbhz == 45.0
    assert math.isnan(sky["R255"].elevation_deg) and math.isnan(sky["E11"].cn0_dbhz)
    assert sky["X01"].constellation == pb.Sky.CONSTELLATION_UNKNOWN
    for wrong, why in [
        (nav_sat((0, 7, 45, 61, 400, 0, 8)), "azimuth"),
        (nav_sat((0, 7, 200, 61, 4, 0, 8)), "C/N0"),
        (nav_sat((0, 7, 45, 61, 4, 0, 8), count=2), "length"),
        (nav_sat(version=0), "version"),
        (frame(1, 0x35, b"\0" * 5), "length"),
    ]:
        decoder, found = skies(wrong)
        assert decoder.refused == {f"NAV-SAT {why}": 1} and not found


def test_an_old_receiver_s_channels_become_satellites():
    blocks = [
        (0, 7, 1, 0, 45, 61, 123, 0),
        (1, 66, 0, 0, 30, 10, 20, 0),
        (2, 7, 0, 0, 20, 61, 123, 0),
    ]
    data = struct.pack("<IBBxx", 1000, len(blocks), 0)
    data += b"".join(struct.pack("<BBBBBbhi", *block) for block in blocks)
    sky = by_name(skies(frame(1, 0x30, data))[1][0])
    assert set(sky) == {"G07", "R02"} and sky["G07"].use == pb.Sky.USE_YES
    assert sky["G07"].cn0_dbhz == 45.0


def test_the_fix_is_the_same_with_and_without_satellites():
    epochs = [(gga(at(k)), rmc(at(k))) for k in range(6)]
    bare, full = GnssDecoder(), GnssDecoder()
    plain = [f for e in epochs for f in bare.feed(b"".join(map(sentence, e)))]
    views = [sentence(v) for v in ROUND if "GSA" not in v] + [nav_sat((0, 7, 45, 61, 123, 0, 8))]
    told = [
        f for e in epochs for f in full.feed(b"".join([*map(sentence, e), *views]))
    ]  # between the epochs, where receivers put them
    assert [(f.latitude_deg, f.fix_utc_ns) for f in plain] == [
        (f.latitude_deg, f.fix_utc_ns) for f in told
    ]
    assert len(plain) >= 5


def test_the_simulated_receiver_s_sky_is_read_and_turns():
    utc = datetime.datetime(2026, 5, 1, 12, tzinfo=datetime.UTC)
    hours = [utc + datetime.timedelta(minutes=30 * k) for k in range(48)]
    decoder, found = skies(*(of_sky(t, PLACE) for t in hours))
    assert not decoder.refused and decoder.stream.bad == 0 and len(found) == 47
    for sky in found:
        seen = by_name(sky)
        assert 10 <= len(seen) <= 30
        assert all(
            (one.use == pb.Sky.USE_YES) == (one.elevation_deg >= 10) for one in seen.values()
        )
    azimuths = {one.name: one.azimuth_deg for one in convert.sky(found[0]).satellites}
    later = {one.name: one.azimuth_deg for one in convert.sky(found[1]).satellites}
    assert any(abs(azimuths[n] - later[n]) > 5 for n in azimuths.keys() & later.keys())


SENTENCES = st.builds(
    lambda talker, name, fields: sentence(",".join([talker + name, *fields])),
    st.sampled_from(["GP", "GL", "GA", "GB", "GN", "GQ", "XX"]),
    st.sampled_from(["GSV", "GSA"]),
    st.lists(
        st.one_of(
            st.integers(-5, 400).map(str), st.sampled_from(["", "1", "2", "A", "nan", "1e9", "²"])
        ),
        max_size=22,
    ),
)
BINARY = st.builds(frame, st.just(1), st.sampled_from([0x35, 0x30]), st.binary(max_size=80))


@settings(max_examples=300, deadline=None)
@given(
    st.lists(st.one_of(SENTENCES, BINARY, st.sampled_from([*map(sentence, ROUND)])), max_size=40)
)
def test_whatever_comes_is_a_sky_that_the_contract_allows_or_is_counted(parts):
    decoder, found = skies(*parts)
    for sky in found:
        message = convert.sky(sky)
        names = [one.name for one in message.satellites]
        assert not check(message) and len(set(names)) == len(names)
    known = {"GSV", "GSA", "NAV-SAT", "NAV-SVINFO"}
    assert {text.split()[0] for text in decoder.refused} <= known
    again = GnssDecoder()
    for piece in pieces(b"".join(parts), 7):
        again.feed(piece)
    assert again.refused == decoder.refused


def test_changed_bytes_never_raise():
    rng = random.Random(5)
    whole = b"".join(map(sentence, ROUND)) + nav_sat((0, 7, 45, 61, 123, 0, 8))
    decoder = GnssDecoder()
    for _ in range(500):
        changed = bytearray(whole)
        for _ in range(rng.randint(1, 4)):
            changed[rng.randrange(len(changed))] = rng.randrange(256)
        decoder.feed(bytes(changed))
    assert decoder.refused.total() + decoder.stream.bad > 100


def test_skies_of_real_receivers(data_dir):
    """How many satellites the fullest sky of a capture has, and how many of them are used."""
    told = {}
    for name in ("ublox-8", "ublox-neo-m8l", "ublox-zed-f9p-nmea", "ublox-zed-f9p-rtk"):
        decoder, found = GnssDecoder(), []
        for piece in pieces((data_dir / "receivers" / "gpsd" / f"{name}.log").read_bytes(), 400):
            decoder.feed(piece)
            if decoder.sky is not None:
                found.append(decoder.sky)
                decoder.sky = None
        assert all(not check(convert.sky(sky)) for sky in found)
        assert all(s.system != sky_read.UNKNOWN for sky in found for s in sky.satellites)
        assert not any(text.startswith(("GSV", "NAV-SAT")) for text in decoder.refused)
        fullest = max(found, key=lambda sky: len(sky.satellites))
        used = sum(bool(s.used) for s in fullest.satellites)
        told[name] = (fullest.talker, len(fullest.satellites), used)
    assert told == {
        "ublox-8": ("NMEA", 25, 14),
        "ublox-neo-m8l": ("UBX", 34, 14),
        "ublox-zed-f9p-nmea": ("NMEA", 41, 20),
        "ublox-zed-f9p-rtk": ("UBX", 54, 21),
    }
