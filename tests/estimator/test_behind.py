"""An estimator that cannot keep up says by how much; its word is not shown as the present."""

import threading
import time

from dashboard.data.device import BEHIND_STALE_S, Device, Latest
from estimator.output import Output
from estimator.pipeline import Pipeline
from estimator.settings import EstimatorSettings
from estimator.worker import Worker
from messages.clock import elapsed_ns
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import ACCEL, ESTIMATOR
from messages.history.mending_state import Arrival
from tests.estimator.test_service import accel_batches


def statuses(age_s: float) -> list[pb.EstimatorStatus]:
    """What an estimator says whose samples have waited for it."""
    said: list[Output] = []
    worker = Worker(Pipeline(EstimatorSettings(navigators=[])), said.append)
    arrived_ns = elapsed_ns() - round(age_s * 1e9)
    for batch in accel_batches(60):
        worker.offer(Arrival(ACCEL, "cube", "", batch.SerializeToString(), arrived_ns))
    worker.finish()
    worker.work(threading.Event())
    assert worker.failure is None
    return [output.message for output in said if output.topic is ESTIMATOR]


def test_the_status_says_how_far_behind_the_estimates_are():
    for age_s in (0.0, 49.0):
        found = statuses(age_s)
        assert found and all(age_s <= status.behind_s < age_s + 30.0 for status in found)
    assert found[0].waiting > found[-1].waiting


def test_estimates_of_old_samples_are_stale_on_the_page():
    device = Device("cube", 0)
    now = time.monotonic()
    device.latest["rate", "a"] = Latest(pb.RateBatch(), now, 0.0)
    device.latest["accel", ""] = Latest(pb.AccelBatch(), now, 0.0)
    for behind_s, stale in ((0.0, False), (BEHIND_STALE_S + 0.1, True), (49.0, True)):
        status = pb.EstimatorStatus(behind_s=behind_s)
        device.latest["estimator", "a"] = Latest(status, now, 0.0)
        assert device.stale("rate", "a", now) is stale
        assert not device.stale("accel", "", now)
