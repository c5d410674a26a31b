"""What browsers cost: bytes per second of one at the first page, and the dashboard's CPU.

    python tests/bench/bench_browsers.py [browsers, default 20] [seconds, default 20]

The whole demo runs; browsers are WebSocket clients of the front door, signed in by its link, that
read everything as viser's page does. Bytes are told apart by the kind of message. CPU is a share of
one core: of the dashboard without a browser, with one, with all of them.

The delay of an update is from when an attitude is published on the bus, as a subscriber beside the
browsers hears it, to when a browser has it: taken at TIMED of the browsers while all look. The
others are in a process of their own, lest those that are timed wait for them.
"""

import json
import math
import multiprocessing
import secrets
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Sequence
from multiprocessing.synchronize import Event
from pathlib import Path

import httpx
import msgspec
import numpy as np
import psutil
import viser
import websockets.sync.client
import zstandard

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from support.front_door import CAMERA, message
from support.stack import RunningDemo

from dashboard.web.users import add_user, issue_link_token
from gyrofree.config import load
from messages.bus.session import BusSettings, open_client, subscribe
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import RATE

SETTLE_S = 35.0  # until the default window of 30 s is full
OPENING_S = 4.0  # a browser that has just come is sent the whole scene
TIMED = 5  # browsers whose delays are taken
REMEMBERED = 20_000  # attitudes
PER_USER = 10  # scenes that one user may have open, and some to spare
POSES = {"SetOrientationMessage", "SetPositionMessage", "SceneNodeUpdateMessage"}


class Browser:
    """One reader of the scene; `bytes` by kind of message while `counting`."""

    def __init__(self, url: str, users: Path, name: str, heard: "Heard | None" = None) -> None:
        self._heard, self.delays_s = heard, list[float]()
        self.bytes: Counter[str] = Counter()
        self.frames, self.counting = 0, False
        with httpx.Client(base_url=url, headers={"origin": url}) as client:
            token = issue_link_token(users, name)
            client.post("/login/link", data={"token": token})
            cookies = "; ".join(f"{name}={value}" for name, value in client.cookies.items())
        self._socket = websockets.sync.client.connect(
            url.replace("http", "ws") + "/scene",
            additional_headers={"cookie": cookies},
            origin=url,
            subprotocols=[f"viser-v{viser.__version__}"],
            max_size=None,
            compression=None,
            proxy=None,
        )
        self._socket.send(message("ViewerCameraMessage", **CAMERA))  # now it counts as a viewer
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def _read(self) -> None:
        try:
            for frame in self._socket:
                if self.counting:
                    self.frames += 1
                    self._count(frame)
                elif self._heard is not None and self._heard.timing:
                    self._time(frame, time.monotonic())
        except (websockets.ConnectionClosed, OSError):
            return

    def _time(self, frame: bytes, now: float) -> None:
        for one in _told(frame)["messages"]:
            if one["type"] == "SetOrientationMessage" and one["name"].endswith("/body"):
                at = self._heard.at.get(_key(one["wxyz"]))
                if at is not None and math.isfinite(at):
                    self.delays_s.append(now - at)

    def _count(self, frame: bytes) -> None:
        packed = int.from_bytes(frame[8:16], "little")
        told = msgspec.msgpack.decode(zstandard.decompress(frame[16 : 16 + packed]))
        sizes = told["binaryBufferLengths"]
        rest = Counter()
        for one in told["messages"]:
            kind = _kind(one)
            arrays = list(_arrays(one))
            self.bytes[kind] += sum(sizes[k] for k in arrays)
            rest[kind] += len(msgspec.msgpack.encode(one))
        for kind, size in rest.items():  # its share of the packed part
            self.bytes[kind] += round(packed * size / max(1, rest.total()))

    def close(self) -> None:
        """Go."""
        self._socket.close()
        self._thread.join(5.0)


class Heard:
    """Attitudes as they are published, and when; `timing` while delays are taken."""

    def __init__(self, bus: BusSettings) -> None:
        self.at: dict[tuple[int, ...], float] = {}  # NaN: several times
        self.timing = False
        self._session = open_client(bus, timeout_s=20.0)
        self._subscription = subscribe(self._session, RATE, bus.prefix, self._on_rate)

    def _on_rate(self, _: str, message: pb.RateBatch) -> None:
        if len(message.q_nb) < 4:
            return
        key = _key(message.q_nb[-4:])  # one that comes again says nothing of a delay
        self.at[key] = math.nan if key in self.at else time.monotonic()
        if len(self.at) > REMEMBERED:
            self.at.pop(next(iter(self.at)))

    def close(self) -> None:
        """Hear nothing more."""
        self._subscription.undeclare()
        self._session.close()


class Crowd:
    """Browsers in a process of their own."""

    def __init__(self, url: str, users: Path, names: list[str]) -> None:
        spawn = multiprocessing.get_context("spawn")
        self._here, self._over = spawn.Event(), spawn.Event()
        given = url, users, names, self._here, self._over
        self._process = spawn.Process(target=_look, args=given, daemon=True)
        self._process.start()
        if not self._here.wait(60.0 + len(names)):
            raise TimeoutError(f"{len(names)} browsers did not come in a minute")

    def close(self) -> None:
        """All go."""
        self._over.set()
        self._process.join(20.0)


def _look(url: str, users: Path, names: list[str], here: Event, over: Event) -> None:
    looking = [Browser(url, users, name) for name in names]
    here.set()
    over.wait()
    for browser in looking:
        browser.close()


def _key(q: Sequence[float]) -> tuple[int, ...]:
    return tuple(round(float(value) * 1e6) for value in q)


def _told(frame: bytes) -> dict:
    packed = int.from_bytes(frame[8:16], "little")
    return msgspec.msgpack.decode(zstandard.decompress(frame[16 : 16 + packed]))


def _kind(message: dict) -> str:
    kind = message["type"]
    if kind == "GuiUpdateMessage":
        return "charts" if "data" in message["updates"] else "tables"
    return "poses" if kind in POSES else kind


def _arrays(part: object):
    if isinstance(part, dict):
        if "__binary_index" in part:
            yield part["__binary_index"]
        for inner in part.values():
            yield from _arrays(inner)
    elif isinstance(part, (list, tuple)):
        for inner in part:
            yield from _arrays(inner)


def cpu(process: psutil.Process, seconds: float) -> float:
    """Percent of one core."""
    before, began = sum(process.cpu_times()[:2]), time.monotonic()
    time.sleep(seconds)
    return 100.0 * (sum(process.cpu_times()[:2]) - before) / (time.monotonic() - began)


def main(browsers: int = 20, seconds: float = 20.0) -> None:
    """Run and print one JSON line."""
    with tempfile.TemporaryDirectory() as folder, RunningDemo(Path(folder)) as demo:
        time.sleep(SETTLE_S)
        process = demo.children()["dashboard"]
        alone = cpu(process, seconds)
        users = load(demo.config).dashboard.users
        for k in range(0, browsers, PER_USER):
            add_user(users, f"bench-{k}", secrets.token_urlsafe(24), "viewer")
        looking = [Browser(demo.url, users, "bench-0")]
        time.sleep(OPENING_S)
        looking[0].counting, began = True, time.monotonic()
        first = cpu(process, seconds)
        span, looking[0].counting = time.monotonic() - began, False
        shares = {
            kind: round(size / span / 1e3, 1) for kind, size in looking[0].bytes.most_common()
        }
        heard = Heard(load(demo.config).bus)
        names = [f"bench-{k // PER_USER * PER_USER}" for k in range(1, browsers)]
        crowd = Crowd(demo.url, users, names[:-TIMED])
        looking += [Browser(demo.url, users, name, heard) for name in names[-TIMED:]]
        time.sleep(OPENING_S + browsers / 10)
        heard.timing = True
        many = cpu(process, seconds)
        heard.timing = False
        heard.close()
        crowd.close()
        delays = np.array([delay for browser in looking for delay in browser.delays_s])
        for browser in looking:
            browser.close()
    row = {
        "bench": "browsers",
        "kB_per_s": round(sum(shares.values()), 1),
        "kB_per_s_by_kind": shares,
        "frames_per_s": round(looking[0].frames / span, 1),
        "cpu_percent": {
            "none": round(alone, 1),
            "first_more": round(first - alone, 1),
            f"{browsers}": round(many, 1),
        },
        "delay_ms": {
            "updates": len(delays),
            **{f"p{p}": round(1e3 * float(np.percentile(delays, p)), 1) for p in (50, 95, 99)},
        }
        if len(delays)
        else None,
    }
    print(json.dumps(row))


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:3]))
