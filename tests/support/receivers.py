"""Bytes of GNSS receivers for tests: sentences, UBX frames, random and mutated ones with right
checksums.
"""

import math
import random
import struct
from datetime import UTC, datetime

from gateway.gnss.stream import nmea_checksum, ubx_checksum

GPS_EPOCH_S = 315964800
LEAP_S = 18
NAMES = ("GGA", "GNS", "RMC", "GLL", "VTG", "GST", "GSA", "ZDA", "GSV", "TXT")
UBX_IDS = ((1, 7), (1, 0x14), (1, 2), (1, 0x12), (1, 6), (1, 3), (1, 0x21), (1, 0x36), (1, 0x35))
ODD = ("", "0", "-1", "nan", "inf", "1e300", "9" * 30, "A", "V", "\xb5", "99999.9", "5959.99", " ")


def sentence(body: str, checked: bool = True, end: str = "\r\n") -> bytes:
    """An NMEA sentence around a body."""
    raw = body.encode("latin-1")
    check = f"*{nmea_checksum(raw):02X}" if checked else ""
    return b"$" + raw + check.encode() + end.encode("latin-1")


def at(second: int) -> str:
    """Time of day, 12:00 and so many seconds."""
    return f"12{second // 60:02d}{second % 60:02d}.00"


def gga(
    t,
    q="1",
    lat="4926.4200",
    ns="N",
    lon="01104.7700",
    ew="E",
    alt="310.5",
    sep="47.1",
    talker="GP",
    n="09",
):
    return f"{talker}GGA,{t},{lat},{ns},{lon},{ew},{q},{n},0.9,{alt},M,{sep},M,,"


def gns(t, mode="AANN", talker="GN"):
    return f"{talker}GNS,{t},4926.4200,N,01104.7700,E,{mode},14,0.8,310.5,47.1,,,V"


def rmc(t, st="A", spd="12.3", cog="88.1", d="140624", talker="GP", mode="A"):
    return f"{talker}RMC,{t},{st},4926.4200,N,01104.7700,E,{spd},{cog},{d},,,{mode}"


def frame(cls: int, number: int, payload: bytes) -> bytes:
    """A UBX frame."""
    body = bytes((cls, number)) + struct.pack("<H", len(payload)) + payload
    return b"\xb5b" + body + ubx_checksum(body)


def nav_pvt(
    t: float,
    tow_of: float | None = None,
    lat: float = 49.44,
    lon: float = 11.08,
    height: float = 357.6,
    msl: float = 310.5,
    valid: int = 7,
    fix: int = 3,
    flags: int = 1,
    flags3: int = 0,
    v: tuple[float, float, float] = (0.2, 6.3, 0.0),
    h_acc: int = 1500,
    v_acc: int = 2500,
    s_acc: int = 300,
    size: int = 92,
    year: int | None = None,
    month: int | None = None,
) -> bytes:
    """NAV-PVT whose UTC is t (s since 1970); tow_of: the UTC by which its time of week counts."""
    when = datetime.fromtimestamp(t, UTC)
    gps_s = (t if tow_of is None else tow_of) + LEAP_S - GPS_EPOCH_S
    north, east, down = (round(x * 1e3) for x in v)
    course = round(math.degrees(math.atan2(east, north)) % 360.0 * 1e5)
    payload = struct.pack(
        "<IHBBBBBBIiBBBBiiiiIIiiiiiIIHHIihH",
        round(gps_s * 1000) % 604_800_000,
        year or when.year,
        month or when.month,
        when.day,
        when.hour,
        when.minute,
        when.second,
        valid,
        50,
        when.microsecond * 1000,
        fix,
        flags,
        0,
        14,
        round(lon * 1e7),
        round(lat * 1e7),
        round(height * 1e3),
        round(msl * 1e3),
        h_acc,
        v_acc,
        north,
        east,
        down,
        round(math.hypot(north, east)),
        course,
        s_acc,
        500_000,
        120,
        flags3,
        *(0, 0, 0, 0),
    )
    return frame(1, 7, payload[:size])


def random_message(draw: random.Random) -> bytes:
    """Any content under a right checksum."""
    if draw.random() < 0.5:
        cls, number = draw.choice(UBX_IDS)
        usual = {7: 92, 0x14: 36, 2: 28, 0x12: 36, 6: 52, 3: 16, 0x21: 20, 0x36: 64}.get(number, 8)
        size = usual if draw.random() < 0.9 else draw.randint(0, 120)
        return frame(cls, number, draw.randbytes(size))
    alphabet = "0123456789.,-+eENSWAVMKT/ nai"
    text = "".join(draw.choice(alphabet) for _ in range(draw.randint(0, 90)))
    return sentence(f"{draw.choice(('GP', 'GN', 'BD', 'P'))}{draw.choice(NAMES)},{text}")


def mutated(draw: random.Random) -> bytes:
    """A message as receivers send it, with one to three fields or bytes of another value."""
    t = at(draw.randint(0, 3599))
    if draw.random() < 0.5:
        whole = bytearray(nav_pvt(1718366400 + draw.random() * 1e6)[6:-2])
        for _ in range(draw.randint(1, 3)):
            whole[draw.randrange(len(whole))] = draw.choice(
                (0, 0x7F, 0x80, 0xFF, draw.randrange(256))
            )
        return frame(1, 7, bytes(whole))
    fields = draw.choice((gga(t), gns(t), rmc(t), f"GPGST,{t},1,2,3,4,1,2,3")).split(",")
    for _ in range(draw.randint(1, 3)):
        fields[draw.randrange(1, len(fields))] = draw.choice(ODD)
    return sentence(",".join(fields))
