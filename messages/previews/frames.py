"""Frames of a preview: what a device said in one moment, packed, under a key of its own.

The home of a site publishes frames at several rates, and a place that watches subscribes to the one
that its link carries: the choice is the watcher's, a slow one slows nobody, and a rate that nobody
watches crosses no link. No `**` matches these keys (a chunk with @ is verbatim for Zenoh), so at
home nobody hears them by chance. A frame is a HistoryReply, compressed.
"""

import zlib
from collections.abc import Iterable
from typing import NamedTuple

from google.protobuf.message import DecodeError

from messages.contract import gyrofree_pb2 as pb
from messages.contract import topics as tp
from messages.contract.checks import Refusal
from messages.history.mending_state import wrong_item

RATES = (50, 20, 10, 5, 2, 1)  # Hz
CHUNK = "@preview"
OVERVIEW = "overview"
MOST_BYTES = 8 << 20  # of a frame or an overview, unpacked
SOURCES = (tp.GATEWAY, tp.ESTIMATES, tp.TRUTH.source)
AGAIN = (tp.POSE, tp.LOCATION)  # repeat for other viewers what RATE, NAV and GNSS say
FRAMED = tuple(t for t in tp.TOPICS if t.rate and t.source in SOURCES and t not in AGAIN)
WHOLE = tuple(t for t in tp.TOPICS if t not in FRAMED and t not in AGAIN)  # rare: sent as they are


class Frame(NamedTuple):
    """One message of a device, as it stands in a frame."""

    name: str  # topic with its estimator, "rate/least-squares"
    run: int
    sequence: int
    utc_ns: int
    payload: bytes


def frame_key(prefix: str, device: str, rate: int | str) -> str:
    """Key of the frames of a device at a rate, Hz; `*` stands for any."""
    for name in (prefix, device):
        if name != "*":
            tp.check_name(name)
    return f"{prefix}/{device}/{CHUNK}/{rate}"


def overview_key(prefix: str, device: str) -> str:
    """Key of the queryable for what was before: HistoryQuery in, a frame out."""
    return frame_key(prefix, device, OVERVIEW)


def lane_key(prefix: str, number: int | str) -> str:
    """Below which home answers on one of its lanes (sites/lanes.py); `*` stands for any."""
    return f"{tp.check_name(prefix)}/@lane/{number}"


def lane_overview_key(prefix: str, number: int | str, device: str) -> str:
    """The same questions as overview_key, on a lane; `*` stands for any device."""
    if device != "*":
        tp.check_name(device)
    return f"{lane_key(prefix, number)}/{OVERVIEW}/{device}"


def device_and_rate(key: str) -> tuple[str, int] | None:
    """What a frame's key says; None for any other key."""
    parts = key.split("/")
    if len(parts) != 4 or parts[2] != CHUNK or not parts[3].isdigit() or len(parts[3]) > 4:
        return None
    return (parts[1], int(parts[3])) if tp.NAME.fullmatch(parts[1]) else None


def packed(items: Iterable[Frame], at_ns: int) -> bytes:
    """A frame; at_ns: when it is published, UTC."""
    reply = pb.HistoryReply()
    for one in items:
        reply.items.add(
            topic=one.name,
            run=one.run,
            sequence=one.sequence,
            utc_ns=one.utc_ns,
            published_ns=at_ns,
            payload=one.payload,
        )
    return zlib.compress(reply.SerializeToString(), 6)


def unpacked(data: bytes, device: str) -> tuple[list[pb.HistoryItem], Refusal | None]:
    """The messages of a frame that the contract allows, and what is wrong with the first other."""
    try:
        reader = zlib.decompressobj()
        plain = reader.decompress(data, MOST_BYTES)
        if not reader.eof:
            return [], Refusal("bytes", "frame", f"{len(data)} bytes", "a whole one")
        reply = pb.HistoryReply.FromString(plain)
    except (zlib.error, DecodeError):
        return [], Refusal("bytes", "frame", f"{len(data)} bytes", "a packed HistoryReply")
    good, wrong = [], None
    for item in reply.items:
        refusal = wrong_item(device, item)
        if refusal is None:
            good.append(item)
        wrong = wrong or refusal
    return good, wrong
