"""What a scenario holds: its recordings, sample by sample, against their certificates."""

from collections import defaultdict
from dataclasses import dataclass, field
from pathlib import Path

from messages.contract import rates
from messages.contract.topics import ACCEL, LINK, RATE, parse
from sessions.library.catalogue import Catalogue
from sessions.recording.certificate import HARMLESS, DeviceCertificate
from sessions.recording.mcap_log import read

DEVICE = "cube"


@dataclass
class Account:
    """All sessions of one scenario together."""

    sessions: list[str] = field(default_factory=list)
    samples: int = 0
    missing: int = 0  # samples between the first and the last, by their index
    twice: int = 0  # messages
    unestimated: int = 0  # samples without an estimate, between an estimator's first and last
    acknowledged_lost: int = 0  # messages that the recorder had called durable
    boots: int = 0
    complete: bool = True  # all of their certificates
    said_missing: int = 0  # samples, by the certificates
    said_lost: dict[str, int] = field(
        default_factory=lambda: defaultdict(int)
    )  # messages, by topic
    refused: dict[str, int] = field(default_factory=lambda: defaultdict(int))
    dark_s: float = 0.0


def account(root: Path, sessions: list[str], durable: dict[str, int]) -> Account:
    """Read them all; `durable`: by session the messages that the recorder acknowledged."""
    made, catalogue = Account(sessions=sessions), Catalogue(root)
    seen: set[tuple] = set()
    samples: dict[int, set[int]] = defaultdict(set)
    estimates: dict[tuple[str, int], set[int]] = defaultdict(set)
    for name in sessions:
        rows = 0
        for row in read(catalogue.path(name)):
            rows += 1
            address = parse(row.key)
            if address.topic not in (ACCEL, RATE, LINK) or address.device != DEVICE:
                continue
            message = address.topic.type.FromString(row.payload)
            at = (row.key, message.header.run, message.header.sequence)
            made.twice += at in seen
            seen.add(at)
            if address.topic is ACCEL:
                n = len(message.counts) // message.axes
                samples[message.header.epoch].update(
                    range(message.first_index, message.first_index + n)
                )
            elif address.topic is RATE:
                first, n = message.for_index, rates.count(message)
                estimates[row.key, message.header.epoch].update(range(first, first + n))
        made.acknowledged_lost += max(0, durable.get(name, 0) - rows)
        _certificate(made, catalogue, name)
    made.boots = len(samples)
    for have in samples.values():
        made.samples += len(have)
        made.missing += max(have) - min(have) + 1 - len(have)
    for (_, boot), have in estimates.items():
        between = {i for i in samples[boot] if min(have) <= i <= max(have)}
        made.unestimated += len(between - have)
    return made


def _certificate(made: Account, catalogue: Catalogue, name: str) -> None:
    said = catalogue.manifest(name).certificate.get(DEVICE)
    if said is None:
        made.complete = False
        return
    certificate = DeviceCertificate.model_validate(said)
    made.complete &= certificate.complete
    made.said_missing += certificate.missing_samples
    for topic, count in certificate.topics.items():
        if count.lost:
            made.said_lost[topic] += count.lost
    made.dark_s += certificate.dark_s
    for why, count in certificate.refused.items():
        if why not in HARMLESS:
            made.refused[why] += count
