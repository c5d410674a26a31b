"""The door for what a receiver says: each field of a message becomes a number within its range, or
None where it is empty, or the whole message is refused by name.

A right checksum says that the line is good, not that the value is: longitudes without digits, hours
of 77 and heights of 1e300 come with right checksums too.
"""

import calendar
import math
import re
from collections.abc import Sequence
from datetime import date

MOST_FIELD = 20  # characters of a field of numbers; receivers give up to 14
HEIGHTS_M = (-12e3, 100e3)  # from the deepest sea to where no receiver may work
MOST_SPEED_MPS = 2000.0  # receivers that may be sold stop at 515 m/s
MOST_SATELLITES = 200.0
DAY_S = 86400
NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)", re.ASCII)
TIME_OF_DAY = re.compile(r"(\d{2})(\d{2})(\d{2})(?:\.(\d*))?", re.ASCII)
DATE = re.compile(r"(\d{4}|\d{2}) (\d{1,2}) (\d{1,2})", re.ASCII)


class Refused(ValueError):
    """A message with a field that cannot be: `text` names both."""

    def __init__(self, message: str, field: str) -> None:
        super().__init__(f"{message}: {field}")
        self.text = f"{message} {field}"


class Fields:
    """The fields of one NMEA sentence by their place; the sentence's own name is field 0."""

    def __init__(self, name: str, fields: list[str]) -> None:
        self._name, self._fields = name, fields

    def text(self, place: int) -> str:
        """The field, "" where the sentence is shorter."""
        return self._fields[place].strip() if place < len(self._fields) else ""

    def number(self, place: int, what: str, low: float, high: float) -> float | None:
        """The field within low..high; None where it is empty. Raises Refused."""
        text = self.text(place)
        if not text:
            return None
        if len(text) > MOST_FIELD or not NUMBER.fullmatch(text):
            raise Refused(self._name, what)
        value = float(text)
        if not low <= value <= high:
            raise Refused(self._name, what)
        return value

    def letter(self, place: int, what: str, known: str) -> str:
        """One of the known letters, or "" where it is empty. Raises Refused."""
        text = self.text(place)
        if text and (len(text) != 1 or text not in known):
            raise Refused(self._name, what)
        return text

    def place(self, at: int) -> tuple[float, float] | None:
        """Latitude and longitude in degrees from four fields: ddmm.m, N or S, dddmm.m, E or W. None
        where all are empty. Raises Refused, also where only some are.
        """
        latitude = self._angle(at, "latitude", 90.0, "NS")
        longitude = self._angle(at + 2, "longitude", 180.0, "EW")
        if latitude is None and longitude is None:
            return None
        if latitude is None or longitude is None:
            raise Refused(self._name, "longitude" if longitude is None else "latitude")
        return latitude, longitude

    def _angle(self, at: int, what: str, most: float, sides: str) -> float | None:
        value = self.number(at, what, 0.0, most * 100.0)
        side = self.letter(at + 1, what, sides)
        if value is None:
            return None
        degrees, minutes = divmod(value, 100.0)
        if minutes >= 60.0 or degrees + minutes / 60.0 > most or not side:
            raise Refused(self._name, what)
        angle = round(degrees + minutes / 60.0, 10)
        return -angle if side == sides[1] else angle

    def time_of_day(self, at: int) -> int | None:
        """ns since midnight; None where it is empty. Raises Refused."""
        text = self.text(at)
        try:
            return tod_of(text) if text else None
        except ValueError:
            raise Refused(self._name, "time of day") from None

    def day(self, year: str, month: str, day: str) -> date | None:
        """The date of three texts; None where all are empty. Two digits of a year are of 1980 to
        2079, as GPS began in 1980. Raises Refused.
        """
        if not (year or month or day):
            return None
        found = DATE.fullmatch(f"{year} {month} {day}")
        if found is None:
            raise Refused(self._name, "date")
        number = int(found[1])
        if len(year) == 2:
            number += 1900 if number >= 80 else 2000
        return day_of(self._name, number, int(found[2]), int(found[3]))


def tod_of(text: str) -> int:
    """hhmmss.sss to ns since midnight; a leap second (60) counts on. Raises ValueError for anything
    else.
    """
    found = TIME_OF_DAY.fullmatch(text) if text.isascii() and len(text) <= MOST_FIELD else None
    if found is None:
        raise ValueError(f"time of day {text!r}: want hhmmss.sss")
    hours, minutes, seconds = (int(part) for part in found.groups()[:3])
    if hours > 23 or minutes > 59 or seconds > 60:
        raise ValueError(f"time of day {text!r}: want hhmmss.sss within a day")
    part = found.group(4) or ""
    return (hours * 3600 + minutes * 60 + seconds) * 10**9 + int((part + "000000000")[:9])


def day_of(message: str, year: int, month: int, day: int) -> date | None:
    """A day that exists; None before 1980, when no receiver could know one. Raises Refused."""
    try:
        found = date(year, month, day)
    except ValueError:
        raise Refused(message, "date") from None
    return found if year >= 1980 else None


def utc_ns_of(day: date | None, tod_ns: int | None) -> int:
    """ns since 1970; 0 where one of the two is unknown."""
    if day is None or tod_ns is None:
        return 0
    return calendar.timegm(day.timetuple()) * 10**9 + tod_ns


def within(message: str, what: str, value: float, low: float, high: float) -> float:
    """The value, which must lie in low..high. Raises Refused."""
    if not low <= value <= high:  # not a number fails too
        raise Refused(message, what)
    return value


def height_or_none(value: float) -> float | None:
    """A height that a receiver can have; others stand for one that it does not know."""
    return value if HEIGHTS_M[0] <= value <= HEIGHTS_M[1] else None


def said_sigma(values: Sequence[float | None]) -> tuple[float, float, float] | None:
    """1-sigma north, east and vertical (NaN: not said); None where the receiver does not say. No
    receiver is exact: a 0 stands for what it has not worked out.
    """
    north, east, vertical = values
    return (north, east, vertical or math.nan) if north and east else None
