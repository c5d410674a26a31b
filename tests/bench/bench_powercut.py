"""Power cut at random moments: how much of recording and journal a disk has that kept only what
fdatasync covered.

    python tests/bench/bench_powercut.py [trials, default 10] [seed]

A recorder's store and a gateway's spool are fed twelve axes at 1000 samples/s in real time. At a
random moment a file is copied as a disk would have it that lost everything after the last
*completed* fdatasync (the size when that call began), which is the worst that a disk that honours
flushes can do. The copies are then recovered like after any crash.
"""

import json
import os
import random
import shutil
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
sys.path[:0] = [str(ROOT)]

from messages.bus.session import Publishers  # noqa: E402
from messages.contract import gyrofree_pb2 as pb  # noqa: E402
from messages.contract.topics import ACCEL  # noqa: E402
from messages.history.journal_file import scan  # noqa: E402
from messages.history.spool import Spool  # noqa: E402
from sessions.recording.manifest import RECORDING  # noqa: E402
from sessions.recording.recover import salvage  # noqa: E402
from sessions.recording.settings import RecorderSettings  # noqa: E402
from sessions.recording.store import start  # noqa: E402

PERIOD_S, BATCH = 0.001, 10
safe: dict[str, int] = {}  # path -> bytes that a completed fdatasync covered
_fdatasync = os.fdatasync


def fdatasync(fd: int) -> None:
    """The real call, and what it made safe."""
    path, size = os.readlink(f"/proc/self/fd/{fd}"), os.fstat(fd).st_size
    _fdatasync(fd)
    safe[path] = max(size, safe.get(path, 0))


def survivor(path: Path, folder: Path) -> Path:
    """The file as the disk has it after the cut."""
    copy = folder / path.name
    shutil.copyfile(path, copy)
    os.truncate(copy, safe.get(str(path), 0))
    return copy


def trial(folder: Path, seconds: float) -> tuple[float, float]:
    """Seconds lost of the recording and of the spool by a cut after `seconds`."""
    safe.clear()
    settings = RecorderSettings(root=folder / "sessions")
    store, spool = start(settings), Spool(folder / "spool")
    publishers = Publishers(None, "p", spool)
    begun, sent, flushed, wrote = time.monotonic(), 0, 0.0, 0
    while (now := time.monotonic() - begun) < seconds:
        if sent * PERIOD_S * BATCH > now:
            time.sleep(0.002)
            continue
        counts = [sent % 200 + k for k in range(12 * BATCH)]
        header = pb.Header(device="cube", run=1, utc_ns=time.time_ns())
        message = pb.AccelBatch(
            header=header, axes=12, counts=counts, f_mps2=[0.0383 * c for c in counts]
        )
        publishers.put(ACCEL, "cube", message)
        wrote = time.time_ns()
        store.add(wrote, "p/cube/accel", message.SerializeToString())
        sent += 1
        if now - flushed > settings.flush_s:
            flushed = now
            store.flush()
    disk = folder / "disk"
    disk.mkdir()
    recording = survivor(store.folder / RECORDING, disk)
    segments = [survivor(name, disk) for name in spool.journal.segments()]
    store.close()
    spool.close()
    found = salvage(recording, disk / "again.mcap", {1: "p/cube/accel"})
    kept = [record.utc_ns for name in segments for _, _, record in scan(name.read_bytes()).records]
    return (wrote - found.end_utc_ns) / 1e9, (wrote - max(kept, default=0)) / 1e9


def main(trials: int = 10, seed: int = 1) -> None:
    """Run and print."""
    os.fdatasync = fdatasync
    chance = random.Random(seed)
    lost = []
    for _ in range(trials):
        with tempfile.TemporaryDirectory() as name:
            lost.append(trial(Path(name), chance.uniform(2.0, 5.0)))
    for what, values in zip(("recording", "published"), zip(*lost, strict=True), strict=True):
        figure = {
            "name": f"powercut_lost_{what}",
            "value": round(max(values), 3),
            "unit": "s",
            "target": 1.0,
        }
        print(
            json.dumps(figure | {"least": round(min(values), 3), "trials": trials, "seed": seed}),
            flush=True,
        )


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:3]))
