"""What the simulated receiver says of its position: one epoch as NMEA sentences."""

import datetime

import numpy as np
from pynmeagps import GET, NMEAMessage

PLACE = (
    37.759,
    45.978,
    1468.0,
)  # deg, deg, m above the ellipsoid: where the published test was made, roughly
GEOID = 17.0  # m, ellipsoid above mean sea level there, rounded
GPS_SIGMA = (0.8, 0.8, 1.6)  # m, north, east, up, white: a receiver at rest
KNOT = 1852.0 / 3600.0  # m/s
METRES_PER_DEGREE = 111_195.0  # m of latitude


def sentences(
    place_noise: np.ndarray, utc: datetime.datetime, v_n: tuple[float, float] = (0.0, 0.0)
) -> bytes:
    """GGA, GST and RMC of a receiver at PLACE plus place_noise (3,), m north, east, up; v_n north,
    east, m/s.
    """
    lat = PLACE[0] + place_noise[0] / METRES_PER_DEGREE
    lon = PLACE[1] + place_noise[1] / (METRES_PER_DEGREE * np.cos(np.radians(PLACE[0])))
    clock, day = utc.time(), utc.date()
    gga = NMEAMessage(
        "GP",
        "GGA",
        GET,
        time=clock,
        lat=lat,
        NS="N",
        lon=lon,
        EW="E",
        quality=1,
        numSV=9,
        HDOP=0.9,
        alt=round(PLACE[2] + place_noise[2] - GEOID, 2),
        altUnit="M",
        sep=GEOID,
        sepUnit="M",
    )
    north, east, up = GPS_SIGMA
    gst = NMEAMessage(
        "GP",
        "GST",
        GET,
        time=clock,
        rangeRms=1.0,
        stdMajor=east,
        stdMinor=north,
        orient=0.0,
        stdLat=north,
        stdLong=east,
        stdAlt=up,
    )
    rmc = NMEAMessage(
        "GP",
        "RMC",
        GET,
        time=clock,
        status="A",
        lat=lat,
        NS="N",
        lon=lon,
        EW="E",
        spd=round(float(np.hypot(*v_n)) / KNOT, 3),
        cog=round(float(np.degrees(np.arctan2(v_n[1], v_n[0]))) % 360.0, 2),
        date=day,
        posMode="A",
    )
    return gga.serialize() + gst.serialize() + rmc.serialize()
