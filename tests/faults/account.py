"""What a scenario holds: its recordings, sample by sample, against their certificates."""

from collections import defaultdict
from dataclasses import dataclass, field
from pathlib import Path

from support.recorded import Recorded

from messages.contract.topics import ACCEL, LINK, RATE, Address
from sessions.library.catalogue import Catalogue
from sessions.recording.certificate import HARMLESS, DeviceCertificate

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
    gone: int = 0  # sessions that were deleted
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
    found = Recorded(_counted)
    for name in sessions:
        if not (root / name).exists():
            made.gone += 1
            continue
        found.read(catalogue.path(name))
        made.acknowledged_lost += max(0, durable.get(name, 0) - found.rows[name])
        _certificate(made, catalogue, name)
    made.boots = len(found.samples)
    made.samples = sum(map(len, found.samples.values()))
    made.missing, made.twice = found.missing, found.twice
    made.unestimated = found.unestimated(to_the_end=False)
    return made


def _counted(address: Address) -> bool:
    """What a device's own services say: others may say anything."""
    return address.topic in (ACCEL, RATE, LINK) and address.device == DEVICE


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
