"""Many boards on one estimator: how late it gets, what it leaves out, and what it says of that.

    python tests/bench/bench_boards.py [boards, default 60] [seconds, default 60] [Hz, default 100]
        [share of a core for the estimator, default all]

Cubes on a table, batches of 50 ms, published by a process of their own over a real router to the
estimator service as it runs by default, with its journal. A share of a core is held by stopping the
estimator for the rest of every 50 ms. Lateness is measured here, from the time in the header of an
estimate to its arrival; what the estimator says of itself stands beside it. Wanted: at most 6 s
late, however many boards there are.
"""

import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

sys.path[:0] = [
    str(Path(__file__).resolve().parent.parent),
    str(Path(__file__).resolve().parent.parent.parent),
]

from support.stack import free_port  # noqa: E402

from inertial.simulation.table import TableTest  # noqa: E402
from messages.bus.session import BusSettings, Publishers, open_client, open_router  # noqa: E402
from messages.contract import gyrofree_pb2 as pb  # noqa: E402
from messages.contract.topics import ACCEL, parse  # noqa: E402

ROOT = Path(__file__).resolve().parent.parent.parent
BATCH_S = 0.05
WANTED_S = 6.0
SLICE_S = 0.05  # of the estimator's processor, where it gets a share
ESTIMATOR = """
import logging, sys
from pathlib import Path
from estimator import service
from estimator.settings import EstimatorSettings
from gyrofree.running.process import stop_on_signals
from messages.bus.session import BusSettings
logging.basicConfig(level="WARNING", stream=sys.stderr)
bus = BusSettings(prefix="t", router=sys.argv[2])
service.run(EstimatorSettings(journal=Path(sys.argv[1])), bus, stop_on_signals())
"""


def publish(router: str, boards: int, seconds: float, hz: float) -> None:
    """The boards: real time, each batch when its last sample is there."""
    size, test = max(1, round(BATCH_S * hz)), TableTest(1)
    rows = [row for k in range(30) for row in test.block(k).readings.tolist()]
    session = open_client(BusSettings(prefix="t", router=router), timeout_s=30.0)
    publishers, began = Publishers(session, "t"), time.time()
    for k in range(round(seconds * hz / size)):
        time.sleep(max(0.0, began + (k + 1) * size / hz - time.time()))
        readings = [a for i in range(size) for a in rows[(k * size + i) % len(rows)]]
        for board in range(boards):
            header = pb.Header(
                device=f"cube-{board:03d}",
                epoch=1,
                device_us=round(k * size / hz * 1e6),
                utc_ns=round((began + k * size / hz) * 1e9),
                source=pb.SOURCE_SIMULATED,
                run=round(began * 1e9),
            )
            message = pb.AccelBatch(
                header=header, first_index=k * size, period_s=1.0 / hz, axes=12, f_mps2=readings
            )
            publishers.put(ACCEL, header.device, message)
    session.close()


class Watch:
    """What comes from the estimator."""

    def __init__(self) -> None:
        self.late_s: list[float] = []
        self.newest: dict[str, float] = {}  # by device: how late its newest estimate was
        self.status: dict[str, pb.EstimatorStatus] = {}
        self.behind_s = 0.0

    def on(self, sample) -> None:
        """Zenoh's thread."""
        address = parse(str(sample.key_expr))
        if address.topic.name == "rate":
            header = pb.RateBatch.FromString(sample.payload.to_bytes()).header
            late_s = time.time() - header.utc_ns * 1e-9 - BATCH_S
            self.late_s.append(late_s)
            self.newest[address.device] = late_s
        elif address.topic.name == "estimator":
            status = pb.EstimatorStatus.FromString(sample.payload.to_bytes())
            self.status[address.device] = status
            self.behind_s = max(self.behind_s, status.behind_s)


def hold(pid: int, share: float, stop: threading.Event) -> None:
    """Give a process a share of the time."""
    while not stop.wait(share * SLICE_S):
        os.kill(pid, signal.SIGSTOP)
        stop.wait((1.0 - share) * SLICE_S)
        os.kill(pid, signal.SIGCONT)


def main(boards: int = 60, seconds: float = 60.0, hz: float = 100.0, share: float = 1.0) -> None:
    """Run and print."""
    endpoint, watch, stop = f"tcp/127.0.0.1:{free_port()}", Watch(), threading.Event()
    bus = BusSettings(prefix="t", router=endpoint, listen=[endpoint])
    with tempfile.TemporaryDirectory() as folder, open_router(bus), open_client(bus) as session:
        subscriber = session.declare_subscriber("t/*/*/*", watch.on)
        with subprocess.Popen([sys.executable, "-c", ESTIMATOR, folder, endpoint], cwd=ROOT) as one:
            time.sleep(5.0)
            code = f"from tests.bench.bench_boards import publish; publish({endpoint!r}, {boards}, "
            code += f"{seconds}, {hz})"
            holder = threading.Thread(target=hold, args=(one.pid, share, stop))
            with subprocess.Popen([sys.executable, "-c", code], cwd=ROOT) as feeder:
                if share < 1.0:
                    holder.start()
                feeder.wait()
            time.sleep(2.0)
            stop.set()
            if share < 1.0:
                holder.join()
            used = Path(f"/proc/{one.pid}/stat").read_text().rpartition(")")[2].split()
            one.terminate()
        subscriber.undeclare()
    ticks = (int(used[11]) + int(used[12])) / os.sysconf("SC_CLK_TCK")
    statuses = list(watch.status.values())
    print(
        json.dumps(
            {
                "bench": "boards",
                "boards": boards,
                "hz": hz,
                "share": share,
                "cpu_s_per_s": round(ticks / seconds, 2),
                "messages": len(watch.late_s),
                "latest_s": round(max(watch.late_s, default=-1.0), 2),
                "late_at_end_s": round(max(watch.newest.values(), default=-1.0), 2),
                "said_behind_s": round(watch.behind_s, 2),
                "devices_heard": len(watch.newest),
                "sparse_devices": sum(s.limit_hz > 0.0 for s in statuses),
                "passed_over_s": round(sum(s.skipped_s for s in statuses), 1),
                "missing_samples": sum(s.missing_samples for s in statuses),
                "wanted_latest_s": WANTED_S,
                "load": round(os.getloadavg()[0], 1),
            }
        ),
        flush=True,
    )


if __name__ == "__main__":
    main(
        *(kind(word) for kind, word in zip((int, float, float, float), sys.argv[1:], strict=False))
    )
