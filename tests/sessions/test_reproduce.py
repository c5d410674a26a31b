# ruff: noqa: F401, F811  (fixtures come from tests.sessions.test_bus)
"""A session recorded from the real bus with the real estimator gives its estimates again, bit for
bit.
"""

import threading
import time

import pytest
from support.waiting import until

from estimator import service
from estimator.pipeline import Pipeline
from estimator.settings import EstimatorSettings
from gyrofree.config import Settings
from gyrofree.running.replay import Options
from gyrofree.running.replay import run as play
from inertial.rate.estimators import ESTIMATORS
from inertial.simulation.table import TableTest
from messages.bus.session import subscribe
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import ACCEL, RATE, parse
from sessions.library.catalogue import Catalogue
from sessions.recording.mcap_log import read
from sessions.recording.samples import samples
from sessions.replay import replay
from sessions.replay.reproduce import compare, reproduce
from tests.sessions.test_bus import PATIENCE, bus, client, order, recording

SETTINGS = EstimatorSettings(rate=list(ESTIMATORS))
BATCH, BATCHES = 10, 150  # 15 s of the published test: still, then turning
SAMPLES = BATCH * BATCHES
T0 = 1_700_000_000_000_000_000


def batches() -> list[pb.AccelBatch]:
    """What a gateway sends for the first seconds of the published test."""
    counts = [sample.counts for sample, _ in zip(TableTest(seed=3), range(SAMPLES), strict=False)]
    out = []
    for n in range(BATCHES):
        rows = counts[n * BATCH : (n + 1) * BATCH]
        header = pb.Header(device="cube", sequence=n + 1, epoch=1, device_us=n * 100_000, run=5)
        header.utc_ns, header.source = T0 + n * 100_000_000, pb.SOURCE_SIMULATED
        flat = [int(count) for row in rows for count in row]
        scaled = [count * 0.0039 * 9.80665 for count in flat]
        out.append(
            pb.AccelBatch(
                header=header,
                first_index=n * BATCH,
                period_s=0.01,
                axes=12,
                counts=flat,
                f_mps2=scaled,
            )
        )
    return out


@pytest.fixture(scope="module", autouse=True)
def compiled():
    """The estimators' compiled functions, made or taken from the cache before anything waits for
    them.
    """
    pipeline = Pipeline(SETTINGS)
    for batch in batches():
        pipeline.on(ACCEL, batch)


@pytest.fixture
def estimating(bus):
    """The estimator service on the bus of the test."""
    stop = threading.Event()
    thread = threading.Thread(target=service.run, args=(SETTINGS, bus, stop))
    thread.start()
    yield thread
    stop.set()
    thread.join(PATIENCE)


def batches_of(path, device: str) -> dict[tuple[str, int], bytes]:
    """Recorded rate estimates by estimator and first sample, without device name and
    sequence of publication.
    """
    found = {}
    for row in read(path):
        if f"/{device}/rate/" in row.key:
            message = pb.RateBatch.FromString(row.payload)
            message.header.device = ""
            message.header.sequence = 0
            found[message.estimator, message.for_index] = message.SerializeToString()
    return found


def wait_for_last(seen: list, device: str) -> None:
    """Wait until every estimator has spoken of the last sample, and the recorder has written it."""
    wanted = {f"t/{device}/rate/{name}" for name in SETTINGS.rate}
    until(
        lambda: wanted <= {key for key, index in seen if index == SAMPLES - BATCH},
        f"the last estimates of {device}",
    )


def test_a_live_session_is_reproduced_and_its_replay_gives_the_same_estimates(
    bus, client, recording, estimating
):
    """Live messages may be dropped under load (the bus says DROP); what is recorded must come out
    again.
    """
    with client.declare_publisher(ACCEL.key("t", "cube")) as probe:  # nobody else listens to it yet
        until(lambda: probe.matching_status.matching, "the estimator's subscription")
    settings, stop, thread = recording()
    seen = []
    listener = subscribe(
        client, RATE, "t", lambda key, message: seen.append((key, message.for_index))
    )
    until(lambda: (s := order(client)) and s.recording, "the recording")
    outlet, address = replay.Outlet(client, "t"), parse(ACCEL.key("t", "cube"))
    for batch in batches():
        outlet.put(address, "cube", batch)
        time.sleep(0.01)  # ten times real time
    wait_for_last(seen, "cube")
    live = order(client, pb.RecorderCommand.ACTION_STOP)

    report = reproduce(Catalogue(settings.root).path(live.session), Pipeline(SETTINGS))
    assert report.identical and report.as_dict()["identical"], report
    assert {key.rsplit("/", 1)[1] for key in report.keys} == set(SETTINGS.rate)
    assert report.inputs == BATCHES and report.refused == 0
    for compared in report.keys.values():
        assert compared.equal > 0.5 * SAMPLES and compared.equal + compared.extra == SAMPLES
        assert not compared.first_difference and compared.equal_since is not None

    again = order(client, pb.RecorderCommand.ACTION_START, name="again")
    mine = Settings(bus=bus, estimator=SETTINGS)
    play(mine, Catalogue(settings.root).path(live.session), Options(speed=1.0), threading.Event())
    wait_for_last(seen, "cube-replay")
    stop.set()
    thread.join(PATIENCE)
    listener.undeclare()
    first = batches_of(Catalogue(settings.root).path(live.session), "cube")
    second = batches_of(Catalogue(settings.root).path(again.session), "cube-replay")
    both = first.keys() & second.keys()
    assert len(both) > 0.25 * BATCHES * len(SETTINGS.rate)
    assert all(first[name] == second[name] for name in both)


def test_a_changed_bit_a_missing_input_and_a_late_start_are_told_apart(tmp_path):
    from sessions.recording import store
    from sessions.recording.settings import RecorderSettings

    pipeline, inputs = Pipeline(SETTINGS), batches()[:30]
    name = SETTINGS.rate[0]
    key = RATE.key("t", "cube", name)
    session = store.start(RecorderSettings(root=tmp_path))
    for n, batch in enumerate(inputs):
        if n >= 2:  # the recorder came late: two inputs are not in the file
            session.add(T0 + n, ACCEL.key("t", "cube"), batch.SerializeToString())
        for output in pipeline.on(ACCEL, batch):
            if output.topic is RATE and output.estimator == name:
                if output.message.for_index == 50:
                    output.message.angle_z_rad[0] += 1e-12
                output.message.header.sequence = 7
                session.add(T0 + n, key, output.message.SerializeToString())
    assert session.close()
    result = reproduce(session.folder / "recording.mcap", Pipeline(SETTINGS)).keys[key]
    assert result.missing == 2 * BATCH and not result.same
    assert result.different >= 1 and result.first_difference


def test_fields_that_differ_are_named_also_when_they_are_not_numbers():
    one = pb.RateBatch(estimator="e", nis=[float("nan")], q_nb=[1, 0, 0, 0])
    two = pb.RateBatch(estimator="e", nis=[float("nan")], q_nb=[1, 0, 0, 1e-16])
    three = pb.RateBatch(
        estimator="f", nis=[float("nan")], q_nb=[1, 0, 0, 0], nis_dof=[1], innovation=[0.0]
    )
    first = samples(RATE, [one])
    assert compare(first, samples(RATE, [one])).same
    assert compare(first, samples(RATE, [two])).first_difference.endswith(": q_nb")
    found = compare(first, samples(RATE, [three]))
    assert found.first_difference.endswith(": estimator, innovation, nis_dof") and not found.same
