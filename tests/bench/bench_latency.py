"""Serial byte to published solution at 100 Hz, through the real gateway, bus and estimator. Prints
one JSON line.

The bench writes one ACC12 frame every 10 ms into a pseudo-terminal and notes the time of the write;
it also subscribes to the products filter's estimates. Both times are of one monotonic clock.
"""

import gc
import json
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from support.stack import free_port

from firmware_protocol.codec import FLAG_SIMULATED, encode
from firmware_protocol.frames import Acc12
from gateway.virtual.board_link import PtyLink
from gyrofree.config import load
from gyrofree.demo.bench import Plan, write_configuration
from gyrofree.running.supervisor import Supervisor
from messages.bus.session import open_client, subscribe
from messages.contract import rates
from messages.contract.topics import RATE

PERIOD = 0.01  # s
WARM_UP = 1500  # samples: start, biases from standstill, compilation
COUNTED = 3000


def main() -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        link = PtyLink(folder / "board")
        plan = Plan(folder, [], "cube", "cube", free_port(), free_port())
        config = write_configuration(plan)
        supervisor = Supervisor()
        for service in ("router", "gateway", "estimator"):
            supervisor.add(service, service, "--config", str(config))
        supervisor.start()
        try:
            latencies = measure(link, load(config))
        finally:
            supervisor.stop()
            link.close()
    p50, p99 = np.percentile(latencies, [50, 99]) * 1e3
    row = {"bench": "latency", "rate_hz": 1 / PERIOD, "samples": len(latencies), "of": COUNTED}
    print(
        json.dumps(
            row
            | {
                "p50_ms": round(p50, 3),
                "p99_ms": round(p99, 3),
                "max_ms": round(max(latencies) * 1e3, 3),
            }
        )
    )


def measure(link: PtyLink, settings) -> list[float]:
    """Seconds from write to receipt, one per sample after the warm-up."""
    written: dict[int, float] = {}
    latencies: list[float] = []
    done = threading.Event()

    def on_rate(key: str, message) -> None:
        now = time.monotonic()
        indices = range(message.for_index, message.for_index + rates.count(message))
        if message.estimator == "products-ekf":
            latencies.extend(now - written[index] for index in indices if index >= WARM_UP)
        if indices[-1] >= WARM_UP + COUNTED - 1:
            done.set()

    rest = np.array(
        [0, 0, 256, 0, 0, 256, 0, 0, -256, 0, 0, -256]
    )  # counts: 1 g along +z_b in the cube's wiring
    gc.freeze()  # the bench's own collector must not stand in its figures
    generator = np.random.default_rng(1)
    with open_client(settings.bus, timeout_s=30) as session:
        subscription = subscribe(session, RATE, settings.bus.prefix, on_rate)
        start = time.monotonic()
        for index in range(WARM_UP + COUNTED):
            counts = tuple(int(value) for value in rest + generator.normal(0, 1, 12).round())
            frame = Acc12(index, round(PERIOD * 1e9), 0xF, 0, (counts,))
            data = encode(
                frame, epoch=1, seq=index, t_us=round(index * PERIOD * 1e6), flags=FLAG_SIMULATED
            )
            time.sleep(max(0.0, start + index * PERIOD - time.monotonic()))
            written[index] = time.monotonic()
            link.write(data)
        done.wait(5)
        subscription.undeclare()
    return latencies


if __name__ == "__main__":
    main()
