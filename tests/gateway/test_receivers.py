"""Receivers as they come: other sentences, other line ends, what they do not say, steps of their
time, values that cannot be, protocols nobody reads.
"""

import math
import random
import struct
import tracemalloc
from datetime import UTC, datetime

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.receivers import at, frame, gga, gns, mutated, nav_pvt, random_message, rmc, sentence

from gateway.gnss.decoder import GnssDecoder
from gateway.gnss.ecef import geodetic, turned_to_ned
from gateway.gnss.fix import Fix
from gateway.gnss.heard import Heard, counts_of
from gateway.gnss.link import GnssLink
from gateway.gnss.nmea import AUTONOMOUS, DEAD_RECKONING, KNOT, NONE
from gateway.gnss.ubx import Epoch, ubx_bytes
from gateway.samples import convert
from messages.contract.checks import check

T0 = int(datetime(2024, 6, 14, 12, 0, 0, tzinfo=UTC).timestamp())


def decode(*parts: str | bytes) -> tuple[GnssDecoder, list[Fix]]:
    decoder = GnssDecoder()
    data = b"".join(p if isinstance(p, bytes) else sentence(p) for p in parts)
    return decoder, decoder.feed(data) + decoder.flush()


def one(*parts: str | bytes) -> Fix:
    decoder, fixes = decode(*parts)
    assert len(fixes) == 1 and not decoder.refused, decoder.refused
    return fixes[0]


@pytest.mark.parametrize("end", ["\r\n", "\n", "\r", " \r\n", "  \n", "\n\r", "", "\x00"])
def test_any_line_end_will_do(end):
    decoder, fixes = decode(
        *(sentence(body(at(k)), end=end) for k in range(5) for body in (gga, rmc))
    )
    assert len(fixes) == 5 and decoder.stream.bad == 0
    assert all(fix.height_m == pytest.approx(357.6) and fix.fix_utc_ns for fix in fixes)


@pytest.mark.parametrize("talker", ["GP", "GN", "GL", "GA", "GB", "BD", "GQ", "QZ", "GI", "IN"])
def test_every_talker_is_read(talker):
    fix = one(gga(at(1), talker=talker), rmc(at(1), talker=talker))
    assert fix.quality == AUTONOMOUS and fix.talker == talker and fix.v_n is not None


def test_sentences_are_of_one_epoch_by_the_value_of_their_time():
    fix = one(gga("123519"), rmc("123519.00"), "GPGST,123519.000,,,,,1.5,2.5,4.5")
    assert fix.v_n is not None and fix.sigma_ned_m == (1.5, 2.5, 4.5)
    assert len(decode(gga("123519"), rmc("123519.20"))[1]) == 2


def test_gns_and_rmc_and_gll_stand_alone():
    assert one(gns(at(1))).height_m == pytest.approx(357.6)
    alone = one(rmc(at(1)))
    assert alone.latitude_deg == pytest.approx(49.44033333) and alone.quality == AUTONOMOUS
    assert alone.height_m is None and alone.height_msl_m is None
    assert alone.speed_mps == pytest.approx(12.3 * KNOT) and math.isnan(alone.v_n[2])
    gll = one("GPGLL,4926.4200,N,01104.7700,E,120001.00,A,A")
    assert gll.latitude_deg == alone.latitude_deg and gll.v_n is None


def test_gns_of_each_system_does_not_hide_the_position():
    empty = "GLGNS,120001.00,,,,,N,05,,,,,,"
    fix = one(gns(at(1)), empty, rmc(at(1), talker="GN"))
    assert fix.latitude_deg == pytest.approx(49.44033333) and fix.height_m is not None


def test_a_mode_without_a_fix_is_none():
    assert one(gga(at(1), q="0")).quality == NONE
    assert one(gga(at(1), q="", lat="", ns="", lon="", ew="", alt="", sep="")).latitude_deg is None
    assert one(gga(at(1), q="8"), rmc(at(1), mode="S")).latitude_deg is None
    assert one(gga(at(1), q="6")).quality == DEAD_RECKONING
    assert one(gns(at(1), mode="NNNN")).quality == NONE
    assert one(rmc(at(1), st="V")).latitude_deg is None


def test_a_fix_in_two_dimensions_has_no_height():
    fix = one("GPGSA,A,2,04,05,09,,,,,,,,,,3.0,2.0,2.0", gga(at(1)), rmc(at(1)))
    assert fix.latitude_deg is not None and fix.height_m is None and fix.height_msl_m is None
    flat = one(nav_pvt(T0, fix=2, height=0, msl=0, v_acc=0xFFFFFFFF))
    assert flat.latitude_deg is not None and flat.height_m is None and flat.height_msl_m is None
    assert flat.v_n[:2] == (0.2, 6.3) and math.isnan(flat.v_n[2])


def test_sigma_is_of_gst_else_of_the_dilution_of_precision():
    gst = "GPGST,120001.00,,,,,1.5,2.5,4.5"
    assert one(gga(at(1)), gst).sigma_ned_m == (1.5, 2.5, 4.5)
    assert one(gga(at(1))).sigma_ned_m == (1.6, 1.6, 3.2)
    poor = one("GPGSA,A,3,04,05,09,,,,,,,,,,9.0,4.0,8.0", gga(at(1)).replace(",0.9,", ",4.0,"))
    assert poor.sigma_ned_m == pytest.approx((6.4, 6.4, 25.6))
    alone = one("GPGSA,A,3,04,05,09,,,,,,,,,,9.0,4.0,8.0", rmc(at(1)))
    assert alone.sigma_ned_m[0] == pytest.approx(6.4)
    assert one(rmc(at(1))).sigma_ned_m is None


def test_sea_level_without_a_geoid_is_no_height_above_the_ellipsoid():
    fix = one(gga(at(1), sep=""))
    assert fix.height_msl_m == 310.5 and fix.height_m is None


def test_without_a_speed_there_is_no_velocity():
    assert one(gga(at(1))).v_n is None
    assert one(gga(at(1)), rmc(at(1), spd="", cog="")).v_n is None
    assert one(gga(at(1)), rmc(at(1), spd="12.3", cog="")).v_n is None  # no direction
    still = one(gga(at(1)), rmc(at(1), spd="0.02", cog=""))
    assert still.v_n[:2] == (0.0, 0.0) and still.v_sigma_ned[:2] == (0.5, 0.5)
    by_vtg = one(gga(at(1)), "GPVTG,90.0,T,,M,010.0,N,018.5,K,A")
    assert by_vtg.v_n[1] == pytest.approx(10.0 * KNOT)
    assert one(gga(at(1)), "GPVTG,,T,,M,,N,,K,N").v_n is None


def test_what_ubx_says_to_be_nothing_is_nothing():
    assert one(nav_pvt(T0, flags3=1, lat=0.0, lon=0.0)).latitude_deg is None
    assert one(nav_pvt(T0, flags=0)).quality == NONE  # gnssFixOK
    assert one(nav_pvt(T0, fix=5)).latitude_deg is None  # a time alone
    assert one(nav_pvt(T0, h_acc=0xFFFFFFFF)).latitude_deg is None
    assert one(nav_pvt(T0, s_acc=0xFFFFFFFF)).v_n is None
    high = one(nav_pvt(T0, v_acc=0xFFFFFFFF))
    assert high.latitude_deg is not None and high.height_m is None
    assert one(nav_pvt(T0, valid=0)).fix_utc_ns == 0
    assert one(nav_pvt(T0, valid=3)).fix_utc_ns == 0  # its leap seconds are still guessed
    assert one(nav_pvt(T0)).height_m == pytest.approx(357.6)
    assert one(nav_pvt(T0, size=84)).height_m == pytest.approx(357.6)


TOW = 475_218_000
POSLLH = frame(1, 2, struct.pack("<IiiiiII", TOW, 110800000, 494400000, 357600, 310500, 1500, 2500))
VELNED = frame(1, 0x12, struct.pack("<IiiiIIiII", TOW, 20, 630, 0, 630, 630, 88_00000, 30, 500000))
ECEF = (4080069_61, 799075_57, 4822656_60)  # cm, of about 49.44 N, 11.08 E


def nav_sol(tow: int = TOW, fix: int = 3, flags: int = 0x0D) -> bytes:
    body = struct.pack("<IihBB", tow, 0, 2318, fix, flags) + struct.pack("<iiiI", *ECEF, 300)
    return frame(1, 6, body + struct.pack("<iiiIHBBI", 10, 620, 5, 30, 150, 0, 9, 0))


def test_old_ubx_stands_alone():
    fix = one(POSLLH)
    assert (fix.latitude_deg, fix.longitude_deg) == (49.44, 11.08) and fix.v_n is None
    assert fix.height_m == pytest.approx(357.6) and fix.fix_utc_ns == 0
    fix = one(POSLLH, VELNED, nav_sol())
    assert fix.v_n == pytest.approx((0.2, 6.3, 0.0)) and fix.height_m == pytest.approx(357.6)
    assert one(POSLLH, nav_sol(fix=0, flags=0)).latitude_deg is None
    alone = one(nav_sol())
    assert alone.latitude_deg == pytest.approx(49.44, abs=0.05) and alone.v_n is not None
    tenth = struct.pack(
        "<xxxBIiiiibbbbII", 0, TOW, 110800000, 494400000, 357600, 310500, 11, 22, 5, 5, 150, 250
    )
    fine = one(frame(1, 0x14, tenth))
    assert fine.latitude_deg == pytest.approx(49.440000022, abs=1e-12)
    assert fine.height_m == pytest.approx(357.6005)


@given(st.floats(-89.9, 89.9), st.floats(-179.9, 179.9), st.floats(-500.0, 20000.0))
def test_places_of_the_earths_frame(latitude, longitude, height):
    L, o, a, e2 = math.radians(latitude), math.radians(longitude), 6378137.0, 6.69437999014e-3
    n = a / math.sqrt(1.0 - e2 * math.sin(L) ** 2)
    x, y = ((n + height) * math.cos(L) * part for part in (math.cos(o), math.sin(o)))
    found = geodetic(x, y, (n * (1.0 - e2) + height) * math.sin(L))
    assert found == pytest.approx((L, o, height), abs=1e-4, rel=1e-9)
    up = turned_to_ned(L, o, math.cos(L) * math.cos(o), math.cos(L) * math.sin(o), math.sin(L))
    assert up == pytest.approx((0.0, 0.0, -1.0), abs=1e-12)


# --- values that cannot be


@pytest.mark.parametrize(
    ("body", "named"),
    [
        (gga(at(1), lon=""), "GGA longitude"),
        (gga(at(1), lat="9926.4200"), "GGA latitude"),
        (gga(at(1), lat="4966.4200"), "GGA latitude"),
        (gga(at(1), alt="1e300"), "GGA altitude"),
        (gga(at(1), alt="nan"), "GGA altitude"),
        (gga(at(1), sep="999"), "GGA separation"),
        (gga("773519"), "GGA time of day"),
        (gga(""), "GGA without its time"),
        (gga(at(1), q="x"), "GGA quality"),
        (gga(at(1), n="-3"), "GGA satellites"),
        (rmc(at(1), spd="inf"), "RMC speed"),
        (rmc(at(1), spd="99999999"), "RMC speed"),
        (rmc(at(1), cog="720"), "RMC course"),
        (rmc(at(1), d="320199"), "RMC date"),
        (rmc(at(1), st="Q"), "RMC status"),
        (gns(at(1), mode="?"), "GNS mode"),
        ("GPZDA,120000.00,31,02,2024,00,00", "ZDA date"),
        ("GPGST,120001.00,,,,,1e9,2,3", "GST sigma"),
    ],
)
def test_a_sentence_that_cannot_be_is_refused_by_name(body, named):
    decoder, fixes = decode(body, gga(at(2)), rmc(at(2)))
    assert dict(decoder.refused) == {named: 1} and decoder.bad == 1
    assert len([fix for fix in fixes if fix.latitude_deg is not None]) == 1


def test_a_ubx_message_that_cannot_be_is_refused_by_name():
    for bad, named in (
        (nav_pvt(T0, lat=91.0), "NAV-PVT latitude"),
        (nav_pvt(T0, month=13), "NAV-PVT date"),
        (nav_pvt(T0, v=(9e4, 0.0, 0.0)), "NAV-PVT velocity"),
        (frame(1, 7, b"\x00" * 20), "NAV-PVT length"),
        (
            frame(1, 0x36, struct.pack("<IBBB9x12f", 5, 0, 1, 1, *[math.nan] * 12)),
            "NAV-COV variance",
        ),
    ):
        decoder, _ = decode(bad)
        assert dict(decoder.refused) == {named: 1}


def test_nothing_valid_on_the_line_ends_the_decoder_or_grows_in_it():
    """Random and mutated messages with right checksums; bench_fuzz_gnss.py does 100,000."""
    draw = random.Random(5)
    link = GnssLink()
    seen = 0
    for k in range(6000):
        data = random_message(draw) if k % 2 else mutated(draw)
        for arrival in link.feed(data, 1000 * (k + 1), None, T0 * 10**9):
            message = convert.gnss_fix(arrival.fix)
            message.device_time_s = max(0.0, arrival.device_time_s)
            assert check(message) == [] and math.isfinite(arrival.device_time_s)
            assert not message.quality or check(convert.location_fix(message, "cube")) == []
            seen += 1
        if k == 2000:
            tracemalloc.start()
            before = tracemalloc.take_snapshot()
    grown = sum(s.size_diff for s in tracemalloc.take_snapshot().compare_to(before, "filename"))
    tracemalloc.stop()
    assert seen > 100 and link.decoder.unreadable > 500
    assert grown < 300_000


@settings(max_examples=60)
@given(st.lists(st.sampled_from("0123456789.,-+eENSWAV*nai/ "), max_size=80).map("".join))
def test_any_text_in_a_sentence_is_taken_or_refused(text):
    for name in ("GGA", "GNS", "RMC", "GLL", "VTG", "GST", "GSA", "ZDA"):
        decode(sentence(f"GP{name},{text.replace('*', '')}"))


# --- time


def times(link: GnssLink, messages: list[tuple[float, bytes]]) -> list[tuple[float, float]]:
    """(arrival, device time), s, of fixes whose bytes came at these seconds of the board."""
    return [
        (arrival.device_us / 1e6, arrival.device_time_s)
        for t, data in messages
        for arrival in link.feed(data, round(t * 1e6), None, T0 * 10**9)
    ]


def test_a_leap_second_correction_moves_no_device_time_of_ubx():
    """UTC steps by two seconds when the receiver learns of them; the week of GPS goes on."""
    link = GnssLink()
    stream = [
        (10.0 + 0.2 * k + 0.05, nav_pvt(T0 + 0.2 * k + (2 if k < 50 else 0), tow_of=T0 + 0.2 * k))
        for k in range(200)
    ]
    for arrival, device in times(link, stream)[2:]:
        assert device == pytest.approx(arrival, abs=0.06)
    assert link.clock.steps == 0


@pytest.mark.parametrize("step", [-2, 1, 7 * 86400, -1024 * 7 * 86400 + 3 * 86400])
def test_a_step_of_utc_is_told_and_gives_no_wrong_time(step):
    """NMEA has UTC alone: after a step there is no device time until it is sure."""
    link = GnssLink()
    stream = []
    for k in range(60):
        t = datetime.fromtimestamp(T0 + k + (step if k >= 20 else 0), UTC)
        stream.append(
            (10.0 + k + 0.1, sentence(rmc(t.strftime("%H%M%S.00"), d=t.strftime("%d%m%y"))))
        )
    found = times(link, stream)
    assert all(device == 0.0 or abs(device - arrival) < 0.2 for arrival, device in found)
    assert sum(device == 0.0 for _, device in found) <= 4
    assert link.clock.steps == 1 and link.clock.last_step_s == pytest.approx(step, abs=0.1)


def test_a_late_read_is_no_step():
    """The port stalls for 2 s; then all comes at once."""
    link = GnssLink()
    stream = [
        (12.0 if 10.0 <= 0.2 * k < 12.0 else 0.2 * k + 0.05, nav_pvt(T0 + 0.2 * k))
        for k in range(5, 200)
    ]
    found = times(link, stream)
    assert link.clock.steps == 0
    assert all(
        device == 0.0 or abs(device - 0.2 * k) < 0.3 for k, (_, device) in enumerate(found, 5)
    )


def test_an_epoch_that_is_left_out_lends_nobody_its_arrival():
    """A receiver that speaks both: where NMEA leads no more, UBX must not come a period early."""
    link = GnssLink()
    stream = [(1.0 + k, sentence(rmc(at(k)))) for k in range(4)]
    stream += [(4.2 + 0.2 * k, nav_pvt(T0 + 3.2 + 0.2 * k)) for k in range(20)]
    for arrival in (a for t, data in stream for a in link.feed(data, round(t * 1e6), None, 0)):
        if arrival.fix.tow_ns is not None:
            assert arrival.device_us / 1e6 == pytest.approx(
                arrival.fix.fix_utc_ns / 1e9 - T0 + 1.0, abs=1e-3
            )


def test_the_week_of_gps_begins_again():
    link = GnssLink()
    start = 1718495982 - 10  # ten seconds before Sunday 2024-06-16 00:00 of GPS
    found = times(link, [(5.0 + k, nav_pvt(start + k)) for k in range(30)])
    assert all(device == pytest.approx(arrival, abs=0.01) for arrival, device in found[1:])
    assert link.clock.steps == 0


@pytest.mark.parametrize("day", ["060180", "220899", "010179"])
def test_a_date_before_the_first_fix_is_no_date(day):
    link = GnssLink()
    data = sentence(rmc(at(1), st="V", d=day)) + sentence(rmc(at(2), st="V", d=day))
    *_, arrival = link.feed(data, 10**6, None, T0 * 10**9)
    assert arrival.fix.fix_utc_ns == 0 and arrival.device_time_s == 0.0
    assert one(nav_pvt(T0, year=1970)).fix_utc_ns == 0


def test_a_leap_second_is_a_second():
    fixes = decode(
        *(rmc(tod, d="311216") for tod in ("235959.00", "235960.00")), rmc("000000.00", d="010117")
    )[1]
    seconds = [fix.fix_utc_ns // 10**9 for fix in fixes]
    assert [b - a for a, b in zip(seconds, seconds[1:], strict=False)] == [1, 0]


# --- what is said


def said(*chunks: bytes, placed: int = 0, unplaced: int = 0, seconds: int = 8) -> str:
    decoder, heard = GnssDecoder(), Heard()
    text = ""
    for second in range(seconds):
        for chunk in chunks:
            decoder.feed(chunk)
        counts = counts_of(decoder, placed * (second + 1), unplaced * (second + 1))
        text = heard.say(100.0 + second, counts, [])
    return text


SIRF = b"\xa0\xa2\x00\x29\x02" + bytes(40) + b"\x00\x02\xb0\xb3"
TSIP = b"\x10\x8f\xab" + bytes(range(20, 40)) + b"\x10\x03"


def test_what_is_heard_is_said():
    bare = sentence(gga(at(1)), checked=False) + sentence(rmc(at(1)), checked=False)
    assert "without a checksum" in said(bare) and "GGA" in said(bare)
    assert "SiRF binary" in said(SIRF) and "Trimble" in said(TSIP)
    status = frame(1, 0x35, b"\0\0\0\0\1\0\0\0") + sentence("GPGSV,1,1,00")
    text = said(status)
    assert "UBX NAV-SAT" in text and "GSV" in text and "NAV-PVT" in text
    assert "gnss_baud" in said(bytes(range(1, 33)) * 3)
    assert "GGA longitude" in said(sentence(gga(at(1), lon="")))
    assert "satellite fix" in said(sentence(gga(at(1), q="0")), unplaced=1)
    assert "damaged" in said(b"$GPGGA,1200*00\r\n")
    assert said() == ""


def test_silence_is_no_wait_for_a_position():
    """A receiver that is plugged in late gets its time."""
    decoder, heard = GnssDecoder(), Heard()
    for second in range(12):
        assert heard.say(100.0 + second, counts_of(decoder, 0, 0), []) == ""
    decoder.feed(sentence(gga(at(1))))
    assert heard.say(112.0, counts_of(decoder, 0, 0), []) == ""
    decoder.feed(sentence(gga(at(2))))
    assert "no position" in heard.say(117.0, counts_of(decoder, 0, 0), [])


def test_all_is_well_is_silence_and_a_refusal_is_still_said():
    good = sentence(gga(at(1))) + sentence(rmc(at(1)))
    assert said(good, placed=1) == ""
    assert "RMC speed" in said(good + sentence(rmc(at(1), spd="inf")), placed=1)


def test_a_played_fix_keeps_what_it_does_not_know():
    whole = Epoch(T0, 1.0, 49.0, 11.0, 357.6, 5, (1.0, 1.0, 2.0), (3.0, 4.0, 0.5))
    for height, v_n in ((math.nan, None), (357.6, None), (math.nan, (3.0, 4.0, 0.5))):
        epoch = Epoch(T0, 1.0, 49.0, 11.0, height, 5, (1.0, 1.0, 2.0), v_n)
        fix = one(ubx_bytes(epoch))
        assert (fix.height_m is None) == math.isnan(height) and (fix.v_n is None) == (v_n is None)
        assert fix.height_msl_m is None
    level = one(
        ubx_bytes(Epoch(T0, 1.0, 49.0, 11.0, 1.0, 5, (1.0, 1.0, 2.0), (3.0, 4.0, math.nan)))
    )
    assert level.v_n[:2] == (3.0, 4.0) and math.isnan(level.v_n[2])
    assert one(ubx_bytes(whole)).height_m == pytest.approx(357.6)
