"""What an estimator is called and in which colour it is drawn, everywhere: live, on the pages of
sessions, over one another, in reports and on pictures; and how units are spelt.

Colours keep a contrast of 3 to 1 on white and on the dark ground, so that one serves both.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from zlib import crc32

from messages.text import plain

BLUE, VERMILLION, PURPLE, OCHRE = "#3296D8", "#D55E00", "#C564A0", "#B08000"
VIOLET, TEAL, BROWN, OLIVE = "#8F7BE8", "#1E9C9C", "#A9745B", "#7E9430"
REFERENCE = "#009E73"  # the tachometer, and whatever else estimates are held against
FIX = "#E69F00"  # of a receiver

RATE_UNIT = "°/s"
ANGLE_UNIT = "°"


@dataclass(frozen=True)
class Look:
    """Name for people, and '#rrggbb'."""

    title: str
    colour: str


LOOKS = {
    # angular rate of a cube
    "products-ekf": Look("products filter", BLUE),
    "least-squares": Look("least squares", VERMILLION),
    "products-free": Look("products, free body", TEAL),
    "products-ukf": Look("products, unscented", PURPLE),
    "products-rls": Look("products, recursive", OCHRE),
    "products-mhe": Look("products, moving horizon", VIOLET),
    # navigation
    "ekf": Look("INS/GNSS filter", BLUE),
    "huber-nhc": Look("robust + wheels", BLUE),
    "kf": Look("Kalman filter", VERMILLION),
    "kf-nhc": Look("Kalman + wheels", OCHRE),
    "huber": Look("robust", TEAL),
    "mhe-robust": Look("robust horizon", VIOLET),
    "fpe-fuzzy": Look("predictive, fuzzy", PURPLE),
    "kf-fading": Look("Kalman, fading", BROWN),
    "kf-scale": Look("Kalman + scale", OLIVE),
    # attitude
    "vqf": Look("VQF", BLUE),
    "tilt-vector": Look("fixed weight, vector form", VERMILLION),
    "tilt-published": Look("fixed weight, published", PURPLE),
}
GYRO_FREE = "gyro-free-"  # before the name of a filter that runs on a cube's own rate
OTHERS = {"tacho": "tachometer", "truth": "truth", "gyro": "gyroscope", "gnss": "GNSS"}
_FURTHER = (OLIVE, BROWN, VIOLET, OCHRE, TEAL, PURPLE, VERMILLION, BLUE)


def estimator_title(name: str) -> str:
    """The estimator's name for people; one that is not known as it is called on the bus."""
    if name.startswith(GYRO_FREE):
        return f"gyro-free, {estimator_title(name.removeprefix(GYRO_FREE))}"
    look = LOOKS.get(name)
    return look.title if look else plain(name, 40)


def line_title(name: str) -> str:
    """Likewise of any source of a curve: an estimator, the tachometer, truth."""
    return OTHERS.get(name) or estimator_title(name)


def estimator_colour(name: str, among: Iterable[str] = ()) -> str:
    """The colour of an estimator: from the table, else by its name alone; only where two such of
    `among` would get the same one, the later in the alphabet takes the next.
    """
    look = LOOKS.get(name.removeprefix(GYRO_FREE))
    if look:
        return look.colour
    taken: set[int] = set()
    place = 0
    for other in sorted({one for one in among if one not in LOOKS} | {name}):
        place = crc32(other.encode()) % len(_FURTHER)
        while place in taken and len(taken) < len(_FURTHER):
            place = (place + 1) % len(_FURTHER)
        taken.add(place)
        if other == name:
            break
    return _FURTHER[place]


def line_colour(name: str, among: Iterable[str] = ()) -> str:
    """Of any source of a curve; truth is grey on paper, where it cannot be brighter than all."""
    if name in ("tacho", "tachometer"):
        return REFERENCE
    if name == "gnss":
        return FIX
    return "#808080" if name in ("truth", "gyro") else estimator_colour(name, among)


def slug(name: str) -> str:
    """A name as a part of a channel's, which stands in an expression."""
    return "".join(letter if letter.isalnum() else "_" for letter in name.lower())


def axis_channel(k: int) -> str:
    """The k-th axis of an array by its triad and direction: a1_x is a11."""
    return f"a{k // 3 + 1}_{'xyz'[k % 3]}"
