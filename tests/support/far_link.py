"""Two places joined by a slow, lossy link that can be cut: for tests and benches from afar.

Each place is a network namespace with one TUN device; this process carries the packets of IP
between the two, with a rate, a queue of so many bytes, a delay and a loss. Kernels without netem
do as well. Whatever runs at a place sees nothing but a network:

    with far_link(Line(rate=1e6, delay_s=0.1, loss=0.05)) as link:
        link.a.popen(["gyrofree", "up"], cwd=lab)
        link.cut()
"""

import contextlib
import fcntl
import heapq
import os
import random
import select
import shutil
import struct
import subprocess
import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

TUNSETIFF, IFF_TUN, IFF_NO_PI = 0x400454CA, 0x0001, 0x1000  # linux/if_tun.h
DEVICE = "far0"
MTU = 1500  # bytes


class NoNamespaces(OSError):
    """This machine makes no network namespaces for us, and why."""


@dataclass(frozen=True)
class Line:
    """What the link does to packets, the same in both directions."""

    rate: float = 0.0  # bit/s; 0: without limit
    delay_s: float = 0.0  # one way
    loss: float = 0.0  # of all packets, after they had their time on the line
    queue: int = 64_000  # bytes that wait for their time; more is dropped


FAR = Line(rate=1e6, delay_s=0.1, loss=0.05)  # 200 ms there and back


@dataclass
class Direction:
    """Packets that go one way, and what became of those that went."""

    sink: int  # descriptor they are written to
    random: random.Random
    carried: int = 0  # packets
    carried_bytes: int = 0
    lost: int = 0
    full: int = 0  # dropped, as the queue was
    cut: int = 0  # dropped, as the link was
    free_at: float = 0.0  # s, monotonic: when the line has sent what waits
    flying: list[tuple[float, int, bytes]] = field(default_factory=list)


class Place:
    """One end: a network of its own, with a loopback and the way to the other end."""

    def __init__(self, address: str, peer: str) -> None:
        """Raises NoNamespaces."""
        self.address, self._peer = address, peer
        # it ends with our end of its pipe, also when we are killed
        self._holder = subprocess.Popen(
            ["unshare", "--net", "sh", "-c", "echo ready; cat"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        if self._holder.stdout.readline() != "ready\n":
            raise NoNamespaces(f"unshare --net: {self._holder.stderr.read().strip()}")
        name = f"far{self._holder.pid}"
        self.tun = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
        try:
            fcntl.ioctl(
                self.tun, TUNSETIFF, struct.pack("16sH", name.encode(), IFF_TUN | IFF_NO_PI)
            )
            _ip("link", "set", name, "netns", str(self._holder.pid), "name", DEVICE)
            for words in (
                ("link", "set", "lo", "up"),
                ("addr", "add", address, "peer", peer, "dev", DEVICE),
                ("link", "set", DEVICE, "addrgenmode", "none"),  # no packets but those sent
                ("link", "set", DEVICE, "mtu", str(MTU), "up"),
            ):
                self.run(["ip", *words])
        except (OSError, subprocess.CalledProcessError) as error:
            self.close()
            raise NoNamespaces(f"{name}: {error}") from None

    def command(self, words: Sequence[str]) -> list[str]:
        """The same command, to be run here."""
        return ["nsenter", f"--net=/proc/{self._holder.pid}/ns/net", "--", *map(str, words)]

    def run(self, words: Sequence[str], **options) -> subprocess.CompletedProcess:
        """Run it here to its end; raises CalledProcessError with what it said."""
        options = {"check": True, "capture_output": True, "text": True} | options
        return subprocess.run(self.command(words), **options)

    def popen(self, words: Sequence[str], **options) -> subprocess.Popen:
        """Begin it here; the process is nsenter's, which becomes the command."""
        return subprocess.Popen(self.command(words), **options)

    def congestion(self, name: str) -> None:
        """How TCP takes losses on its way to the other end: "cubic" is what most machines have."""
        self.run(["ip", "route", "replace", self._peer, "dev", DEVICE, "congctl", name])

    def sysctl(self, name: str, value: str) -> None:
        """Set a setting of this network, "net.ipv4.tcp_syn_retries"."""
        path = "/proc/sys/" + name.replace(".", "/")
        self.run(["sh", "-c", f"echo {value} > {path}"])

    def close(self) -> None:
        """End the network; what still runs here has the loopback alone."""
        os.close(self.tun)
        self._holder.stdin.close()
        self._holder.wait(5.0)


class FarLink:
    """Carries packets between two places until it is closed."""

    def __init__(self, a: Place, b: Place, line: Line, seed: int) -> None:
        self.a, self.b, self.line = a, b, line
        self.there = Direction(b.tun, random.Random(seed))
        self.back = Direction(a.tun, random.Random(seed + 1))
        self._count = 0
        self._is_cut = threading.Event()
        self._wake, self._waker = os.pipe()
        self._thread = threading.Thread(target=self._carry, name="far link", daemon=True)
        self._thread.start()

    def cut(self) -> None:
        """Drop everything from now on, what is under way too."""
        self._is_cut.set()

    def mend(self) -> None:
        """Carry again."""
        self._is_cut.clear()

    def close(self) -> None:
        """Carry no more."""
        os.write(self._waker, b".")
        self._thread.join(5.0)
        os.close(self._wake)
        os.close(self._waker)

    def _carry(self) -> None:
        ways = {self.a.tun: self.there, self.b.tun: self.back}
        while True:
            due = min((way.flying[0][0] for way in ways.values() if way.flying), default=None)
            patience = None if due is None else max(0.0, due - time.monotonic())
            ready, _, _ = select.select([*ways, self._wake], [], [], patience)
            if self._wake in ready:
                return
            for descriptor in ready:
                with contextlib.suppress(BlockingIOError):
                    while packet := os.read(descriptor, 1 << 16):
                        self._take(ways[descriptor], packet)
            for way in ways.values():
                self._deliver(way)

    def _take(self, way: Direction, packet: bytes) -> None:
        now, line = time.monotonic(), self.line
        if self._is_cut.is_set():
            way.cut += 1
            return
        begin = max(now, way.free_at)
        if line.rate and (begin - now) * line.rate / 8 + len(packet) > line.queue:
            way.full += 1
            return
        way.free_at = begin + (8 * len(packet) / line.rate if line.rate else 0.0)
        if way.random.random() < line.loss:
            way.lost += 1
            return
        self._count += 1  # two packets are never compared
        heapq.heappush(way.flying, (way.free_at + line.delay_s, self._count, packet))

    def _deliver(self, way: Direction) -> None:
        now = time.monotonic()
        while way.flying and (self._is_cut.is_set() or way.flying[0][0] <= now):
            packet = heapq.heappop(way.flying)[2]
            if self._is_cut.is_set():
                way.cut += 1
                continue
            with contextlib.suppress(BlockingIOError):
                os.write(way.sink, packet)
                way.carried += 1
                way.carried_bytes += len(packet)


@contextlib.contextmanager
def far_link(line: Line = FAR, seed: int = 1) -> Iterator[FarLink]:
    """Two places, 10.77.0.1 and 10.77.0.2, and the link between them. Raises NoNamespaces."""
    for tool in ("unshare", "nsenter", "ip"):
        if shutil.which(tool) is None:
            raise NoNamespaces(f"{tool} is not there: install util-linux and iproute2")
    if os.geteuid() or not os.path.exists("/dev/net/tun"):
        raise NoNamespaces("want root and /dev/net/tun")
    with contextlib.ExitStack() as stack:
        a = Place("10.77.0.1", "10.77.0.2")
        stack.callback(a.close)
        b = Place("10.77.0.2", "10.77.0.1")
        stack.callback(b.close)
        link = FarLink(a, b, line, seed)
        stack.callback(link.close)
        yield link


def _ip(*words: str) -> None:
    done = subprocess.run(["ip", *words], capture_output=True, text=True)
    if done.returncode:
        raise NoNamespaces(f"ip {' '.join(words)}: {done.stderr.strip()}")
