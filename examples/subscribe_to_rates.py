"""Subscribe to the rates of a cube on the bus, as another program would.

Shown: a client of the Zenoh router takes the messages of topic `rate/<estimator>`, whose repeated
fields hold a row per sample, and prints what two estimators say. With the address of a router it
listens to what is there, a running `gyrofree demo` for example. Without one it starts everything
itself, in this process: a router, the estimator service and a simulated cube on its table.

    python examples/subscribe_to_rates.py [tcp/HOST:PORT]
"""

import queue
import socket
import sys
import threading
import time
from itertools import islice

import numpy as np

from estimator import service
from estimator.settings import EstimatorSettings
from inertial.simulation.table import TableTest
from messages.bus.session import BusSettings, Publishers, open_client, open_router, subscribe
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import ACCEL, RATE

BATCH, PERIOD_S, COUNT_MPS2 = 10, 0.01, 0.0039 * 9.80665
SECONDS, SPEED = 10.0, 4.0  # of the simulated test, and how many of its seconds in one


def play_board(bus: BusSettings) -> None:
    """Publish what a gateway would publish of a cube on its table: still 5 s, then turning."""
    test = islice(TableTest(seed=3), round(SECONDS / PERIOD_S))
    with open_client(bus) as session:
        with session.declare_publisher(ACCEL.key(bus.prefix, "cube")) as probe:
            while not probe.matching_status.matching:  # nobody listens yet
                time.sleep(0.05)
        publishers = Publishers(session, bus.prefix)
        begin_ns, run = time.time_ns(), time.time_ns()
        for number in range(round(SECONDS / PERIOD_S / BATCH)):
            rows = np.array([sample.counts for sample in islice(test, BATCH)])
            batch = pb.AccelBatch(first_index=number * BATCH, period_s=PERIOD_S, axes=12)
            batch.counts.extend(rows.ravel().tolist())
            batch.f_mps2.extend((rows * COUNT_MPS2).ravel().tolist())
            batch.header.device, batch.header.epoch, batch.header.run = "cube", 1, run
            batch.header.source = pb.SOURCE_SIMULATED
            batch.header.device_us = round(number * BATCH * PERIOD_S * 1e6)
            batch.header.utc_ns = begin_ns + batch.header.device_us * 1000
            publishers.put(ACCEL, "cube", batch)
            time.sleep(BATCH * PERIOD_S / SPEED)


def listen(bus: BusSettings, until: threading.Event) -> dict[str, np.ndarray]:
    """Rates (n, 3), rad/s, of b against inertial, by estimator; ends when `until` is set."""
    arrived: queue.Queue = queue.Queue()
    rates: dict[str, list[np.ndarray]] = {}
    with open_client(bus) as session:
        subscriber = subscribe(session, RATE, bus.prefix, lambda key, m: arrived.put(m))
        while not until.is_set() or not arrived.empty():
            try:
                message = arrived.get(timeout=0.2)
            except queue.Empty:
                continue
            omega_b = np.array(message.omega_ib_b_radps).reshape(-1, 3)
            rates.setdefault(message.estimator, []).append(omega_b)
            if len(rates[message.estimator]) % 20 == 0:
                x, y, z = np.degrees(omega_b[-1])
                print(f"{message.estimator:14} {x:8.2f} {y:8.2f} {z:8.2f} deg/s", flush=True)
        subscriber.undeclare()
    return {name: np.concatenate(parts) for name, parts in rates.items()}


def main(router: str = "") -> dict[str, np.ndarray]:
    """What `listen` has heard; of a router that runs already, for 30 s."""
    stop, done = threading.Event(), threading.Event()
    if router:
        threading.Timer(30.0, done.set).start()
        return listen(BusSettings(router=router), done)
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        address = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
    bus = BusSettings(router=address, listen=[address])
    settings = EstimatorSettings(navigators=[], journal=None)
    with open_router(bus):
        estimator = threading.Thread(target=service.run, args=(settings, bus, stop))
        estimator.start()
        threading.Thread(target=lambda: (play_board(bus), done.set())).start()
        rates = listen(bus, done)
        stop.set()
        estimator.join()
    for name, omega_b in rates.items():
        print(f"{name}: {len(omega_b)} rates, in the end {np.degrees(omega_b[-1, 2]):.0f} deg/s")
    return rates


if __name__ == "__main__":
    main(*sys.argv[1:2])
