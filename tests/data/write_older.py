"""Writes a small set of files with the code of another state of the repository; see README.md."""

import importlib
import sys
import types
from collections.abc import Iterator
from pathlib import Path

T0 = 1_780_000_000_000_000_000  # ns since 1970
STEP = 10_000_000  # ns
SAMPLES, FRAMES = 30, 20
PASSWORD = "correct horse battery"


def find(*names: str):  # noqa: ANN201
    """The first of these modules that there is: rooms were called otherwise."""
    for name in names:
        try:
            return importlib.import_module(name)
        except ModuleNotFoundError as error:
            if error.name and not name.startswith(error.name):
                raise
    return None


def messages(pb, topics) -> Iterator:  # noqa: ANN001
    """(key, UTC, message) of 30 samples, 10 estimates, a fix and a status."""

    def headed(message, k: int, count: int):  # noqa: ANN001, ANN202
        header = message.header
        header.device, header.sequence, header.epoch = "cube", count + 1, 1
        header.device_us, header.utc_ns = 10_000 * k, T0 + STEP * k
        header.utc_sigma_s, header.source, header.run = 1e-3, 2, T0
        return message

    for k in range(SAMPLES):
        batch = headed(pb.AccelBatch(first_index=k, period_s=0.01, axes=12), k, k)
        batch.counts.extend(range(k, k + 12))
        batch.f_mps2.extend(0.01 * (k + i) for i in range(12))
        yield topics.ACCEL.key("gyrofree", "cube"), batch
        if k % 3 == 0:
            kind = getattr(pb, "RateBatch", None) or pb.RateEstimate
            rate = headed(kind(estimator="products-ekf", for_index=k), k, k // 3)
            rate.omega_ib_b_radps.extend([0.0, 0.0, 0.1 * k])
            rate.omega_covariance.extend([1e-4, 0, 0, 0, 1e-4, 0, 0, 0, 1e-4])
            yield topics.RATE.key("gyrofree", "cube", "products-ekf"), rate
        if k == 10:
            fix = pb.GnssFix(latitude_deg=48.1, longitude_deg=11.5, quality=1, satellites=8)
            yield topics.GNSS.key("gyrofree", "cube"), headed(fix, k, 0)
        if k == 20:
            link = pb.LinkStatus(connected=True, good_frames=20)
            yield topics.LINK.key("gyrofree", "cube"), headed(link, k, 0)


def main(tree: Path, out: Path) -> None:
    """Write with the code of `tree` into the new folder `out`."""
    sys.path.insert(0, str(tree))
    if (tree / "inertial" / "core").is_dir():  # compiled; only its version is asked for here
        sys.modules["inertial.core"] = stub = types.ModuleType("inertial.core")
        stub.VERSION = "as built then"  # type: ignore[attr-defined]
        importlib.import_module("inertial").core = stub  # type: ignore[attr-defined]
    pb = find("messages.contract.gyrofree_pb2", "messages.gyrofree_pb2")
    topics = find("messages.contract.topics", "messages.topics")
    store = find("sessions.recording.store", "sessions.store")
    recorder = find("sessions.recording.settings", "sessions.settings").RecorderSettings
    spool = find("messages.history.spool", "messages.spool")
    out.mkdir(parents=True)
    session = store.start(recorder(root=str(out / "sessions")), name="old", note="made then")
    for key, message in messages(pb, topics):
        session.add(message.header.utc_ns, key, message.SerializeToString())
    session.flush()
    session.close()
    journal = find("messages.history.journal", "messages.journal").Journal(out / "journal")
    for k in range(FRAMES):
        journal.append(0, b"frame %d" % k, STEP * k, T0 + STEP * k)
    journal.close()
    if spool is not None:
        published = spool.Spool(out / "published")
        for key, message in messages(pb, topics):
            header, name = message.header, key.split("/", 2)[2]
            content = message.SerializeToString()
            published.append(name, "cube", T0, header.sequence, header.utc_ns, content)
        published.close()
    users = find("dashboard.web.users", "dashboard.users")
    users.add_user(out / "users.json", "anna", PASSWORD, "operator")
    (out / "gyrofree.toml").write_text((tree / "gyrofree.toml").read_text())


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
