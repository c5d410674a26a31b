"""What bench_soak.py runs, each in a process of its own: the real parts of one service, as fast as
they can.

Every function takes a folder, the hours of data and a Value that it sets to the hours done. Time
stamps go on at the data's pace, so that whatever is kept for a time is kept for as much data; what
the machine's own clock decides is compressed. The data are twelve axes at 1000 samples/s in
messages of ten.
"""

import random
import shutil
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from support.stack import free_port

from messages.bus.session import BusSettings, Publishers, open_client, open_router
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import ACCEL, AXES, ESTIMATOR, LINK, RATE, TACHO

RATE_HZ, BATCH = 1000, 10
PER_HOUR = 3600 * RATE_HZ // BATCH  # messages of samples
KEPT_BYTES = (
    64 << 20
)  # of every journal and of a recording's file: reached within the first twentieth
LOSS = 0.001  # of the link to the recorder, in bursts of 50 messages
AHEAD = 1500  # messages that the dashboard may be behind
DEVICE = "cube"


def readings(seconds: float = 30.0) -> np.ndarray:
    """A turntable's run (n, 120), m/s^2: ten samples of twelve axes a row, with noise; it begins
    and ends at rest.
    """
    from inertial.simulation.table import TableTest

    test = TableTest(1)
    blocks = [test.block(k) for k in range(round(seconds / 10.0))]
    t_s, values = (
        np.concatenate([b.t_s for b in blocks]),
        np.concatenate([b.readings for b in blocks]),
    )
    fine = np.arange(0.0, seconds, 1.0 / RATE_HZ)
    smooth = np.stack([np.interp(fine, t_s, column) for column in values.T], axis=1)
    noise = np.random.default_rng(1).normal(0.0, 0.04, smooth.shape)
    return (smooth + noise).reshape(-1, 12 * BATCH)


def batches(hours: float, begin_ns: int) -> Iterator[tuple[int, pb.AccelBatch]]:
    """The messages of a gateway, numbered."""
    rows = readings()
    for k in range(round(hours * PER_HOUR)):
        header = pb.Header(
            device=DEVICE, run=1, epoch=1, utc_ns=begin_ns + k * 10_000_000, device_us=k * 10_000
        )
        message = pb.AccelBatch(
            header=header, first_index=k * BATCH, period_s=1.0 / RATE_HZ, axes=12
        )
        message.f_mps2[:] = rows[k % len(rows)]
        yield k, message


class Tee:
    """A bus that keeps the newest payload."""

    def __init__(self) -> None:
        self.payload = b""

    def declare_publisher(self, *_: object, **__: object) -> "Tee":
        return self

    def put(self, payload: bytes) -> None:
        self.payload = payload


def gateway(folder: Path, hours: float, done: Any) -> None:
    """Frames of a board through deframer, clock and joiner into both journals."""
    from gateway.board.device import DeviceLink
    from gateway.ports.reader import Chunk
    from gateway.settings import DeviceSettings, GatewaySettings
    from gateway.virtual.virtual_board import SIMULATED, BoardAccel, VirtualBoard
    from messages.history.journal_file import BOARD

    settings = GatewaySettings(journal=folder, journal_bytes=KEPT_BYTES, published_bytes=KEPT_BYTES)
    link = DeviceLink(DeviceSettings(name=DEVICE, port="none"), settings)
    link.out.direct(Publishers(None, "p", link.spool).put)
    link.readers = [
        SimpleNamespace(
            connected=True, message="", reconnects=0, held=0, held_at=None, silent_s=0.0
        )
    ]
    begin_ns, t_s = time.monotonic_ns(), [0.0]

    def write(data: bytes) -> bool:
        now_ns = begin_ns + round(t_s[0] * 1e9)
        link.journal.append(BOARD, data, now_ns, link.wall.utc_ns(now_ns))
        link.take(Chunk(BOARD, data, now_ns))
        return True

    port = SimpleNamespace(connected=True, write=write, read=lambda: b"")
    board = VirtualBoard(port, SIMULATED, epoch=1, sample_period_s=1.0 / RATE_HZ, batch=BATCH)
    counts = np.round(readings() / 0.0383).astype(int).reshape(-1, 12).tolist()
    for k in range(round(hours * PER_HOUR * BATCH)):
        t_s[0] = k / RATE_HZ
        board.take(BoardAccel(t_s[0], tuple(counts[k % len(counts)])))
        if k % RATE_HZ == 0:
            link.watch.look(True, begin_ns + round(t_s[0] * 1e9))
            link.out.publish(LINK, link.report.message(link.readers, 0), k * 1000)
            done.value = t_s[0] / 3600.0
    link.journal.close()
    link.spool.close()


def recorder(folder: Path, hours: float, done: Any) -> None:
    """Messages with bursts of losses through the repair into files that are rotated; closed files
    are removed.
    """
    from messages.history.spool import Spool
    from sessions.recording.intake import Intake
    from sessions.recording.settings import RecorderSettings
    from sessions.recording.store import start

    tee, chance = Tee(), random.Random(1)
    spool = Spool(folder / "spool", max_bytes=KEPT_BYTES)
    publishers, questions = Publishers(tee, "p", spool), []
    intake, settings = (
        Intake("p", questions.append, 0),
        RecorderSettings(root=folder / "s", max_file_bytes=KEPT_BYTES),
    )
    store, dead, lost = start(settings), 0, 0
    begin_ns = time.time_ns()

    def write(key: str) -> None:
        for entry in intake.take(time.time_ns(), key, tee.payload):
            store.add(*entry)
        while questions:
            question = questions.pop()
            intake.answered(question, spool.answer(question.query, DEVICE))
            for entry in intake.answers():
                store.add(*entry)

    for k, message in batches(hours, begin_ns):
        publishers.put(ACCEL, DEVICE, message)
        if not dead and chance.random() < LOSS / 50:
            dead = 50
        dead = max(0, dead - 1)
        if not dead:
            write(f"p/{DEVICE}/accel")
        if k % 5 == 0:
            header = pb.Header(device=DEVICE, run=1, epoch=1, utc_ns=message.header.utc_ns)
            publishers.put(TACHO, DEVICE, pb.TachoRate(header=header, omega_radps=1.0, pulses=k))
            write(f"p/{DEVICE}/tacho")
        if k % 40 == 0:
            store.flush()
            done.value = k / PER_HOUR
        if store.size > KEPT_BYTES:
            store.close()
            lost += sum(store.lost().values())
            old, store = store, start(settings, continues=store.manifest.id)
            shutil.rmtree(old.folder)
    if lost + sum(store.lost().values()):
        raise SystemExit("the recorder lost messages that the spool has")
    store.close()
    spool.close()


def estimator(folder: Path, hours: float, done: Any) -> None:
    """The default estimators, their saved state and their journal."""
    from estimator.pipeline import Pipeline
    from estimator.saved_state import SavedState
    from estimator.settings import EstimatorSettings
    from estimator.worker import Worker
    from messages.history.mending_state import Arrival
    from messages.history.spool import Spool

    settings = EstimatorSettings(journal=folder)
    spool = Spool(folder, max_bytes=KEPT_BYTES)
    publishers, saved = Publishers(None, "p", spool), SavedState(folder, settings, "soak")
    worker = Worker(
        Pipeline(settings),
        lambda out: publishers.put(out.topic, out.device, out.message, out.estimator),
        save=lambda worker: saved.save(worker, publishers),
    )
    for k, message in batches(hours, time.time_ns()):
        message.header.sequence = k + 1
        for arrival in worker.mender.take(
            Arrival(ACCEL, DEVICE, "", message.SerializeToString(), 0)
        ):
            worker._handle(arrival)
        if k % 100 == 0:
            worker._keep()
            done.value = k / PER_HOUR
    spool.close()


def dashboard(bus: BusSettings, hours: float, done: Any, taken: Any) -> None:
    """The scene's server, its feed and its store, on a real router."""
    from dashboard.data.feed import Feed
    from dashboard.data.store import Store
    from dashboard.desk import Desk
    from dashboard.scene.service import start

    store, watched = Store(), threading.Event()
    with open_client(bus, timeout_s=60.0) as session:
        handle = start(SimpleNamespace(viser_port=0), store, Desk(session, bus.prefix), watched)
        watched.set()
        feed = Feed(session, bus.prefix, store, watched)
        while done.value < 0.9999 * hours:
            time.sleep(0.01)
            taken.value = feed.taken
            device = store.device(DEVICE)
            done.value = max(done.value, 0.0 if device is None else device.t_newest / 3600.0)
        handle.stop()
        feed.stop()


def router(bus: BusSettings) -> None:
    """The bus."""
    with open_router(bus):
        threading.Event().wait()


def talk(bus: BusSettings, hours: float, taken: Any) -> None:
    """What gateway and estimator say to a dashboard; as fast as that can take it."""
    session = open_client(bus, timeout_s=60.0)
    publishers = Publishers(session, bus.prefix)
    while not taken.value:  # until somebody listens
        publishers.put(LINK, DEVICE, pb.LinkStatus(header=pb.Header(device=DEVICE)))
        time.sleep(0.1)
    time.sleep(1.0)
    sent, patience = taken.value, 0
    for k, message in batches(hours, time.time_ns()):
        said = [(ACCEL, "", message)]
        for name in ("products-ekf", "least-squares"):
            rate = pb.RateBatch(
                header=message.header, estimator=name, omega_ib_b_radps=[0.0, 0.1, 1.0]
            )
            rate.omega_covariance[:], rate.f_b_mps2[:], rate.q_nb[:] = (
                [1e-4] * 9,
                [0.0, 0.0, 9.8],
                [1.0, 0.0, 0.0, 0.0],
            )
            said.append((RATE, name, rate))
            if k % 100 == 0:
                said.append(
                    (
                        ESTIMATOR,
                        name,
                        pb.EstimatorStatus(header=message.header, estimator=name, samples=k),
                    )
                )
        if k % 5 == 0:
            said.append((TACHO, "", pb.TachoRate(header=message.header, omega_radps=1.0, pulses=k)))
        if k % 25 == 0:
            said.append((AXES, "", pb.AxisHealth(header=message.header, dof=6)))
        if k % 100 == 0:
            said.append(
                (LINK, "", pb.LinkStatus(header=message.header, connected=True, good_frames=k))
            )
        for topic, name, one in said:
            publishers.put(topic, DEVICE, one, name)
        sent += len(said)
        while sent - taken.value > AHEAD:
            time.sleep(0.002)
            patience += 1
            if patience > 2000:  # the bus has dropped some
                sent, patience = taken.value, 0
    time.sleep(5.0)
    session.close()


def bus_of() -> BusSettings:
    """A bus on a free port."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    return BusSettings(router=endpoint, listen=[endpoint])
