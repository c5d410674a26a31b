"""The pipeline without and with a bus: same messages, same bytes; gaps, reboots and nonsense told
apart.
"""

import logging
import math
import queue
import threading

import numpy as np
import pytest
from support.estimator_drive import DT, drive, exact

from estimator import service
from estimator.choice import UnknownEstimator
from estimator.convert.samples import BadMessage
from estimator.output import Output
from estimator.pipeline import Pipeline
from estimator.settings import EstimatorSettings, LayoutSettings
from estimator.stream import Stream, every, worth_a_line
from inertial.simulation.table import TableTest
from messages.bus.session import BusSettings, Publishers, open_client, open_router, subscribe
from messages.contract import gyrofree_pb2 as pb
from messages.contract.rates import rows
from messages.contract.topics import ACCEL, ESTIMATOR, GNSS, IMU, INNOVATION, NAV, POSE, RATE

UTC = 1_700_000_000 * 10**9
PATIENCE = 120.0  # s; compiling on a busy machine


def header(device: str, sequence: int, t: float, epoch: int = 1) -> pb.Header:
    return pb.Header(
        device=device,
        sequence=sequence,
        epoch=epoch,
        device_us=round(t * 1e6),
        utc_ns=UTC + round(t * 1e9),
        source=pb.SOURCE_SIMULATED,
        run=7,
    )


def accel_batches(n: int, size: int = 5, epoch: int = 1) -> list[pb.AccelBatch]:
    test = TableTest(seed=3)
    rows = np.concatenate(
        [test.block(k).readings for k in range(n * size // len(test.block(0).t_s) + 1)]
    )
    return [
        pb.AccelBatch(
            header=header("cube", k + 1, k * size * DT, epoch),
            first_index=k * size,
            period_s=DT,
            axes=12,
            f_mps2=rows[k * size : (k + 1) * size].ravel().tolist(),
        )
        for k in range(n)
    ]


def drive_messages(seconds: float) -> list[tuple]:
    """IMU batches and fixes of the exact drive in order of time, fixes 80 ms late."""
    truth, imu = exact(seconds, still=12.0)
    out = []
    for k in range(0, len(imu), 2):
        rows = imu[k : k + 2]
        batch = pb.ImuBatch(
            header=header("car", k // 2 + 1, rows[0, 0]),
            first_index=k,
            period_s=DT,
            f_b_mps2=rows[:, 1:4].ravel().tolist(),
            omega_ib_b_radps=rows[:, 4:7].ravel().tolist(),
        )
        out.append((rows[-1, 0], IMU, batch))
    for n, fix in enumerate(drive(truth, imu).fixes):
        message = pb.GnssFix(
            header=header("car", n + 1, fix.t + 0.08),
            latitude_deg=math.degrees(fix.latitude),
            longitude_deg=math.degrees(fix.longitude),
            height_m=fix.height,
            v_n_mps=fix.v_n.tolist(),
            position_sigma_ned_m=[0.02] * 3,
            quality=pb.GnssFix.QUALITY_RTK_FIXED,
            device_time_s=fix.t,
        )
        out.append((fix.t + 0.08, GNSS, message))
    return [(topic, message) for _, topic, message in sorted(out, key=lambda item: item[0])]


def bytes_of(outputs: list[Output]) -> list[tuple[str, str, bytes]]:
    return [
        (o.topic.name, o.estimator, o.message.SerializeToString(deterministic=True))
        for o in outputs
        if o.topic is not ESTIMATOR
    ]


def run_through(
    messages: list[tuple], settings: EstimatorSettings = EstimatorSettings()
) -> list[Output]:
    pipeline = Pipeline(settings)
    return [output for topic, message in messages for output in pipeline.on(topic, message)]


def test_accelerometers_become_rates_poses_and_health() -> None:
    batches = accel_batches(50)
    outputs = run_through([(ACCEL, b) for b in batches])
    rates = [one for o in outputs if o.topic is RATE for one in rows(o.message)]
    names = EstimatorSettings().rate
    assert {m.estimator for m in rates} == set(names)
    assert len(rates) == 250 * len(names)
    assert len([o for o in outputs if o.topic is POSE]) == 50 * len(names)
    last = rates[-1]
    assert (last.for_sequence, last.for_index) == (50, 249)
    assert (
        last.header.utc_ns == UTC + round(2.49e9)
        and last.header.device_us == 2_490_000
        and last.header.run == 7
    )
    assert (
        len(last.omega_ib_b_radps) == 3 and len(last.omega_covariance) == 9 and len(last.q_nb) == 4
    )
    health = [o.message for o in outputs if o.topic is ESTIMATOR]
    assert len(health) == 3 * len(names)
    assert health[-1].layout == "cube" and health[-1].samples == 205 and health[-1].version


def test_same_messages_same_bytes() -> None:
    accel, ride = [(ACCEL, b) for b in accel_batches(40)], drive_messages(26.0)
    assert bytes_of(run_through(accel)) == bytes_of(run_through(accel))
    once = bytes_of(run_through(ride))
    assert once == bytes_of(run_through(ride))
    # a fix that overtakes two batches on the bus, or is overtaken by them, changes nothing
    at = [k for k, (topic, _) in enumerate(ride) if topic is GNSS]
    for k in at[3:]:
        ride.insert(k - 2, ride.pop(k))
    assert once == bytes_of(run_through(ride))


def test_a_drive_becomes_solutions_and_innovations() -> None:
    outputs = run_through(
        drive_messages(40.0), EstimatorSettings(use_every_fix=2, navigators=["kf"])
    )
    navs = [o.message for o in outputs if o.topic is NAV]
    assert len(navs) == 40 * 20
    assert [m.mode for m in (navs[0], navs[230], navs[-1])] == [1, 2, 3]
    assert len(navs[-1].sigma) == 15 and len(navs[-1].position_covariance) == 9
    said = [o.message for o in outputs if o.topic is INNOVATION]
    withheld = [m for m in said if m.for_sequence % 2 and len(m.error_to_reference)]
    used = [m for m in said if m.accepted and m.dof == 6]
    assert withheld and used
    assert all(np.linalg.norm(m.error_to_reference) < 0.1 for m in withheld)
    assert all(len(m.name) == len(m.value) == len(m.sigma) == 6 for m in used)
    assert used[-1].header.device_us % 1_000_000 == 30_000  # the fix's own time
    state = [o.message.state for o in outputs if o.topic is ESTIMATOR]
    assert state[0] == "stand still for 10 s" and state[-1] == "navigating"


def test_gaps_are_counted_and_reboots_start_anew(caplog: pytest.LogCaptureFixture) -> None:
    batches = accel_batches(60)
    with caplog.at_level(logging.WARNING):
        outputs = run_through([(ACCEL, b) for b in batches[:20] + batches[22:]])
        assert "10 samples missing before 110" in caplog.text
        health = [o.message for o in outputs if o.topic is ESTIMATOR][-1]
        assert (health.gaps, health.missing_samples, health.samples) == (1, 10, 195)
        outputs = run_through([(ACCEL, b) for b in batches[:30] + accel_batches(30, epoch=2)])
        assert "board restarted (boot 1 -> 2)" in caplog.text
        run_through([(ACCEL, b) for b in batches[:30] + batches[:5]])
        assert "sample index went back from 150 to 0" in caplog.text
    fresh = bytes_of(run_through([(ACCEL, b) for b in accel_batches(30, epoch=2)]))
    assert bytes_of(outputs)[-len(fresh) :] == fresh


def test_nonsense_is_refused_in_words() -> None:
    pipeline = Pipeline(EstimatorSettings())
    good = accel_batches(1)[0]
    for change, words in (
        ({"axes": 7}, "do not fill rows of 7"),
        ({"axes": 6}, "layout cube has 12"),
        ({"period_s": 0.0}, "period 0.0 s"),
        ({"f_mps2": [math.nan] * 12}, "not all values are finite"),
    ):
        bad = pb.AccelBatch()
        bad.CopyFrom(good)
        for field, value in change.items():
            if field == "f_mps2":
                del bad.f_mps2[:]
                bad.f_mps2.extend(value)
            else:
                setattr(bad, field, value)
        with pytest.raises(BadMessage, match=words):
            pipeline.on(ACCEL, bad)
    assert pipeline.on(ACCEL, good)
    with pytest.raises(UnknownEstimator, match="no estimator 'kalman'; want some of least-squares"):
        Pipeline(EstimatorSettings(rate=["kalman"]))


def test_settings_by_device() -> None:
    settings = EstimatorSettings(layouts={"big": LayoutSettings(half_side_m=0.1)})
    assert settings.layout_of("big").half_side_m == 0.1
    assert settings.layout_of("other").half_side_m == 0.05


def test_stream_and_helpers() -> None:
    stream = Stream()
    assert stream.admit(1, 100, 5).restart
    assert stream.admit(1, 105, 5).missing == 0
    assert stream.admit(1, 113, 5).missing == 3
    assert stream.admit(1, 117, 5).reason == "sample index went back from 118 to 117"
    assert [every(p, 200.0) for p in (0.01, 0.005, 0.001, 1 / 3200)] == [1, 1, 5, 16]
    assert [n for n in range(10) if worth_a_line(n)] == [1, 2, 4, 8]


def test_service_over_the_bus(free_port: int) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port}"
    bus = BusSettings(prefix="t", router=endpoint, listen=[endpoint])
    ride = drive_messages(20.0)
    stop, failures = threading.Event(), []

    def work() -> None:
        try:
            service.run(EstimatorSettings(navigators=["kf"], journal=None), bus, stop)
        except BaseException as error:
            failures.append(error)

    with open_router(bus), open_client(bus) as session:
        arrived: queue.SimpleQueue = queue.SimpleQueue()
        keep = [
            subscribe(session, t, "t", lambda key, m, t=t: arrived.put((key, m)))
            for t in (NAV, RATE, INNOVATION)
        ]
        worker = threading.Thread(target=work)
        worker.start()
        publishers = Publishers(session, "t")
        # The service answers once it listens; what went before that is a late start, a gap of
        # nothing.
        poke, key = accel_batches(1)[0], ""
        for attempt in range(round(PATIENCE / 0.25)):
            poke.header.epoch, poke.header.sequence = attempt + 1, attempt + 1
            publishers.put(ACCEL, "cube", poke)
            try:
                key, _ = arrived.get(timeout=0.25)
                break
            except queue.Empty:
                assert not failures, failures
        assert key.startswith("t/cube/rate/")
        session.put("t/car/imu", b"\xff\xff nonsense")
        got: list = []
        for topic, message in ride:
            publishers.put(topic, "car", message)
            # Publishers drop when a link is full: go on only when this batch's solution is back.
            wanted = message.first_index + 1 if topic is IMU else 0
            while wanted % 5 == 4 and not (
                got and isinstance(got[-1], pb.NavSolution) and got[-1].for_index == wanted
            ):
                got.append(arrived.get(timeout=PATIENCE)[1])
        stop.set()
        worker.join(timeout=10.0)
        assert not worker.is_alive() and not failures
        for subscriber in keep:
            subscriber.undeclare()
    navs = [m for m in got if isinstance(m, pb.NavSolution)]
    expected = [
        o.message for o in run_through(ride, EstimatorSettings(navigators=["kf"])) if o.topic is NAV
    ]
    assert [m.header.sequence for m in navs] == list(range(1, len(navs) + 1))
    for message in navs:
        message.header.sequence = 0
    assert [m.SerializeToString(deterministic=True) for m in navs] == [
        m.SerializeToString(deterministic=True) for m in expected
    ]
