"""What comes from outside, a hundred thousand times: does a service end, does its memory grow?

frames      frames with a good CRC and any values among those of a good board, through a DeviceLink
story       frames that go on from each other, with any values
recorder    messages on every key of the bus, through the recorder into a file
estimator   the same, through door, queue and pipeline
dashboard   the same, through the feed into the store
check       cost of the contract's check, us per message of a kind

One JSON line each: how many, seconds, what was refused, resident memory in MB after a tenth of them
and at the end. Usage: python tests/bench/bench_fuzz.py [count] [part ...]
"""

import ctypes
import json
import logging
import random
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent.parent))

from gateway.board.device import DeviceLink  # noqa: E402
from gateway.ports.reader import Chunk  # noqa: E402
from gateway.settings import DeviceSettings, GatewaySettings  # noqa: E402
from messages.bus.session import BusSettings, open_client, open_router  # noqa: E402
from messages.contract import gyrofree_pb2 as pb  # noqa: E402
from messages.contract.checks import MESSAGE_BYTES, check  # noqa: E402
from messages.history.journal_file import BOARD  # noqa: E402
from tests.support import hostile_bus, hostile_frames  # noqa: E402

SEED = 20_260_101


def resident_mb() -> float:
    """Memory of this process."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return round(pages * 4096 / 1e6, 1)


def run(part: str, items: Iterator, count: int, take: Callable, **end: Callable) -> None:
    """Give all items to `take`; say what it came to."""
    began, early = time.monotonic(), 0.0
    for n, item in enumerate(items):
        take(n, item)
        if n == count // 10:
            early = resident_mb()
    values = {name: value() for name, value in end.items()}
    seconds = round(time.monotonic() - began, 1)
    memory = {"mb_after_a_tenth": early, "mb_at_the_end": resident_mb()}
    print(json.dumps({"part": part, "count": count, "s": seconds} | memory | values), flush=True)


def link(folder: Path, items: Iterator[bytes], part: str, count: int) -> None:
    settings = GatewaySettings(journal=folder, journal_bytes=1 << 24, published_bytes=1 << 24)
    board = DeviceLink(DeviceSettings(name="cube", port="file:///none"), settings)
    sent = [0]

    def put(topic, device, message) -> None:
        sent[0] += 1
        header = message.header if "header" in message.DESCRIPTOR.fields_by_name else pb.Header()
        payload = message.SerializeToString()
        board.spool.append(topic.name, device, header.run, sent[0], header.utc_ns, payload)

    board.out.direct(put)
    rng, at_ns = random.Random(SEED), [time.monotonic_ns()]

    def take(n: int, data: bytes) -> None:
        at_ns[0] += rng.choice((0, 1_000_000, 20_000_000))
        board.take(Chunk(BOARD, data, at_ns[0]))

    run(part, items, count, take, refused=board.door.counts, published=lambda: sent[0])
    board.journal.close()
    board.spool.close()


def frames(count: int, folder: Path) -> None:
    """Any frames among those of a good board."""
    link(folder, (data for data, _ in hostile_frames.mixed(SEED, count)), "frames", count)


def story(count: int, folder: Path) -> None:
    """Any values in frames that go on from each other."""
    link(folder, hostile_frames.story(SEED, count), "story", count)


def recorder(count: int, folder: Path) -> None:
    """Any messages into a file."""
    from sessions.recording.recorder import Recorder
    from sessions.recording.settings import RecorderSettings

    one = Recorder(RecorderSettings(root=folder, auto_start=True), BusSettings(prefix="t"))
    one.step()

    def take(n: int, item: tuple[str, bytes]) -> None:
        if len(item[1]) > MESSAGE_BYTES:  # as on_sample does, before it takes a copy
            one._door.too_large(item[0], len(item[1]))
        else:
            one._inbox.append((time.time_ns(), *item))
        if n % 100 == 0:
            one.step()

    def refused() -> dict[str, int]:
        one.step()
        found = dict(one.status().refused)
        one.close()
        return found

    items = hostile_bus.messages(SEED, count)
    run("recorder", items, count, take, refused=refused, recorded=lambda: one.status().messages)


def estimator(count: int, folder: Path) -> None:
    """Any messages into the estimators."""
    from estimator.pipeline import Pipeline
    from estimator.settings import EstimatorSettings
    from estimator.worker import Worker
    from messages.contract.topics import PIPELINE_INPUTS
    from messages.history.mending_state import Arrival

    said = [0]

    def put(output) -> None:
        said[0] += 1

    worker = Worker(Pipeline(EstimatorSettings(cards=folder, axes=folder)), put)
    stop = threading.Event()
    thread = threading.Thread(target=worker.work, args=(stop,))
    thread.start()

    def take(n: int, item: tuple[str, bytes]) -> None:
        if n % 20 == 0:  # a good board among them
            give("t/table/accel", at_rest(n // 20).SerializeToString())
        give(*item)

    def give(key: str, payload: bytes) -> None:
        address = worker.door.address(key)
        if address is not None and worker.door.admit(key, address, len(payload)):
            if address.topic in PIPELINE_INPUTS:
                worker.offer(Arrival(address.topic, address.device, "", payload, 0))

    def refused() -> dict[str, int]:
        worker.finish()
        thread.join()
        return worker.door.counts()

    items = hostile_bus.messages(SEED, count)
    failed = {"failed": lambda: repr(worker.failure), "said": lambda: said[0]}
    run("estimator", items, count, take, refused=refused, **failed)


def at_rest(k: int) -> pb.AccelBatch:
    """The k-th batch of a cube that lies still, two samples each."""
    header = pb.Header(device="table", sequence=k + 1, device_us=20_000 * k, run=7)
    header.utc_ns = hostile_bus.UTC_NS + 20_000_000 * k
    force = [0.01 * ((7 * k + axis) % 5 - 2) - 9.81 * (axis % 3 == 2) for axis in range(24)]
    return pb.AccelBatch(header=header, first_index=2 * k, period_s=0.01, axes=12, f_mps2=force)


def dashboard(count: int, folder: Path) -> None:
    """Any messages over a real router into the store."""
    from dashboard.data.feed import Feed
    from dashboard.data.store import Store

    endpoint = "tcp/127.0.0.1:17447"
    bus = BusSettings(prefix="t", router=endpoint, listen=[endpoint])
    with open_router(bus), open_client(bus) as session:
        watched = threading.Event()
        watched.set()
        store = Store()
        feed = Feed(session, "t", store, watched)

        def take(n: int, item: tuple[str, bytes]) -> None:
            while len(feed._queue) > 1000:
                time.sleep(0.001)
            feed._queue.append((*item, time.monotonic()))

        def refused() -> dict[str, int]:
            while feed._queue:
                time.sleep(0.01)
            return store.door.counts()

        def rings_mb() -> float:
            return round(sum(device.nbytes for device in store.devices.values()) / 1e6, 1)

        alive = {"alive": lambda: feed._thread.is_alive(), "rings_mb": rings_mb}
        items = hostile_bus.messages(SEED, count)
        run("dashboard", items, count, take, refused=refused, **alive)
        feed.stop()


def cost(count: int, folder: Path) -> None:
    """Of the check itself; parsing beside it, for comparison."""
    header = pb.Header(device="cube", sequence=5, epoch=1, device_us=1, utc_ns=17 * 10**17, run=7)
    kinds = {
        f"accel of {n}": pb.AccelBatch(
            header=header, period_s=0.01, axes=12, counts=[5] * 12 * n, f_mps2=[1.2] * 12 * n
        )
        for n in (1, 2, 10)
    }
    kinds["imu of 1"] = pb.ImuBatch(
        header=header, period_s=0.01, f_b_mps2=[9.8] * 3, omega_ib_b_radps=[0.1] * 3
    )
    kinds["tacho"] = pb.TachoRate(header=header, omega_radps=1.0, sigma_radps=0.1)
    for name, message in kinds.items():
        payload = message.SerializeToString()
        work = {"check": lambda m=message: check(m)}
        work["parse"] = lambda p=payload, kind=type(message): kind.FromString(p)
        found = {}
        for what, step in work.items():
            best = float("inf")
            for _ in range(7):
                began = time.process_time_ns()
                for _ in range(5000):
                    step()
                best = min(best, (time.process_time_ns() - began) / 5e6)
            found[f"{what}_us"] = round(best, 2)
        print(json.dumps({"part": "check", "message": name} | found), flush=True)


PARTS = {
    "frames": frames,
    "story": story,
    "recorder": recorder,
    "estimator": estimator,
    "dashboard": dashboard,
    "check": cost,
}


def main() -> None:
    """All parts, or those that are named."""
    logging.disable(logging.ERROR)
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 100_000
    for part in sys.argv[2:] or PARTS:
        with tempfile.TemporaryDirectory() as folder:
            PARTS[part](count, Path(folder))


def give_back_at_once() -> None:
    """Messages of 100 MB are made here, in the process that is measured: what glibc keeps of them
    when they are freed, up to 64 MB, would be taken for the service's.
    """
    m_mmap_threshold = -3  # malloc.h
    ctypes.CDLL(None).mallopt(m_mmap_threshold, 1 << 20)


if __name__ == "__main__":
    give_back_at_once()
    main()
