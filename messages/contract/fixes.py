"""GNSS fixes of older versions in their present form: what was not known was 0 there."""

import math

from messages.contract import gyrofree_pb2 as pb


def complete(message: pb.GnssFix) -> pb.GnssFix:
    """The fix itself, what is unknown in it NaN; a fix of this version stays as it is."""
    if message.height_reference != pb.HEIGHT_REFERENCE_UNSAID:
        return message
    unknown_sea = message.height_msl_m == 0.0 or (
        # a log knows no sea level: the ellipsoid's height was put in its place
        message.header.source == pb.SOURCE_PLAYED and message.height_msl_m == message.height_m
    )
    if message.talker and message.latitude_deg == 0.0 and message.longitude_deg == 0.0:
        message.latitude_deg = message.longitude_deg = math.nan
        message.quality = pb.GnssFix.QUALITY_NONE
    if unknown_sea and message.height_m == 0.0 and message.talker not in ("", "UBX"):
        message.height_m = math.nan
        message.height_reference = pb.HEIGHT_REFERENCE_UNKNOWN
    if message.hdop == 0.0:
        message.hdop = math.nan
    if unknown_sea:
        message.height_msl_m = math.nan
    return message
