"""Every topic of the system, in the order the data flow.

Bus keys, recording channels, staleness limits and docs/topics.md come from this table; no other
file spells a key. A key is ``<prefix>/<device>/<topic>`` or, for topics of which there is one per
estimator, ``<prefix>/<device>/<topic>/<estimator>``. Prefix, device and estimator names match NAME.
"""

from dataclasses import dataclass
from typing import Generic, TypeVar

from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.LocationFix_pb2 import LocationFix
from foxglove_schemas_protobuf.Log_pb2 import Log
from google.protobuf.message import Message

from messages.contract import gyrofree_pb2 as pb
from messages.contract.names import NAME

M = TypeVar("M", bound=Message)

REPLAY_SUFFIX = "-replay"  # of a device's name when a recording of it is played on the bus
RECORDER = "recorder"  # the device name under which the recorder speaks

# processes by the topics' `source`; those that keep what they publish, and all of which one serves
GATEWAY, ESTIMATES, PROCEDURES = "gateway", "estimator", "procedures"
ALARMS = "alarms"
KEEPING = (GATEWAY, ESTIMATES, PROCEDURES, ALARMS)
COMMAND = "command"  # the device name under which it is said who has the command, and orders are
CLAIMED = (GATEWAY, ESTIMATES, PROCEDURES, RECORDER, "replay", ALARMS)


class TopicError(ValueError):
    """A name or key that cannot stand on the bus."""


@dataclass(frozen=True)
class Topic(Generic[M]):
    """One row of the table."""

    name: str
    type: type[M]
    rate: float  # Hz, nominal; 0 for messages sent on an event
    source: str  # the process that publishes it
    text: str
    per_estimator: bool = False
    recorded: bool = True

    def key(self, prefix: str, device: str, estimator: str = "") -> str:
        """Bus key of this topic; raises TopicError for a name that may not stand in a key."""
        names = [prefix, device] + ([estimator] if self.per_estimator else [])
        for name in names:
            check_name(name)
        return "/".join([prefix, device, self.name] + names[2:])

    def pattern(self, prefix: str, device: str = "*") -> str:
        """Key expression that matches this topic of one or (default) every device."""
        return f"{prefix}/{device}/{self.name}" + ("/*" if self.per_estimator else "")


ACCEL = Topic("accel", pb.AccelBatch, 100, "gateway", "raw and scaled accelerometer axes")
IMU = Topic("imu", pb.ImuBatch, 100, "gateway", "specific force and rate of a six-axis board")
TACHO = Topic("tacho", pb.TachoRate, 20, "gateway", "table rate from tachometer pulses")
GNSS = Topic("gnss", pb.GnssFix, 4, "gateway", "GNSS epoch: position, velocity, quality")
LOCATION = Topic("location", LocationFix, 4, "gateway", "the same position for any viewer")
SKY = Topic("sky", pb.Sky, 1, "gateway", "satellites in view: direction, C/N0, used in the fix")
LINK = Topic("link", pb.LinkStatus, 1, "gateway", "state and ledger of the line")
BOARD = Topic("board", pb.BoardInfo, 0.1, "gateway", "what the board says of itself")
TRUTH = Topic("truth", pb.Truth, 100, "simulator", "true motion; simulated boards only")
RATE = Topic(
    "rate", pb.RateBatch, 100, "estimator", "gyro-free rotation estimates", per_estimator=True
)
NAV = Topic("nav", pb.NavSolution, 20, "estimator", "INS/GNSS solution", per_estimator=True)
INNOVATION = Topic(
    "innovation", pb.Innovation, 4, "estimator", "correction by one fix", per_estimator=True
)
POSE = Topic(
    "pose", FrameTransform, 20, "estimator", "body against n, for any viewer", per_estimator=True
)
ESTIMATOR = Topic(
    "estimator", pb.EstimatorStatus, 1, "estimator", "health of one estimator", per_estimator=True
)
ADC = Topic("adc", pb.AdcBatch, 100, "gateway", "raw counts of an analogue board")
ATTITUDE = Topic(
    "attitude", pb.AttitudeEstimate, 50, "estimator", "tilt of a six-axis board", per_estimator=True
)
AXES = Topic("axes", pb.AxisHealth, 4, "estimator", "health of every accelerometer axis")
CALIBRATION = Topic(
    "calibration", pb.CalibrationStatus, 2, "estimator", "progress of a guided calibration"
)
WIRING = Topic(
    "wiring", pb.WiringStatus, 4, "estimator", "progress of a guided detection of axes and signs"
)
MUTE = Topic(
    "mute", pb.GnssMute, 0, "estimator", "an operator's GNSS outage: fixes that are held back"
)
PROCEDURE = Topic(
    "procedure", pb.ProcedureStatus, 4, "procedures", "a test as it runs, step by step"
)
ALARM = Topic("alarm", pb.AlarmStatus, 0.5, "alarms", "what is wrong, and who took note of it")
HOLDER = Topic(
    "holder", pb.CommandStatus, 1, "procedures", "who has the command of the site", recorded=False
)
ORDER = Topic(
    "order",
    pb.OrderGiven,
    0,
    "people",
    "an order and what came of it; the device is the place that gave it",
    recorded=False,
)
NOTE = Topic("note", pb.Note, 0, "any", "remarks on the data by people and programs")
REPLAY = Topic("replay", pb.ReplayStatus, 5, "replay", "where a replay stands", recorded=False)
STATUS = Topic("status", pb.RecorderStatus, 1, "recorder", "state of the recording", recorded=False)
BEAT = Topic(
    "beat", pb.Beat, 2, "all", "a process is there and runs", per_estimator=True, recorded=False
)
LOG = Topic("log", Log, 0, "any", "warnings worth keeping with the data")

TOPICS: tuple[Topic, ...] = (
    ACCEL,
    IMU,
    ADC,
    TACHO,
    GNSS,
    LOCATION,
    SKY,
    LINK,
    BOARD,
    TRUTH,
    RATE,
    NAV,
    INNOVATION,
    ATTITUDE,
    POSE,
    ESTIMATOR,
    AXES,
    CALIBRATION,
    WIRING,
    PROCEDURE,
    ALARM,
    HOLDER,
    ORDER,
    NOTE,
    REPLAY,
    STATUS,
    LOG,
    MUTE,
    BEAT,
)

BY_NAME = {topic.name: topic for topic in TOPICS}
PIPELINE_INPUTS = (
    ACCEL,
    IMU,
    ADC,
    GNSS,
    TACHO,
)  # what estimates are made of, live and from a recording
PIPELINE_ORDERS = (
    MUTE,
)  # what people ordered: published live, given from a recording before all inputs


@dataclass(frozen=True)
class Address:
    """A bus key taken apart."""

    prefix: str
    device: str
    topic: Topic
    estimator: str


def check_name(name: str) -> str:
    """The name itself; raises TopicError when it may not stand in a key."""
    if not NAME.fullmatch(name):
        raise TopicError(
            f"name {name[:80]!r}: want a-z, 0-9, _ and - after a first letter, at most 32"
            " characters"
        )
    return name


def parse(key: str) -> Address:
    """Take a key apart; raises TopicError for one that is not in the table, or has a name that is
    none.
    """
    parts = key.split("/")
    topic = BY_NAME.get(parts[2]) if len(parts) in (3, 4) else None
    if topic is None or (len(parts) == 4) != topic.per_estimator:
        known = ", ".join(BY_NAME)
        raise TopicError(
            f"key {key[:200]!r}: want <prefix>/<device>/<topic>[/<estimator>], topic one of {known}"
        )
    for name in (parts[0], parts[1], *parts[3:]):
        check_name(name)
    return Address(parts[0], parts[1], topic, parts[3] if topic.per_estimator else "")


def recorder_control_key(prefix: str) -> str:
    """Key of the recorder's queryable: RecorderCommand in, RecorderStatus out."""
    return f"{check_name(prefix)}/{RECORDER}/control"


def history_key(prefix: str, device: str) -> str:
    """Key of a gateway's queryable for journal records: selector parameters `first` and `last`;
    device `*` stands for any.
    """
    return control_key(prefix, device, "history")


def fence_key(prefix: str, device: str) -> str:
    """Key at which consumers tell the greatest number heard of a device; `*` stands for any."""
    return control_key(prefix, device, "fence")


def claim_key(prefix: str, source: str, device: str = "every") -> str:
    """Key below which a process claims to be the one that publishes as `source`; a gateway does so
    for each device.
    """
    if device != "*":
        check_name(device)
    return f"{check_name(prefix)}/{device}/{check_name(source)}"


def published_key(prefix: str, device: str, source: str) -> str:
    """Key of a queryable for published messages: HistoryQuery in, HistoryReply out; `*` stands for
    any name.
    """
    for name in (prefix, device, source):
        if name != "*":
            check_name(name)
    return f"{prefix}/{device}/published/{source}"


def control_key(prefix: str, device: str, what: str) -> str:
    """Key of a queryable for orders to one device: what is "board-control" (BoardCommand in, Reply
    out) or alike; device `*` stands for any.
    """
    if device != "*":
        check_name(device)
    return f"{check_name(prefix)}/{device}/{check_name(what)}"


def replay_control_key(prefix: str) -> str:
    """Key of a replay's queryable: ReplayCommand in, ReplayStatus out."""
    return f"{check_name(prefix)}/{REPLAY.name}/control"


def command_control_key(prefix: str) -> str:
    """Key of the queryable of who keeps the command: SeatCommand in, SeatReply out."""
    return f"{check_name(prefix)}/{COMMAND}/control"


def alarms_control_key(prefix: str) -> str:
    """Key of the alarms' queryable: AlarmCommand in, AlarmReply out."""
    return f"{check_name(prefix)}/{ALARMS}/control"


def alive_key(prefix: str, place: str, process: str) -> str:
    """Key of the token of a process that is there; its beats have the same last part."""
    for name in (place, process):
        if name != "*":
            check_name(name)
    return f"{check_name(prefix)}/{place}/alive/{process}"


MOST_LANES = 16  # further connections between two places, beside the one that is live


def clock_key(prefix: str) -> str:
    """Key of a queryable that tells the time of the site: nothing in, ClockReply out."""
    return f"{check_name(prefix)}/site/clock"


def markdown() -> str:
    """The table of docs/topics.md."""
    rows = ["| topic | type | Hz | published by | recorded | what |", "|---|---|---|---|---|---|"]
    for topic in TOPICS:
        name = topic.name + ("/&lt;estimator&gt;" if topic.per_estimator else "")
        rate = f"{topic.rate:g}" if topic.rate else "on event"
        recorded = "yes" if topic.recorded else "no"
        rows.append(
            f"| `{name}` | `{topic.type.DESCRIPTOR.full_name}` | {rate} | {topic.source} |"
            f" {recorded} | {topic.text} |"
        )
    return "\n".join(rows) + "\n"
