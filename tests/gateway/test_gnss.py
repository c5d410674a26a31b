"""Receivers' bytes to fixes, against real captures and gpsd's decodes of them."""

import json
import random
from collections import defaultdict
from datetime import UTC, datetime
from pathlib import Path

import pytest

from gateway.gnss.decoder import GnssDecoder
from gateway.gnss.fields import tod_of
from gateway.gnss.fix import DAY_NS, RTK_FIXED, WEEK_ROLLOVER_NS, unroll_weeks
from gateway.gnss.link import GnssLink
from gateway.gnss.stream import GnssStream, nmea_checksum
from gateway.gnss.ubx import Epoch, ubx_bytes
from gyrofree.running.log_items import LOG_EPOCH_S

# Field of Fix, gpsd's name, how far apart they may be: gpsd prints rounded figures
COMPARED = (
    ("latitude_deg", "lat", 1e-9),
    ("longitude_deg", "lon", 1e-9),
    ("height_msl_m", "altMSL", 1e-4),
    ("height_m", "altHAE", 1e-4),
    ("speed_mps", "speed", 6e-4),
    ("track_deg", "track", 1e-3),
)
CAPTURES = ["nmea-rtk", "ublox-8", "ublox-neo-m8l", "ublox-zed-f9p-nmea", "ublox-zed-f9p-rtk"]


def nmea(body: str) -> bytes:
    """A sentence around the body, with its checksum."""
    return f"${body}*{nmea_checksum(body.encode()):02X}\r\n".encode()


def decode(data: bytes) -> tuple[GnssDecoder, list]:
    decoder = GnssDecoder()
    return decoder, decoder.feed(data) + decoder.flush()


def capture(path: Path) -> bytes:
    """The receiver's bytes, without the comment lines at the head."""
    data = path.read_bytes()
    while data.startswith(b"#"):
        data = data.partition(b"\n")[2]
    return data


def gpsd_epochs(path: Path) -> dict[int, list[dict]]:
    """gpsd's TPV objects by time in ms; one epoch may have several, each with what was known so
    far.
    """
    found = defaultdict(list)
    for line in path.read_bytes().splitlines():
        if line.startswith(b'{"class":"TPV"'):
            tpv = json.loads(line)
            if "time" in tpv:
                found[round(datetime.fromisoformat(tpv["time"]).timestamp() * 1000)].append(tpv)
    return found


def agrees(fix, tpv: dict) -> bool:
    return all(
        name in tpv and abs(getattr(fix, field) - tpv[name]) <= within
        if getattr(fix, field) is not None
        else True
        for field, name, within in COMPARED
        if name != "track" or name in tpv  # gpsd leaves the course out at walking speed
    )


@pytest.mark.parametrize("name", CAPTURES)
def test_every_epoch_agrees_with_gpsd(data_dir, name):
    folder = data_dir / "receivers" / "gpsd"
    theirs = gpsd_epochs(folder / f"{name}.log.chk")
    decoder, fixes = decode(capture(folder / f"{name}.log"))
    compared, odd = 0, []
    for fix in fixes:
        milliseconds = {
            round(fix.fix_utc_ns / 1e6),
            fix.fix_utc_ns // 10**6,
        }  # gpsd rounds, or cuts
        candidates = [tpv for ms in milliseconds for tpv in theirs.get(ms, [])]
        if fix.latitude_deg is None or not candidates:
            continue
        compared += 1
        if not any(agrees(fix, tpv) for tpv in candidates):
            odd.append(fix)
    mine = {round(fix.fix_utc_ns / 1e6) for fix in fixes}
    assert (
        len(fixes) - compared <= 1
    )  # gpsd needs one epoch to find its feet where the log begins within one
    if (
        name == "ublox-neo-m8l"
    ):  # gpsd also reports the receiver's 10 Hz dead reckoning (HNR-PVT), once over a NAV-PVT
        assert len(odd) <= 1 and compared >= 17
    else:
        assert not odd
        assert set(theirs) <= mine
    assert decoder.unreadable == 0 and decoder.bad <= 1  # one log ends within a sentence


def test_all_captures_also_the_damaged_ones_go_through(data_dir):
    """No exception, every byte accounted for, and cutting the stream changes nothing."""
    files = sorted(
        p for d in ("ubx_nmea", "nmea", "gpsd") for p in (data_dir / "receivers" / d).iterdir()
    )
    draw = random.Random(1)
    damaged = fixes = 0
    for path in files:
        data = path.read_bytes()[:200_000]
        decoder, whole = decode(data)
        stream = decoder.stream
        assert len(data) == stream.pending + stream.skipped_bytes + sum(
            len(m.data) for m in GnssStream().feed(data)
        )
        pieces, at = GnssDecoder(), 0
        cut: list = []
        while at < len(data):
            step = draw.randint(1, 700)
            cut += pieces.feed(data[at : at + step])
            at += step
        assert cut + pieces.flush() == whole, path.name
        damaged += decoder.bad > 0 or stream.pending > 0
        fixes += len(whole)
    assert len(files) > 60 and damaged >= 11 and fixes > 500


def test_noise_between_messages_costs_none():
    draw = random.Random(2)
    message = nmea("GPGGA,120000.00,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,")
    stream = GnssStream()
    for _ in range(300):
        noise = bytes(draw.choice(b"\x00\xb5\xd3abc\xff,*1") for _ in range(draw.randint(0, 40)))
        stream.feed(noise + message)
    stream.feed(bytes(8200))  # past the longest message a false start can claim
    assert stream.good == 300


def test_ubx_epoch_round_trip_to_a_tenth_of_a_millimetre():
    epochs = [
        Epoch(
            LOG_EPOCH_S,
            10.25 * k,
            40.0966268 + 1e-9 * k,
            -105.1474483 - 3e-9 * k,
            1601.4743 + 0.0001 * k,
            1,
            (0.0099, 0.0099, 0.01),
            (10.0, -0.002 * k, -0.009),
        )
        for k in range(1, 60)
    ]
    _, fixes = decode(b"".join(ubx_bytes(e) for e in epochs))
    assert len(fixes) == len(epochs)
    for fix, epoch in zip(fixes, epochs, strict=True):
        assert fix.quality == RTK_FIXED
        assert fix.fix_utc_ns == LOG_EPOCH_S * 10**9 + round(epoch.t_s * 1e9)
        assert fix.latitude_deg == pytest.approx(epoch.latitude_deg, abs=6e-10)
        assert fix.longitude_deg == pytest.approx(epoch.longitude_deg, abs=6e-10)
        assert fix.height_m == pytest.approx(epoch.height_m, abs=6e-5)
        assert fix.v_n == pytest.approx(epoch.v_n, abs=6e-4)
        assert fix.sigma_ned_m == pytest.approx(epoch.sigma_ned_m, rel=0.02)


def test_epoch_is_out_with_its_last_sentence():
    """After the first epoch nothing waits for the next one to begin."""
    decoder = GnssDecoder()
    for second in range(3):
        tod = f"1200{second:02d}.00"
        first = decoder.feed(nmea(f"GPGGA,{tod},4807.038,N,01131.000,E,4,08,0.9,545.4,M,46.9,M,,"))
        last = decoder.feed(nmea(f"GPRMC,{tod},A,4807.038,N,01131.000,E,022.4,084.4,230324,,,A"))
        assert [len(first), len(last)] == (
            [0, 0] if second == 0 else [0, 1] if second > 1 else [1, 1]
        )
    assert last[0].height_m == pytest.approx(592.3) and last[0].speed_mps == pytest.approx(
        22.4 * 1852 / 3600
    )


def test_midnight_with_and_without_a_date_in_the_epoch():
    decoder = GnssDecoder()
    gga = "GPGGA,{},4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,"
    data = nmea("GPZDA,235958.00,31,12,2023,00,00") + nmea(gga.format("235958.00"))
    data += (
        nmea(gga.format("235959.00"))
        + nmea(gga.format("000000.00"))
        + nmea(gga.format("000001.00"))
    )
    fixes = decoder.feed(data) + decoder.flush()
    start = int(datetime(2023, 12, 31, 23, 59, 58, tzinfo=UTC).timestamp()) * 10**9
    assert [fix.fix_utc_ns - start for fix in fixes] == [k * 10**9 for k in range(4)]


def test_leap_second_and_nonsense_times():
    assert tod_of("235960.00") == DAY_NS
    for text in ("", "12", "ab0000", "1200001"):
        with pytest.raises(ValueError, match="hhmmss"):
            tod_of(text)


def test_week_rollover_is_undone_against_the_host_clock():
    now = 1_790_000_000 * 10**9
    assert unroll_weeks(now - WEEK_ROLLOVER_NS - 5 * 10**9, now) == now - 5 * 10**9
    assert unroll_weeks(now - 2 * WEEK_ROLLOVER_NS, now) == now
    for age in (0, 3600 * 10**9, 400 * DAY_NS):  # a played log is old, not rolled over
        assert unroll_weeks(now - age, now) == now - age
    assert unroll_weeks(0, now) == 0


def test_no_fix_and_bad_checksum_are_said():
    decoder, fixes = decode(
        nmea("GPGGA,120000.00,,,,,0,00,99.9,,,,,,") + b"$GPGGA,1200*00\r\n\xff\xfe$GPGG"
    )
    assert fixes[0].latitude_deg is None and fixes[0].quality == 0
    assert decoder.bad == 1 and decoder.stream.pending == 5


def test_time_of_fix_stays_apart_from_its_arrival():
    """Epochs that arrive 40 to 90 ms late: the device time of the fix has only the shortest delay
    in it.
    """
    draw = random.Random(3)
    link = GnssLink(latency_s=0.04)
    worst = 0.0
    for k in range(1, 200):
        delay_s = 0.04 if k % 7 == 1 else draw.uniform(0.04, 0.09)
        epoch = Epoch(LOG_EPOCH_S, 0.25 * k, 40.0, -105.0, 1600.0, 1, (0.01,) * 3, (0.0,) * 3)
        for arrival in link.feed(ubx_bytes(epoch), round((0.25 * k + delay_s) * 1e6), None, 0):
            if k > 2:  # the first epoch comes out with the second
                assert arrival.device_us == round((0.25 * k + delay_s) * 1e6)
            if k > 20:
                worst = max(worst, abs(arrival.device_time_s - 0.25 * k))
    assert worst < 0.002


def test_a_receiver_that_speaks_both_is_heard_once():
    """NAV-PVT once a second beside NMEA at 5 Hz: the faster one counts; at equal rates UBX does."""
    rmc = "GPRMC,0000{:05.2f},A,4000.000,N,10500.000,W,000.0,000.0,010124,,,A"
    for rate, talker, least in ((5, "GP", 40), (1, "UBX", 9)):
        data = b""
        for second in range(1, 11):
            data += ubx_bytes(
                Epoch(LOG_EPOCH_S, float(second), 40.0, -105.0, 0.0, 1, (0.01,) * 3, (0.0,) * 3)
            )
            data += b"".join(nmea(rmc.format(second + k / rate)) for k in range(rate))
        _, fixes = decode(data)
        main = [fix for fix in fixes if fix.talker == talker]
        assert len(main) >= least and len(fixes) - len(main) <= 2
