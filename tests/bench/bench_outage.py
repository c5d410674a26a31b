"""The router is gone for ten minutes, in real time: does everything that was measured and estimated
get into the files?

    python tests/bench/bench_outage.py [minutes, default 10] [samples per second, default 100]

Router, gateway, estimator and recorder are processes, the board speaks through a pseudo-terminal
all the time. The router is killed and started again after the outage. Then every message of every
session is read.
"""

import socket
import sys
import tempfile
import threading
import time
from collections import defaultdict
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from support.kill_stack import line  # noqa: E402
from support.stack import free_port  # noqa: E402
from support.waiting import until  # noqa: E402

from messages.bus.session import open_client, subscribe  # noqa: E402
from messages.contract import rates  # noqa: E402
from messages.contract.topics import ACCEL, ESTIMATOR, LINK, RATE, STATUS, parse  # noqa: E402
from sessions.library.catalogue import Catalogue  # noqa: E402
from sessions.recording.mcap_log import read  # noqa: E402
from tests.system.test_kill import Stack  # noqa: E402

PATIENCE_S = 900.0  # for everything to be whole again
CALM_S = 5.0


class Outage(Stack):
    """The stack with a router and an estimator of their own."""

    def __enter__(self) -> "Outage":
        self.rates = 0
        text = self.config.read_text().replace(
            "[gateway]", f'listen = ["{self.bus.router}"]\n[gateway]', 1
        )
        self.config.write_text(text + f'[estimator]\njournal = "{self.folder}/estimates"\n')
        self.router = self.start("router")
        self._client = open_client(self.bus, timeout_s=60.0)
        self._held = [
            subscribe(self._client, STATUS, "gyrofree", lambda _, m: setattr(self, "status", m)),
            subscribe(self._client, LINK, "gyrofree", lambda _, m: setattr(self, "line", m)),
            subscribe(
                self._client, ESTIMATOR, "gyrofree", lambda _, m: setattr(self, "rates", m.samples)
            ),
        ]
        self.others = [self.start("gateway"), self.start("estimator"), self.start("record")]
        until(lambda: self.status.recording and self.line.connected, "recorder and gateway")
        until(
            lambda: "estimating:" in (self.folder / "estimator.log").read_text(),
            "the estimator",
            600.0,
        )
        self._board.start()
        until(lambda: self.rates > 200, "the first estimates")
        return self

    def reached(self) -> bool:
        """True when the router takes connections."""
        host, port = self.bus.router.removeprefix("tcp/").split(":")
        with socket.socket() as probe:
            return probe.connect_ex((host, int(port))) == 0

    def __exit__(self, *_: object) -> None:
        if self._stop.is_set():
            return
        self._stop.set()
        self._board.join()
        time.sleep(1.0)
        for process in self.others[::-1]:
            process.terminate()
            process.wait(60.0)
        self._client.close()
        self.router.terminate()
        self.router.wait()
        self.link.close()


def trial(folder: Path, minutes: float, rate: float) -> dict:
    """One outage."""
    stop = threading.Event()
    with Outage(folder, free_port(), 1.0 / rate) as stack:
        stop.wait(5.0)
        stack.router.kill()
        stack.router.wait()
        stop.wait(60.0 * minutes)
        before = stack.status.messages
        stack.router, begun = stack.start("router"), time.monotonic()
        while stack.router.poll() is None and not stack.reached():
            time.sleep(0.1)
        if stack.router.poll() is not None:
            raise SystemExit("somebody has taken the router's port meanwhile: run this again")
        calm = None
        while calm is None or time.monotonic() - calm < CALM_S:
            if time.monotonic() - begun > PATIENCE_S:
                break
            time.sleep(0.1)
            behind = (
                stack.status.messages < before + 2 * 60.0 * minutes * rate
            )  # samples and at least one estimate each
            if stack.status.repairing or behind:
                calm = None
            elif calm is None:
                calm = time.monotonic()
        whole_s = (calm or time.monotonic()) - begun
    return {"whole_s": whole_s} | account(folder)


def account(folder: Path) -> dict:
    """What the sessions hold: samples and estimates that are missing, and messages that stand
    twice.
    """
    seen, double, have, estimates, line_lost = set(), 0, set(), defaultdict(set), 0
    for info in Catalogue(folder / "sessions").list():
        for row in read(info.path):
            topic = parse(row.key).topic
            if "header" not in topic.type.DESCRIPTOR.fields_by_name:
                continue
            message = topic.type.FromString(row.payload)
            name = (row.key, message.header.run, message.header.sequence)
            double += name in seen
            seen.add(name)
            if topic is ACCEL:
                line_lost += (
                    message.lost_samples
                )  # the board's own index says so: it never came to the gateway
                have |= set(
                    range(
                        message.first_index,
                        message.first_index + len(message.counts) // message.axes,
                    )
                )
            elif topic is RATE:
                n = rates.count(message)
                estimates[row.key].update(range(message.for_index, message.for_index + n))
    lost = max(have) - min(have) + 1 - len(have) - line_lost
    missing = sum(len((have & set(range(min(n), max(n) + 1))) - n) for n in estimates.values())
    return {
        "samples": len(have),
        "lost": lost,
        "line_lost": line_lost,
        "double": double,
        "estimates_missing": missing,
        "estimators": len(estimates),
    }


def main(minutes: float = 10.0, rate: float = 100.0) -> None:
    """Run and print."""
    with tempfile.TemporaryDirectory() as name:
        found = trial(Path(name), minutes, rate)
    more = {
        "minutes": minutes,
        "rate_hz": rate,
        "samples": found["samples"],
        "lost_on_the_line": found["line_lost"],
    }
    line("outage_samples_lost", found["lost"], "samples", target=0, **more)
    line(
        "outage_estimates_missing",
        found["estimates_missing"],
        "estimates",
        target=0,
        estimators=found["estimators"],
    )
    line("outage_double", found["double"], "messages", target=0)
    line("outage_whole_on_disk", round(found["whole_s"], 1), "s")


if __name__ == "__main__":
    main(*(float(word) for word in sys.argv[1:3]))
