"""Too slow for all: late by seconds at most, and it says what it left out. Time is simulated."""

import threading

import pytest

from estimator.output import Output
from estimator.overload import CATCH_UP_S, COARSE_HZ, FRESH_S, HOLE_S, LATE_S, LOOK_S, Overload
from estimator.pipeline import Pipeline
from estimator.settings import EstimatorSettings
from estimator.worker import Worker
from messages.contract.topics import ACCEL, ESTIMATOR, RATE
from messages.history.mending_state import Arrival
from tests.estimator.test_service import accel_batches

S = 10**9
EVERY_S = 0.05  # between two batches
SPAN_S = 80.0


def run(seconds: float, cost_s, begin_late_s: float = 0.0, devices: int = 1):
    """A machine that takes cost_s(now_s, coarse) for a batch of each device; how late each batch
    was that was taken, when, and the Overload.
    """
    overload, now_ns, late = Overload(), round(begin_late_s * S), []
    at_ns = 0
    while at_ns < (begin_late_s + seconds) * S:
        now_ns = max(now_ns, at_ns)  # it waits for samples
        for k in range(devices):
            if overload.take(f"d{k}", at_ns, now_ns):
                late.append((now_ns / S, (now_ns - at_ns) / S))
                now_ns += round(cost_s(now_ns / S, overload.of(f"d{k}").coarse) * S)
        at_ns += round(EVERY_S * S)
    return late, overload


def test_a_machine_fast_enough_leaves_nothing_out():
    late, overload = run(60.0, lambda now, coarse: 0.9 * EVERY_S)
    assert len(late) == 60.0 / EVERY_S
    assert not overload.of("d0").coarse and not overload.of("d0").skipped_s


@pytest.mark.parametrize("slow", [1.05, 2.0, 10.0])
def test_coarser_steps_are_enough_where_messages_are_what_costs(slow):
    late, overload = run(120.0, lambda now, coarse: EVERY_S * (0.3 if coarse else slow))
    state = overload.of("d0")
    assert len(late) == 120.0 / EVERY_S and not state.holes
    assert max(seen for _, seen in late) < LATE_S + (2 * LOOK_S + EVERY_S) * slow


@pytest.mark.parametrize("slow", [1.1, 1.5, 3.0, 30.0])
@pytest.mark.parametrize("devices", [1, 12])
def test_lateness_is_bounded_however_slow_the_machine_is(slow, devices):
    late, overload = run(SPAN_S, lambda now, coarse: slow * EVERY_S / devices, devices=devices)
    states = [overload.of(f"d{k}") for k in range(devices)]
    assert all(state.coarse for state in states) and any(state.holes for state in states)
    assert max(seen for _, seen in late) < HOLE_S + 3 * LOOK_S + slow * EVERY_S
    missing_s = SPAN_S * devices - EVERY_S * len(late)
    skipped_s, holes = (sum(s.skipped_s for s in states), sum(s.holes for s in states))
    assert missing_s == pytest.approx(skipped_s, abs=2 * EVERY_S * holes + 1.0)


def test_much_at_once_is_caught_up_with_and_nothing_is_left_out():
    late, overload = run(60.0, lambda now, coarse: EVERY_S / 5, begin_late_s=30.0)
    assert len(late) == round(90.0 / EVERY_S)
    assert not overload.of("d0").coarse and 30.0 / 4 < CATCH_UP_S


def test_after_a_busy_time_all_is_published_again_and_less_and_less_often_tried():
    cost = lambda now, coarse: EVERY_S * (0.2 if coarse else 1.5)  # noqa: E731
    _, overload = run(400.0, cost)
    again = overload.of("d0").calm_s
    assert again > 20.0
    _, overload = run(90.0, lambda now, coarse: EVERY_S * (3.0 if now < 30.0 else 0.5))
    state = overload.of("d0")
    assert not state.coarse and state.skipped_s > 10.0


class SlowPipeline(Pipeline):
    """Needs `slow` s for a second of samples, by a clock of its own."""

    def __init__(self, settings: EstimatorSettings, slow: float) -> None:
        super().__init__(settings)
        self.now_ns, self._slow = S, slow

    def on(self, topic, message):
        self.now_ns += round(self._slow * EVERY_S * S)
        return super().on(topic, message)


def test_the_status_counts_what_was_left_out_and_the_estimates_go_on_behind_it():
    said: list[Output] = []
    settings = EstimatorSettings(navigators=[], rate=["products-ekf"])
    pipeline = SlowPipeline(settings, 2.0)
    worker = Worker(pipeline, said.append, now_ns=lambda: pipeline.now_ns)
    batches = accel_batches(600)  # of 0.05 s
    for k, batch in enumerate(batches):
        at_ns = S + round(k * EVERY_S * S)
        worker.offer(Arrival(ACCEL, "cube", "", batch.SerializeToString(), at_ns))
    worker.finish()
    worker.work(threading.Event())
    assert worker.failure is None
    statuses = [output.message for output in said if output.topic is ESTIMATOR]
    rates = [output.message for output in said if output.topic is RATE]
    assert statuses[0].limit_hz == 0.0 and statuses[0].skipped_s == 0.0
    last = statuses[-1]
    assert last.limit_hz == COARSE_HZ and last.skipped_s > FRESH_S
    assert last.missing_samples * 0.01 == pytest.approx(last.skipped_s, abs=2 * EVERY_S)
    assert max(status.behind_s for status in statuses) > LATE_S
    indices = [m.for_index + k * m.index_step for m in rates for k in range(len(m.nis))]
    assert indices == sorted(set(indices)) and indices[-1] > 5 * len(batches) - 400
    thin = [m for m in rates if m.index_step > 1]
    assert {m.index_step for m in thin} == {20}  # 5 of 100 a second
    assert all(m.period_s == pytest.approx(0.2) and len(m.nis) == 1 for m in thin)
    assert {m.for_index % 20 for m in thin} == {19}
