"""Browsers that read nothing, or 1 kB/s, beside one that reads all: is the dashboard's memory flat,
is the good one served, is each of the others ended with a reason?

    python tests/bench/bench_slow_clients.py [SECONDS]

The whole demo runs in real time. A crowd signed in as the same user opens scenes, event streams and
large files and takes nothing or little of them, and leaves connections half open; whatever is ended
is opened again. Printed every 10 s: memory of the dashboard, scene messages per second of the good
browser before and during, and how many of the crowd were ended.
"""

import base64
import os
import re
import socket
import struct
import sys
import tempfile
import threading
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import httpx
import psutil
import viser
import websockets.sync.client

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from support.front_door import CAMERA, message
from support.stack import RunningDemo

CROWD = {  # kind: how many, bytes/s that each takes
    "scene, nothing": (5, 0),
    "scene, 1 kB/s": (4, 1000),
    "stream, nothing": (6, 0),
    "file, nothing": (15, 0),
    "file, 1 kB/s": (15, 1000),
    "half open": (40, 0),
}
LARGE = "/static/vendor/maplibre/maplibre-gl.mjs"


@dataclass
class Crowd:
    """One kind of slow clients, on a thread."""

    kind: str
    port: int
    cookie: str
    stop: threading.Event
    lives: list[float] = field(default_factory=list)  # s, of those that were ended

    def run(self) -> None:
        number, rate = CROWD[self.kind]
        links: dict[socket.socket, float] = {}
        while not self.stop.wait(0.25):
            for link in list(links):
                if self._ended(link, int(rate * 0.25)):
                    self.lives.append(time.monotonic() - links.pop(link))
                    link.close()
            while len(links) < number:
                links[self._open()] = time.monotonic()
        for link in links:
            link.close()

    def _open(self) -> socket.socket:
        link = socket.socket()
        link.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        link.settimeout(10.0)
        link.connect(("127.0.0.1", self.port))
        link.sendall(self._request())
        if self.kind.startswith("scene"):  # its camera makes it a viewer
            answer = b""
            while b"\r\n\r\n" not in answer and (part := link.recv(256)):
                answer += part
            link.sendall(masked(message("ViewerCameraMessage", **CAMERA)))
        return link

    def _request(self) -> bytes:
        what = self.kind.partition(",")[0]
        path = {"scene": "/scene/", "file": LARGE}.get(what, "/api/devices/cube/stream?rate_hz=50")
        head = [f"GET {path} HTTP/1.1", f"Host: 127.0.0.1:{self.port}", f"Cookie: {self.cookie}"]
        if what == "scene":
            key = base64.b64encode(os.urandom(16)).decode()
            head += [
                "Connection: Upgrade",
                "Upgrade: websocket",
                "Sec-WebSocket-Version: 13",
                f"Sec-WebSocket-Key: {key}",
                f"Sec-WebSocket-Protocol: viser-v{viser.__version__}",
                f"Origin: http://127.0.0.1:{self.port}",
            ]
        text = "\r\n".join(head)
        return (text if what == "half open" else text + "\r\n\r\n").encode()

    def _ended(self, link: socket.socket, size: int) -> bool:
        """Take so many bytes; also one that takes nothing learns of its end."""
        link.settimeout(0.0)
        try:
            if size and link.recv(size) == b"":
                return True
        except BlockingIOError:
            pass
        except OSError:
            return True
        info = link.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, 1)
        return info[0] != 1  # TCP_ESTABLISHED


def masked(data: bytes) -> bytes:
    """A binary WebSocket frame as a client sends it, below 64 kB; its mask is zero."""
    return struct.pack("!BBH4x", 0x82, 0x80 | 126, len(data)) + data


class Good:
    """A browser that takes everything."""

    def __init__(self, url: str, cookie: str) -> None:
        self.messages = 0
        self._scene = websockets.sync.client.connect(
            url.replace("http", "ws") + "/scene/",
            origin=url,
            subprotocols=[f"viser-v{viser.__version__}"],
            additional_headers={"cookie": cookie},
            max_size=None,
            proxy=None,
        )
        self._scene.send(message("ViewerCameraMessage", **CAMERA))
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        for _ in self._scene:
            self.messages += 1


def main(seconds: float) -> None:
    with (
        tempfile.TemporaryDirectory() as folder,
        RunningDemo(Path(folder)) as demo,
        httpx.Client(headers={"origin": demo.url}) as client,
    ):
        token = re.search(r"token=(\S+)", demo.link)[1]
        client.post(demo.url + "/login/link", data={"token": token})
        cookie = "; ".join(f"{name}={value}" for name, value in client.cookies.items())
        dashboard = demo.children()["dashboard"]
        good, stop = Good(demo.url, cookie), threading.Event()
        time.sleep(20.0)
        look = Look(dashboard, good)
        look.say("alone", Counter())
        crowd = [Crowd(kind, demo.port, cookie, stop) for kind in CROWD]
        threads = [threading.Thread(target=one.run) for one in crowd]
        for thread in threads:
            thread.start()
        for _ in range(int(seconds / 10.0)):
            time.sleep(10.0)
            look.say("crowd", Counter({one.kind: len(one.lives) for one in crowd}))
        stop.set()
        for thread in threads:
            thread.join()
        for one in crowd:
            lives = sorted(one.lives) or [float("nan")]
            print(f"{one.kind}: {len(one.lives)} ended, life {lives[0]:.1f} to {lives[-1]:.1f} s")
        time.sleep(15.0)
        look.say("after", Counter())
        reasons = r"(?:connection of|browser of|streams?|scenes).*"
        said = Counter(re.sub(r"\d+", "N", line) for line in re.findall(reasons, demo.text()))
        for line, number in said.most_common(12):
            print(f"{number} x {line[:110]}")


class Look:
    """Memory, processor and the good browser's messages since the last look."""

    def __init__(self, process: psutil.Process, good: Good) -> None:
        self._process, self._good = process, good
        self._at, self._messages, self._cpu = time.monotonic(), good.messages, self._spent()
        self._began = self._at

    def _spent(self) -> float:
        times = self._process.cpu_times()
        return times.user + times.system

    def say(self, when: str, ended: Counter[str]) -> None:
        now, cpu = time.monotonic(), self._spent()
        if now - self._at < 1.0:
            time.sleep(5.0)
            now, cpu = time.monotonic(), self._spent()
        took = now - self._at
        per_s = (self._good.messages - self._messages) / took
        memory = self._process.memory_info().rss / 1e6
        print(
            f"{now - self._began:4.0f} s {when}: {memory:6.1f} MB, {per_s:5.1f} messages/s,"
            f" {(cpu - self._cpu) / took:.2f} of a core, ended {dict(ended)}",
            flush=True,
        )
        self._at, self._messages, self._cpu = now, self._good.messages, cpu


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 180.0)
