"""What a session holds of what there was, per device and topic, and what made it: certificate and
provenance.

The certificate counts messages on the bus by their sequences, and the line before it by the
gateway's own ledger (LinkStatus). It speaks of what lies between the first and the last message of
a topic.
"""

from google.protobuf.message import DecodeError
from pydantic import BaseModel, ConfigDict

from messages.contract import gyrofree_pb2 as pb
from messages.contract.door import OTHERS
from messages.contract.topics import (
    ACCEL,
    ADC,
    BOARD,
    IMU,
    LINK,
    NAV,
    RATE,
    Address,
    TopicError,
    parse,
)
from sessions.recording.manifest import KeyCount
from sessions.recording.samples import decode

MOST_RUNS = 1000  # of a gateway, and calibration files of a device, that are told apart
LONGEST_CARD = 200  # characters of a calibration file's id
LOOK_EVERY = 200  # messages of an estimate between two looks at its calibration
WIRE = (
    "good_frames",
    "lost_frames",
    "lost_samples",
    "device_dropped",
    "bad_chunks",
    "bad_bytes",
    "reboots",
)

SAMPLED = (ACCEL, IMU, ADC)  # topics with samples at even steps
HARMLESS = {"repeated", "stale", "claim"}  # refused, and yet nothing is missing


class TopicCertificate(BaseModel):
    """Messages of one topic."""

    model_config = ConfigDict(extra="ignore")

    expected: int = 0
    received: int = 0  # distinct ones in the file, the repaired among them
    repaired: int = 0
    lost: int = 0
    damaged: int = 0  # in the file, but their header cannot be read


class DeviceCertificate(BaseModel):
    """One device: its topics, its line, and the time nobody read it."""

    model_config = ConfigDict(extra="ignore")

    complete: bool = (
        True  # nothing lost, damaged or refused on the bus, no sample missing, never dark
    )
    topics: dict[str, TopicCertificate] = {}
    wire: dict[str, int] = {}  # counters of LinkStatus over the session
    refused: dict[str, int] = {}  # messages not recorded, by what was wrong with them
    missing_samples: int = 0  # by index and the device's clock, whatever the line said
    dark_s: float = 0.0  # s, by the board's clock, that nobody read it between two gateways' runs


def certify(
    keys: dict[str, KeyCount],
    wire: dict[str, dict[str, int]],
    refused: dict[str, dict[str, int]] | None = None,
) -> dict[str, DeviceCertificate]:
    """Certificate per device from the counts per bus key, the lines' counters per device, and what
    was refused of each.
    """
    found: dict[str, DeviceCertificate] = {}
    sampled = {a.device for a in map(_address, keys) if a is not None and a.topic in SAMPLED}
    for key, count in sorted(keys.items()):
        address = _address(key)
        if address is None:
            continue
        device = found.setdefault(
            address.device, DeviceCertificate(wire=wire.get(address.device, {}))
        )
        name = (
            f"{address.topic.name}/{address.estimator}" if address.estimator else address.topic.name
        )
        device.topics[name] = TopicCertificate(
            expected=count.expected,
            received=count.messages - count.repeated,
            repaired=count.repaired,
            lost=count.lost,
            damaged=count.unreadable,
        )
        device.missing_samples += count.missing_samples
        # words on the line come when they come: where there are samples, they tell
        if address.topic in SAMPLED or (
            address.topic.source == LINK.source and address.device not in sampled
        ):
            device.dark_s = max(device.dark_s, count.dark_s)
    for name, counts in (refused or {}).items():
        if name != OTHERS:
            found.setdefault(name, DeviceCertificate()).refused = counts
    for device in found.values():
        bad = any(topic.lost or topic.damaged for topic in device.topics.values())
        lacks = device.refused.keys() - HARMLESS
        missing = device.missing_samples or device.wire.get("lost_samples")
        device.complete = not (bad or lacks or missing or device.dark_s)
    return found


def _address(key: str) -> Address | None:
    try:
        return parse(key)
    except TopicError:
        return None


class Witness:
    """Looks at the few messages that say how a session came about."""

    def __init__(self) -> None:
        self._boards: dict[str, pb.BoardInfo] = {}
        self._lines: dict[
            str, dict[int, tuple[pb.LinkStatus, pb.LinkStatus]]
        ] = {}  # by run: first and last
        self._cards: dict[str, set[str]] = {}
        self._n: dict[tuple[str, str], int] = {}

    def look(self, address: Address, payload: bytes) -> None:
        """One recorded message; almost all of them are passed over without being parsed."""
        topic, device = address.topic, address.device
        try:
            if topic is BOARD:
                self._boards[device] = pb.BoardInfo.FromString(payload)
            elif topic is LINK:
                status = pb.LinkStatus.FromString(payload)
                runs = self._lines.setdefault(device, {})
                if len(runs) >= MOST_RUNS and status.header.run not in runs:
                    return
                runs[status.header.run] = (runs.get(status.header.run, (status,))[0], status)
            elif topic is RATE or topic is NAV:
                n = self._n[device, address.estimator] = (
                    self._n.get((device, address.estimator), -1) + 1
                )
                if n % LOOK_EVERY == 0:
                    card = decode(topic, payload).calibration
                    cards = self._cards.setdefault(device, set())
                    if card and len(cards) < MOST_RUNS:
                        cards.add(card[:LONGEST_CARD])
        except DecodeError:
            pass  # counted as unreadable elsewhere

    def wire(self) -> dict[str, dict[str, int]]:
        """Counters of each device's line, from the first to the last status of each of its
        gateway's runs.
        """
        found = {}
        for device, runs in self._lines.copy().items():
            pairs = list(runs.copy().values())
            found[device] = {
                name: sum(getattr(b, name) - getattr(a, name) for a, b in pairs) for name in WIRE
            }
        return found

    def provenance(self) -> dict[str, dict[str, object]]:
        """Per device: firmware, board, axes, and the calibration files its estimates used."""
        found: dict[str, dict[str, object]] = {}
        for device, board in self._boards.copy().items():
            found.setdefault(device, {}).update(
                firmware=board.firmware,
                uid=board.uid,
                board_id=board.board_id,
                axes=board.axes,
                sample_period_s=board.sample_period_s,
            )
        for device, cards in self._cards.copy().items():
            found.setdefault(device, {})["calibration"] = sorted(cards.copy())
        return found
