"""The satellites in view at a moment of a recording: found by the file's index, or, where that
cannot be trusted, by reading the recording up to there.
"""

from collections.abc import Iterator
from pathlib import Path

from google.protobuf.message import DecodeError
from mcap.reader import SeekingReader

from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import SKY, TopicError, parse
from sessions.recording.mcap_damage import Damage
from sessions.recording.mcap_index import keys_of, ordered_summary_of
from sessions.recording.samples import decode
from sessions.recording.timeline import straight

NEAR_S = 15.0  # a sky this far from the moment stands for it
Told = tuple[int, bytes]  # receive time, ns; payload


def sky_near(path: Path, at_s: float) -> tuple[float, pb.Sky] | None:
    """The sky that was told last before at_s (s from the first message), else the next one, and
    when; None where there is none near. Raises OSError.
    """
    start_ns, told = _told(path, at_s)
    before: tuple[float, pb.Sky] | None = None
    for log_ns, payload in told:
        t_s = (log_ns - start_ns) / 1e9
        try:
            found = decode(SKY, payload)
        except DecodeError:
            continue
        if t_s > at_s and before is not None:
            break
        before = t_s, found
        if t_s > at_s:
            break
    return before if before is not None and abs(before[0] - at_s) <= NEAR_S else None


def _told(path: Path, at_s: float) -> tuple[int, Iterator[Told]]:
    summary = ordered_summary_of(path)
    if summary is None or summary.statistics is None:
        rows = straight(path, Damage())
        first = next(rows, None)
        if first is None:
            return 0, iter(())
        return first.log_ns, ((row.log_ns, row.payload) for row in rows if _is_sky(row.key))
    start_ns = summary.statistics.message_start_time
    keys = [key for key in keys_of(summary).values() if _is_sky(key)]
    return start_ns, _indexed(path, keys, start_ns, at_s) if keys else iter(())


def _indexed(path: Path, keys: list[str], start_ns: int, at_s: float) -> Iterator[Told]:
    low, high = (start_ns + round((at_s + d) * 1e9) for d in (-NEAR_S, NEAR_S))
    with path.open("rb") as stream:
        reader = SeekingReader(stream, record_size_limit=path.stat().st_size)
        for _, _, message in reader.iter_messages(keys, max(low, 0), high):
            yield message.log_time, message.data


def _is_sky(key: str) -> bool:
    try:
        return parse(key).topic is SKY
    except TopicError:
        return False
