"""Colours (Okabe and Ito's set, distinguishable with the common colour deficiencies) and number
formats.
"""

import math

from logs.figures.names import (
    FIX,
    GYRO_FREE,
    RATE_UNIT,
    REFERENCE,
    estimator_colour,
    estimator_title,
)
from messages.contract import gyrofree_pb2 as pb

ORANGE, SKY, GREEN, YELLOW = "#E69F00", "#56B4E9", "#009E73", "#F0E442"
BLUE, VERMILLION, PURPLE, GREY = "#0072B2", "#D55E00", "#CC79A7", "#8C8C8C"

AXES = (VERMILLION, GREEN, SKY)  # x, y, z
REJECTED = VERMILLION  # a fix the filter did not believe
__all__ = ["FIX", "GYRO_FREE", "RATE_UNIT", "REFERENCE", "estimator_colour", "estimator_title"]

SOURCES = {
    pb.SOURCE_SIMULATED: ("SIMULATED", PURPLE),
    pb.SOURCE_PLAYED: ("PLAYED", ORANGE),
    pb.SOURCE_HARDWARE: ("HARDWARE", GREEN),
    pb.SOURCE_EMULATED: ("EMULATED", YELLOW),
    pb.SOURCE_UNKNOWN: ("SOURCE UNKNOWN", GREY),
}


def rgb(colour: str) -> tuple[int, int, int]:
    """'#rrggbb' as three numbers 0..255."""
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)


def rgba(colour: str, alpha: float) -> str:
    """'#rrggbb' with an opacity, as CSS."""
    return "rgba({},{},{},{:.2f})".format(*rgb(colour), alpha)


def truth_colour(dark: bool) -> str:
    """The colour of what is really the case: the strongest contrast to the background."""
    return "#F2F2F2" if dark else "#1A1A1A"


def number(value: float | None, digits: int = 1, unit: str = "", sign: bool = False) -> str:
    """A value with its unit, a dash for what is not known."""
    if value is None or not math.isfinite(value):
        return f"– {unit}".rstrip()
    value = round(value, digits) + 0.0  # + 0.0: no minus before a zero
    text = f"{value:{'+' if sign else ''},.{digits}f}".replace(",", "\u202f").replace("-", "\u2212")
    return f"{text} {unit}".rstrip()


def age(seconds: float) -> str:
    """How old something is."""
    if seconds < 90:
        return f"{seconds:.1f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.0f} h"
