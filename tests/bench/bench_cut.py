"""Link cut at 1 kHz: what is lost, how long until the recording and the charts are whole again.

    python tests/bench/bench_cut.py [seconds of the cut, default 30] [minutes of the compressed
    outage, default 10]

A publisher with a spool, twelve axes at 1000 samples/s in messages of ten, a recorder and a
dashboard's feed, all on a real router; the publisher's TCP connection goes through a cable that is
cut. The long outage is compressed in time: that many minutes of messages are published as fast as
they can be while the cable is cut.
"""

import json
import sys
import tempfile
import threading
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]

from support.bus_cut import Cable  # noqa: E402
from support.stack import free_port  # noqa: E402

from dashboard.data.feed import Feed  # noqa: E402
from dashboard.data.store import Store  # noqa: E402
from messages.bus.session import BusSettings, Publishers, open_client, open_router  # noqa: E402
from messages.contract import gyrofree_pb2 as pb  # noqa: E402
from messages.contract.topics import ACCEL, STATUS  # noqa: E402
from messages.history.answers import declare  # noqa: E402
from messages.history.spool import Spool  # noqa: E402
from sessions.library.catalogue import Catalogue  # noqa: E402
from sessions.recording import service as recorder  # noqa: E402
from sessions.recording.mcap_log import read  # noqa: E402
from sessions.recording.settings import RecorderSettings  # noqa: E402

PERIOD_S, BATCH = 0.001, 10


class Board:
    """Publishes in real time, or as fast as it can."""

    def __init__(self, publishers: Publishers) -> None:
        self._publishers = publishers
        self.sent = 0
        self.t_s = time.time()

    def send(self) -> None:
        """One message, BATCH samples after the one before."""
        header = pb.Header(
            device="cube",
            run=1,
            epoch=1,
            utc_ns=int(self.t_s * 1e9),
            device_us=int(self.sent * 1e4),
        )
        counts = [self.sent % 200 + k for k in range(12 * BATCH)]
        message = pb.AccelBatch(
            header=header, first_index=self.sent * BATCH, period_s=PERIOD_S, axes=12, counts=counts
        )
        message.f_mps2[:] = [0.0383 * count for count in counts]
        self._publishers.put(ACCEL, "cube", message)
        self.sent += 1
        self.t_s += PERIOD_S * BATCH

    def run(self, seconds: float) -> None:
        """Real time."""
        end = self.t_s + seconds
        while self.t_s < end:
            self.send()
            time.sleep(max(0.0, self.t_s - time.time()))


def holes(store: Store, t_from: float) -> int:
    """Samples missing in the ring that the charts read, behind t_from (s on its axis)."""
    with store.lock:
        device = store.device("cube")
        t, _ = device.window("accel", "", t_from, device.t_newest)
    return round((t[-1] - t[0]) / PERIOD_S) + 1 - len(t) if len(t) else 1


def trial(cut_s: float, compressed: bool) -> dict:
    """One cut; what the recording holds and how long it took."""
    port = free_port()
    bus = BusSettings(router=f"tcp/127.0.0.1:{port}", listen=[f"tcp/127.0.0.1:{port}"])
    stop, watched = threading.Event(), threading.Event()
    watched.set()
    with tempfile.TemporaryDirectory() as name, open_router(bus):
        cable, store = Cable(port), Store()
        settings = RecorderSettings(root=Path(name) / "sessions", auto_start=True)
        recording = threading.Thread(target=recorder.run, args=(settings, bus, stop))
        recording.start()
        listener = open_client(bus)
        feed = Feed(listener, bus.prefix, store, watched)
        spool = Spool(Path(name) / "spool")
        status = [pb.RecorderStatus()]
        with open_client(cable.bus(bus)) as session, open_client(bus) as watcher:
            held = watcher.declare_subscriber(
                f"gyrofree/recorder/{STATUS.name}",
                lambda s: status.__setitem__(0, pb.RecorderStatus.FromString(s.payload.to_bytes())),
            )
            answering = declare(session, "gyrofree", "cube", "gateway", spool)
            while not status[0].recording:
                time.sleep(0.05)
            board = Board(Publishers(session, "gyrofree", spool))
            board.run(3.0)
            cable.cut()
            if compressed:  # what a board says in that time, said at once and dated back
                board.t_s -= cut_s
                while board.t_s < time.time():
                    board.send()
            else:
                board.run(cut_s)
            cable.mend()
            mended, screen_s, disk_s = time.monotonic(), None, None
            while time.monotonic() - mended < 120 and (screen_s is None or disk_s is None):
                board.run(0.1)
                visible = min(cut_s, 25.0)  # what the ring of the charts can hold at this rate
                device = store.device("cube")
                here = (
                    device is not None and device.utc0_ns * 1e-9 + device.t_newest > board.t_s - 0.5
                )
                if screen_s is None and here and not holes(store, device.t_newest - visible):
                    screen_s = time.monotonic() - mended
                if (
                    disk_s is None
                    and status[0].messages >= board.sent - 150
                    and not status[0].repairing
                ):
                    disk_s = time.monotonic() - mended
            board.run(1.0)
            time.sleep(1.0)
            stop.set()
            recording.join()
            held.undeclare()
            answering.undeclare()
        feed.stop()
        listener.close()
        cable.close()
        spool.close()
        (info,) = Catalogue(settings.root).list()
        rows = [pb.AccelBatch.FromString(row.payload) for row in read(info.path)]
        sequences = [row.header.sequence for row in rows]
        found = Catalogue(settings.root).manifest(info.id).certificate["cube"]["topics"]["accel"]
        lost = sequences[-1] - sequences[0] + 1 - len(set(sequences))
        double, in_order = len(sequences) - len(set(sequences)), sequences == sorted(sequences)
        return {
            "lost": lost,
            "double": double,
            "in_order": in_order,
            "screen_s": screen_s,
            "disk_s": disk_s,
            "certificate": found,
        }


def main(cut_s: float = 30.0, minutes: float = 10.0) -> None:
    """Run and print."""
    for label, seconds, compressed in (
        ("cut", cut_s, False),
        ("outage_compressed", 60.0 * minutes, True),
    ):
        got = trial(seconds, compressed)
        more = {
            "cut_s": seconds,
            "double": got["double"],
            "in_order": got["in_order"],
            **got["certificate"],
        }
        print(
            json.dumps(
                {"name": f"{label}_lost", "value": got["lost"], "unit": "messages", "target": 0}
                | more
            )
        )
        for where in ("screen", "disk"):
            value = got[f"{where}_s"]
            figure = {
                "name": f"{label}_whole_on_{where}",
                "value": value and round(value, 2),
                "unit": "s",
            }
            print(json.dumps(figure | ({"target": 5.0} if not compressed else {})), flush=True)


if __name__ == "__main__":
    main(*(float(word) for word in sys.argv[1:3]))
