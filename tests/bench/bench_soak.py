"""Hours of a board at 1 kHz, compressed in time: does the memory of recorder and gateway stay flat?

    python tests/bench/bench_soak.py [hours, default 8] [fraction of the link lost in bursts, default 0.001]

Messages of ten twelve-axis samples go through the gateway's spool, the recorder's intake with repair from that spool,
and the recorder's store with rotation, as fast as they can. Resident memory is read after the first tenth, when all
buffers are full, and at the end.
"""

import json
import random
import sys
import tempfile
import time
from pathlib import Path

import psutil

ROOT = Path(__file__).resolve().parent.parent.parent
sys.path[:0] = [str(ROOT)]

from messages import gyrofree_pb2 as pb  # noqa: E402
from messages.bus import Publishers  # noqa: E402
from messages.spool import Spool  # noqa: E402
from messages.topics import ACCEL  # noqa: E402
from sessions.intake import Intake  # noqa: E402
from sessions.settings import RecorderSettings  # noqa: E402
from sessions.store import SessionStore, start  # noqa: E402

BATCH, PER_HOUR = 10, 360_000  # samples a message, messages an hour
FILE_BYTES = 64 << 20


class Tee:
    """A session that publishes nothing but hands the payload on."""

    def __init__(self) -> None:
        self.payload = b""

    def declare_publisher(self, *_: object, **__: object) -> "Tee":
        return self

    def put(self, payload: bytes) -> None:
        self.payload = payload


def main(hours: float = 8.0, loss: float = 0.001) -> None:
    """Run and print."""
    with tempfile.TemporaryDirectory() as name:
        folder, tee, chance = Path(name), Tee(), random.Random(1)
        spool = Spool(folder / "spool", max_bytes=64 << 20)
        publishers, questions = Publishers(tee, "p", spool), []
        intake = Intake("p", questions.append, 0)
        settings = RecorderSettings(root=folder / "sessions", max_file_bytes=FILE_BYTES)
        store: SessionStore = start(settings)
        process, total, first, dead, lost = psutil.Process(), round(hours * PER_HOUR), 0.0, 0, 0
        begun, sessions = time.monotonic(), 1
        for k in range(total):
            counts = [(k + j) % 200 for j in range(12 * BATCH)]
            header = pb.Header(device="cube", run=1, epoch=1, utc_ns=time.time_ns(), device_us=k * 10_000)
            publishers.put(ACCEL, "cube", pb.AccelBatch(header=header, axes=12, counts=counts, period_s=1e-3))
            if not dead and chance.random() < loss / 50:
                dead = 50  # messages of a burst
            if dead:
                dead, lost = dead - 1, lost + 1
                continue
            for entry in intake.take(time.time_ns(), "p/cube/accel", tee.payload):
                store.add(*entry)
            while questions:
                question = questions.pop()
                intake.answered(question, spool.answer(question.query, "cube"))
                for entry in intake.answers():
                    store.add(*entry)
            if k % 40 == 0:
                store.flush()
            if store.size > FILE_BYTES:
                store.close()
                store, sessions = start(settings, continues=store.manifest.id), sessions + 1
            if k == total // 10:
                first = process.memory_info().rss / 1e6
        last, missing = process.memory_info().rss / 1e6, sum(store.lost().values())
        store.close()
        spool.close()
    passed = time.monotonic() - begun
    more = {"hours": hours, "after_a_tenth_MB": round(first, 1), "at_the_end_MB": round(last, 1)}
    figure = {"name": "soak_memory_growth", "value": round(last - first, 1), "unit": "MB", "target": 0.0}
    print(json.dumps(figure | more | {"compression": round(3600 * hours / passed), "sessions": sessions}))
    print(json.dumps({"name": "soak_lost_on_the_link", "value": lost, "unit": "messages", "lost_in_file": missing}))


if __name__ == "__main__":
    main(*(float(word) for word in sys.argv[1:3]))
