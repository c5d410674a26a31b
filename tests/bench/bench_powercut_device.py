"""Power cut by a snapshot of the block device: what its file system holds after its own recovery,
and ours.

    sudo python tests/bench/bench_powercut_device.py [snapshots, default 10] [seed]

Real gateway and recorder processes write a board's 1000 samples/s to an ext4 on a loop device. The
device's backing file lies on an XFS, whose reflink copies it in one instant (FICLONE), while
everything runs on: what was in no block of the device at that instant is not in the copy, as after
a power cut with a disk that keeps what it was told. Each copy is attached as a device of its own
and mounted, so that ext4 replays its journal. What stands in its files is read; then gateway and
recorder are started on it, as after the power has come back, and what the sessions hold then is
read: the recorder asks for what the published journal has and its own file had not. Loss is counted
up to the end of the copying. Wants root, loop devices, mkfs.ext4 and mkfs.xfs (xfsprogs).
"""

import fcntl
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack, contextmanager
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from support.kill_stack import line  # noqa: E402
from support.stack import free_port  # noqa: E402
from support.waiting import until  # noqa: E402

from messages.contract import gyrofree_pb2 as pb  # noqa: E402
from messages.contract.topics import ACCEL  # noqa: E402
from messages.history.journal import Journal  # noqa: E402
from sessions.library.catalogue import Catalogue  # noqa: E402
from sessions.recording.mcap_log import read  # noqa: E402
from tests.system.test_kill import Stack  # noqa: E402

FICLONE = 0x40049409  # linux/fs.h
OUTER_BYTES, INNER_BYTES = 3 << 30, 1 << 30  # sparse
PERIOD_S = 0.001


def shell(*words: object) -> None:
    """Run a command; its own words when it fails."""
    done = subprocess.run(
        [str(word) for word in words], capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise SystemExit(f"{' '.join(map(str, words))}: {done.stderr.strip()}")


@contextmanager
def mounted(image: Path, at: Path, options: str = "loop"):
    """An image as a mounted loop device."""
    at.mkdir(exist_ok=True)
    shell("mount", "-o", options, image, at)
    try:
        yield at
    finally:
        shell("umount", at)


def snapshot(disk: Path, copy: Path) -> int:
    """Copy the device in one instant; UTC ns when that was surely over."""
    source = os.open(disk, os.O_RDONLY)
    target = os.open(copy, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o600)
    try:
        fcntl.ioctl(target, FICLONE, source)
        return time.time_ns()
    finally:
        os.close(source)
        os.close(target)


def newest_ns(sessions: Path, until_ns: int) -> int:
    """End of the last sample before a moment, UTC ns, in all sessions of a folder, the open ones
    among them.
    """
    newest = 0
    for info in Catalogue(sessions).list():
        for row in read(info.path):
            if row.key.endswith(f"/{ACCEL.name}"):
                batch = pb.AccelBatch.FromString(row.payload)
                end_ns = batch.header.utc_ns + round(
                    len(batch.counts) / batch.axes * batch.period_s * 1e9
                )
                newest = max(newest, end_ns) if end_ns <= until_ns else newest
    return newest


def found_in(copy: Path, at: Path, end_ns: int, acknowledged: dict[str, int]) -> dict[str, float]:
    """Seconds lost of both journals, of the recording and of the recording after a start;
    acknowledged ones gone.
    """
    gone, lost = 0, {}
    with mounted(copy, at):
        for name, folder in (("raw", "journal/cube"), ("published", "journal/cube/published")):
            journal = Journal(at / folder)  # cuts a torn tail, as the next start of a gateway does
            lost[name] = (end_ns - journal.tail(1 << 20)[-1].utc_ns) / 1e9
            journal.close()
        lost["recording"] = (end_ns - newest_ns(at / "sessions", end_ns)) / 1e9
        with Stack(at, free_port()) as again:  # another board by then, which speaks slowly
            until(lambda: not again.status.repairing, "what was missed to be filled in")
        lost["recording_after_the_next_start"] = (end_ns - newest_ns(at / "sessions", end_ns)) / 1e9
        for info in Catalogue(at / "sessions").list():
            gone += max(0, acknowledged.get(info.id, 0) - sum(1 for _ in read(info.path)))
    return lost | {"gone": gone}


def main(cuts: int = 10, seed: int = 1) -> None:
    """Run and print."""
    lacking = [tool for tool in ("mkfs.xfs", "mkfs.ext4", "mount") if shutil.which(tool) is None]
    if os.geteuid() or lacking or not Path("/dev/loop-control").exists():
        why = (
            "wants root, loop devices, mkfs.ext4 and mkfs.xfs; not here:"
            f" {', '.join(lacking) or 'root or /dev/loop*'}"
        )
        line("powercut_device_lost_recording", None, "s", target=1.0, not_measured=why)
        return
    chance, taken = random.Random(seed), []
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        outer_image, disk = folder / "outer.img", folder / "outer" / "disk.img"
        for image, size, mkfs in (
            (outer_image, OUTER_BYTES, ("mkfs.xfs", "-q", "-m", "reflink=1")),
            (disk, INNER_BYTES, ("mkfs.ext4", "-q", "-F")),
        ):
            with image.open("wb") as stream:
                stream.truncate(size)
            shell(*mkfs, image)
            stack.enter_context(
                mounted(image, folder / ("outer" if image == outer_image else "disk"))
            )
        with Stack(folder / "disk", free_port(), PERIOD_S) as running:
            for k in range(cuts):
                time.sleep(chance.uniform(1.0, 5.0))
                said = {running.status.session: running.status.durable_messages}
                copy = folder / "outer" / f"cut-{k}.img"
                taken.append((copy, snapshot(disk, copy), said))
        results = [found_in(copy, folder / "copy", end_ns, said) for copy, end_ns, said in taken]
    for what in ("raw", "published", "recording", "recording_after_the_next_start"):
        values = [result[what] for result in results]
        more = {
            "least": round(min(values), 3),
            "median": round(sorted(values)[cuts // 2], 3),
            "cuts": cuts,
            "seed": seed,
        }
        line(f"powercut_device_lost_{what}", round(max(values), 3), "s", target=1.0, **more)
    line(
        "powercut_device_acknowledged_lost",
        sum(result["gone"] for result in results),
        "messages",
        target=0,
    )


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:3]))
