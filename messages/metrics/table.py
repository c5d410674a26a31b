"""Every figure of /metrics that is made from a message, in the order the data flow.

The page docs/operations.md is made from this table. Names follow Prometheus: base units, and
`_total` for what only grows while its process lives.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any, Literal

from messages.contract import gyrofree_pb2 as pb
from messages.contract import topics as tp
from messages.contract.topics import Topic

Values = Iterable[tuple[tuple[str, ...], float]]  # of the own labels, and the figure
Kind = Literal["gauge", "counter"]


@dataclass(frozen=True)
class Figure:
    """One family of figures."""

    name: str
    kind: Kind
    text: str
    topic: Topic
    values: Callable[[Any], Values]
    labels: tuple[str, ...] = ()  # beside those of its topic


def labels_of(topic: Topic) -> tuple[str, ...]:
    """Labels that every figure of a topic has."""
    if topic is tp.STATUS:
        return ()
    return ("device", "estimator") if topic.per_estimator else ("device",)


def _one(field: str, factor: float = 1.0) -> Callable[[Any], Values]:
    return lambda message: [((), factor * getattr(message, field))]


def _each(field: str) -> Callable[[Any], Values]:
    """Of a map from names to counts."""
    return lambda message: [((name,), count) for name, count in getattr(message, field).items()]


def _lag(newest: str, durable: str, journal: str) -> Callable[[Any], Values]:
    def values(m: Any) -> Values:
        yield (journal,), max(0, getattr(m, newest) - getattr(m, durable))

    return values


def _latency(m: pb.LinkStatus) -> Values:
    return [(("0.5",), m.latency_p50_s), (("0.99",), m.latency_p99_s)]


def _undurable(m: pb.LinkStatus) -> Iterator[tuple[tuple[str, ...], float]]:
    yield from _lag("journal_sequence", "durable_sequence", "raw")(m)
    yield from _lag("published_sequence", "published_durable", "published")(m)


def _axes(m: pb.AxisHealth) -> Values:
    prefix = "STATE_"
    for axis in m.axes:
        state = pb.AxisHealth.State.Name(axis.state).removeprefix(prefix).lower()
        yield (axis.name, state), float(axis.excluded)


def _alarms(m: pb.AlarmStatus) -> Values:
    for one in m.alarms:
        level = pb.Alarm.Level.Name(one.level).removeprefix("LEVEL_").lower()
        state = pb.Alarm.State.Name(one.state).removeprefix("STATE_").lower()
        yield (one.id, level, state), float(one.active)


def _unknown_alarms(m: pb.AlarmStatus) -> Values:
    return [((), float(sum(one.unknown for one in m.alarms)))]


def _faults(m: pb.BoardInfo) -> Values:
    return [((one.name,), float(one.active)) for one in m.faults]


def _running(m: pb.ProcedureStatus) -> Values:
    running = (pb.ProcedureStatus.STATE_RUNNING, pb.ProcedureStatus.STATE_HELD)
    return [((), float(m.state in running))]


def _link(name: str, kind: Kind, text: str, values: Any, *labels: str) -> Figure:
    values = _one(values) if isinstance(values, str) else values
    return Figure(f"gyrofree_link_{name}", kind, text, tp.LINK, values, labels)


def _estimator(name: str, kind: Kind, text: str, values: Any, *labels: str) -> Figure:
    values = _one(values) if isinstance(values, str) else values
    return Figure(f"gyrofree_estimator_{name}", kind, text, tp.ESTIMATOR, values, labels)


def _recorder(name: str, kind: Kind, text: str, values: Any, *labels: str) -> Figure:
    values = _one(values) if isinstance(values, str) else values
    return Figure(f"gyrofree_recorder_{name}", kind, text, tp.STATUS, values, labels)


FIGURES: tuple[Figure, ...] = (
    _link("connected", "gauge", "1 while the board's port is open", "connected"),
    _link("received_bytes_total", "counter", "bytes read from the port", "bytes_in"),
    _link("frames_total", "counter", "whole frames with a good CRC", "good_frames"),
    _link("damaged_chunks_total", "counter", "pieces that were no frame", "bad_chunks"),
    _link("damaged_bytes_total", "counter", "bytes of them", "bad_bytes"),
    _link(
        "damage_total",
        "counter",
        "pieces that were no frame, by what was wrong",
        _each("damage"),
        "reason",
    ),
    _link(
        "refused_frames_total",
        "counter",
        "whole frames that were not believed, by what was wrong",
        _each("refused"),
        "reason",
    ),
    _link("unknown_frames_total", "counter", "whole frames of a type not known", "unknown_frames"),
    _link("lost_frames_total", "counter", "frames missing by their sequence", "lost_frames"),
    _link(
        "device_dropped_frames_total",
        "counter",
        "of those, never sent: the board says so",
        "device_dropped",
    ),
    _link("lost_samples_total", "counter", "samples missing by their index", "lost_samples"),
    _link("reboots_total", "counter", "starts of the board", "reboots"),
    _link("reconnects_total", "counter", "times that the port was opened again", "reconnects"),
    _link("sample_rate_hertz", "gauge", "samples in the last second", "sample_rate_hz"),
    _link("frame_rate_hertz", "gauge", "frames in the last second", "frame_rate_hz"),
    _link(
        "latency_seconds",
        "gauge",
        "read of a frame's last byte to its publication",
        _latency,
        "quantile",
    ),
    _link(
        "clock_skew_ratio",
        "gauge",
        "board's clock against the host's, 1e-6 is one ppm",
        _one("clock_skew_ppm", 1e-6),
    ),
    _link(
        "clock_offset_seconds",
        "gauge",
        "by how much the host's clock was set since the run began",
        "clock_offset_s",
    ),
    _link(
        "undurable_records",
        "gauge",
        "records of a journal that are not known to be on the disk",
        _undurable,
        "journal",
    ),
    _link("stops_total", "counter", "times that the gateway itself stood still", "stops"),
    _link("stopped_seconds_total", "counter", "sum of them", "stopped_s"),
    _link("gnss_sentences_total", "counter", "good messages of the receiver", "gnss_good"),
    _link("gnss_damaged_total", "counter", "damaged messages of the receiver", "gnss_bad"),
    Figure(
        "gyrofree_board_fault",
        "gauge",
        "1 while the board has this fault, 0 for 10 s after it",
        tp.BOARD,
        _faults,
        ("fault",),
    ),
    Figure(
        "gyrofree_board_status",
        "gauge",
        "what the board counts, by the names of its STATUS",
        tp.BOARD,
        _each("status"),
        ("counter",),
    ),
    _estimator("samples_total", "counter", "samples used", "samples"),
    _estimator("gaps_total", "counter", "interruptions of the samples", "gaps"),
    _estimator("missing_samples_total", "counter", "samples missing in them", "missing_samples"),
    _estimator(
        "skipped_seconds_total",
        "counter",
        "samples passed over, the machine being too slow",
        "skipped_s",
    ),
    _estimator("seconds_per_sample", "gauge", "work for one sample", _one("us_per_sample", 1e-6)),
    _estimator("behind_seconds", "gauge", "arrival of samples to their estimates", "behind_s"),
    _estimator("waiting_messages", "gauge", "messages of all devices that wait for it", "waiting"),
    _estimator(
        "limit_hertz", "gauge", "estimates a second while it is too slow; 0: no limit", "limit_hz"
    ),
    _estimator(
        "refused_messages_total",
        "counter",
        "messages not used, by what was wrong",
        _each("refused"),
        "reason",
    ),
    Figure(
        "gyrofree_axis_excluded",
        "gauge",
        "1 for an axis that the estimates do without",
        tp.AXES,
        _axes,
        ("axis", "state"),
    ),
    _recorder("recording", "gauge", "1 while a session is recorded", "recording"),
    _recorder("session_seconds", "gauge", "length of the session", "seconds"),
    _recorder("session_messages", "gauge", "messages in it", "messages"),
    _recorder("session_bytes", "gauge", "bytes of it", "bytes"),
    _recorder(
        "undurable_messages",
        "gauge",
        "messages that are not known to be on the disk",
        lambda m: [((), max(0, m.messages - m.durable_messages))],
    ),
    _recorder(
        "repairing_messages",
        "gauge",
        "messages held back until a gap before them is filled",
        "repairing",
    ),
    _recorder(
        "lost_messages_total",
        "counter",
        "messages missing in the session, by key",
        _each("lost"),
        "key",
    ),
    _recorder(
        "repaired_messages_total",
        "counter",
        "messages filled in from what their publisher kept, by key",
        _each("repaired"),
        "key",
    ),
    _recorder(
        "refused_messages_total",
        "counter",
        "messages not recorded, by what was wrong",
        _each("refused"),
        "reason",
    ),
    _recorder("clock_steps_total", "counter", "times that the clock was set", "clock_steps"),
    Figure("gyrofree_procedure_running", "gauge", "1 while a test runs", tp.PROCEDURE, _running),
    Figure(
        "gyrofree_alarm_active",
        "gauge",
        "1 while the cause is there, 0 once it is gone; by level and state",
        tp.ALARM,
        _alarms,
        ("id", "level", "state"),
    ),
    Figure(
        "gyrofree_alarms_unknown",
        "gauge",
        "alarms of which it is not known now whether their cause is there",
        tp.ALARM,
        _unknown_alarms,
    ),
)
TOPICS = frozenset(figure.topic.name for figure in FIGURES)


def markdown(rows: Iterable[tuple[str, str, str, str]]) -> str:
    """A table for docs/operations.md: name, kind, labels, text."""
    lines = ["| name | kind | labels | what |", "|---|---|---|---|"]
    lines += [f"| `{name}` | {kind} | {labels} | {text} |" for name, kind, labels, text in rows]
    return "\n".join(lines) + "\n"


def rows() -> Iterator[tuple[str, str, str, str]]:
    """Of the figures above."""
    for figure in FIGURES:
        labels = ", ".join((*labels_of(figure.topic), *figure.labels))
        yield figure.name, figure.kind, labels, figure.text
