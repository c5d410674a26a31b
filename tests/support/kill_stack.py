"""Kill services of the running stack with SIGKILL and account for every sample afterwards: for a
test and a bench.
"""

import json
import random
import signal
import time
from collections import defaultdict
from dataclasses import dataclass, field
from pathlib import Path

from messages.bus.session import BusSettings, open_client, subscribe
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import LINK, RATE, STATUS
from messages.history.journal_file import scan
from sessions.library.catalogue import Catalogue
from support.recorded import Recorded
from support.stack import RunningDemo

SERVICES = ("gateway", "record", "estimator", "dashboard", "router")
PATIENCE = 240.0  # s, for a service to be back at work


class Watch:
    """What a bystander on the bus sees: newest acknowledgements of gateway and recorder, and who is
    alive.
    """

    def __init__(self, bus: BusSettings) -> None:
        self.session = open_client(bus)
        self.recorder = pb.RecorderStatus()
        self.link = pb.LinkStatus()
        self.rates = 0
        self.durable: dict[str, int] = {}  # session -> messages acknowledged as safe
        self._held = [
            subscribe(self.session, STATUS, bus.prefix, self._status),
            subscribe(self.session, LINK, bus.prefix, lambda _, m: setattr(self, "link", m)),
            subscribe(
                self.session, RATE, bus.prefix, lambda *_: setattr(self, "rates", self.rates + 1)
            ),
        ]

    def _status(self, _: str, status: pb.RecorderStatus) -> None:
        self.recorder = status
        if status.session:
            self.durable[status.session] = max(
                self.durable.get(status.session, 0), status.durable_messages
            )

    def close(self) -> None:
        """Leave."""
        self.session.close()


@dataclass
class Account:
    """The balance after the stack has ended."""

    kills: dict[str, int] = field(default_factory=lambda: defaultdict(int))
    samples: int = 0
    missing_s: dict[str, float] = field(
        default_factory=dict
    )  # longest hole in the samples, s, by service killed
    total_missing_s: float = 0.0
    duplicates: int = 0
    acknowledged_lost: int = 0
    estimates_missing: int = 0
    states: list[str] = field(default_factory=list)


def kill_all(
    demo: RunningDemo,
    watch: Watch,
    rounds: int,
    seed: int,
    services: tuple[str, ...] = SERVICES,
    kills: list[tuple[str, int]] | None = None,
) -> list[tuple[str, int]]:
    """Kill each service `rounds` times at random moments; (service, UTC ns) of each. Waits for the
    work to go on.

    `kills` is filled while it goes on, for who wants them also when AssertionError says that the
    work does not.
    """
    chance = random.Random(seed)
    order = [service for service in services for _ in range(rounds)]
    chance.shuffle(order)
    kills = [] if kills is None else kills
    for service in order:
        time.sleep(chance.uniform(0.5, 2.5))
        victim = demo.children()[service]
        kills.append((service, time.time_ns()))
        victim.send_signal(signal.SIGKILL)
        _wait_for_work(demo, watch, service, victim.pid)
    time.sleep(3.0)
    return kills


def _wait_for_work(demo: RunningDemo, watch: Watch, service: str, pid: int) -> None:
    """Until the service is another process, samples are estimated, and the recorder's disk has
    newer ones.
    """
    end = time.monotonic() + PATIENCE
    since = time.time_ns()
    stage = rates = 0
    while time.monotonic() < end:
        time.sleep(0.1)
        child = demo.children().get(service)
        if child is None or child.pid == pid:
            continue
        if stage == 0 and watch.recorder.header.utc_ns > since and watch.link.header.utc_ns > since:
            stage, rates, messages = 1, watch.rates, watch.recorder.durable_messages
            session = watch.recorder.session
        elif (
            stage == 1
            and watch.recorder.recording
            and not watch.recorder.repairing
            and watch.rates > rates + 20
        ):
            if watch.recorder.session != session or watch.recorder.durable_messages > messages:
                return
    raise AssertionError(f"after killing {service} the work does not go on:\n{demo.text()[-3000:]}")


def account(folder: Path, kills: list[tuple[str, int]], durable: dict[str, int]) -> Account:
    """Read every session of a stopped stack and count what is missing, double, or was acknowledged
    and is not there.
    """
    result, found = Account(), Recorded()
    for service, _ in kills:
        result.kills[service] += 1
    for info in sorted(Catalogue(folder / "sessions").list(), key=lambda info: info.id):
        result.states.append(info.state)
        found.read(info.path)
        result.acknowledged_lost += max(0, durable.get(info.id, 0) - found.rows[info.id])
    result.samples = sum(map(len, found.samples.values()))
    result.duplicates = found.twice
    result.estimates_missing = found.unestimated(to_the_end=True)
    for hole in found.holes():
        result.total_missing_s += hole.seconds
        cause = min(kills, key=lambda kill: abs(kill[1] - hole.at_ns))[0]
        result.missing_s[cause] = max(result.missing_s.get(cause, 0.0), hole.seconds)
    return result


def journal_records(folder: Path) -> tuple[int, int]:
    """Number and last sequence of the good records of a journal."""
    found = [
        r.sequence
        for name in sorted(folder.glob("*.gfj"))
        for _, _, r in scan(name.read_bytes()).records
    ]
    return len(found), max(found, default=0)


def bus_of(demo: RunningDemo) -> BusSettings:
    """The demo's bus."""
    return BusSettings(router=f"tcp/127.0.0.1:{demo.bus_port}")


def line(name: str, value: object, unit: str, **more: object) -> None:
    """One figure as JSON."""
    print(json.dumps({"name": name, "value": value, "unit": unit, **more}), flush=True)
