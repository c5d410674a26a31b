"""The estimator on a bus with holes, and after a crash: the same estimates under the same numbers,
none twice.
"""

import threading

import pytest

from estimator.output import Output
from estimator.pipeline import Pipeline
from estimator.saved_state import SavedState
from estimator.settings import EstimatorSettings
from estimator.worker import Worker
from inertial.calibration.card import make_card, write_card
from inertial.calibration.fit import fit
from inertial.calibration.poses import collect, find, plan
from inertial.layouts.catalogue import find as find_layout
from inertial.simulation.imperfect import device as imperfect
from inertial.simulation.imperfect import tumble
from messages.bus.session import Publishers
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import ACCEL, ESTIMATOR, GATEWAY, RATE
from messages.history.mending_state import Arrival, Question
from messages.history.spool import Spool
from tests.estimator.test_service import accel_batches

SETTINGS = EstimatorSettings(navigators=[])
BATCHES = 300


def arrivals() -> list[Arrival]:
    return [
        Arrival(ACCEL, "cube", "", batch.SerializeToString(), 0) for batch in accel_batches(BATCHES)
    ]


def published(spool: Spool) -> list[tuple[str, int, bytes]]:
    """Topic, sequence and bytes of everything but the status, which carries a measured time."""
    items = spool.answer(pb.HistoryQuery(max_bytes=1 << 30), "cube").items
    return [
        (i.topic, i.sequence, i.payload) for i in items if not i.topic.startswith(ESTIMATOR.name)
    ]


def work(worker: Worker, some: list[Arrival]) -> None:
    for arrival in some:
        worker.offer(arrival)
    worker.finish()
    worker.work(threading.Event())
    assert worker.failure is None


def put_into(publishers: Publishers):
    def put(output: Output) -> None:
        publishers.put(output.topic, output.device, output.message, output.estimator)

    return put


def test_after_a_crash_everything_goes_on_as_if_there_had_been_none(tmp_path):
    inputs = arrivals()
    whole = Spool(tmp_path / "whole")
    work(Worker(Pipeline(SETTINGS), put_into(Publishers(None, "p", whole))), inputs)
    expected = published(whole)
    whole.close()
    assert len(expected) > 2 * BATCHES

    folder = tmp_path / "estimates"
    spool = Spool(folder)
    publishers = Publishers(None, "p", spool)
    state = SavedState(folder, SETTINGS, "1")
    first = Worker(Pipeline(SETTINGS), put_into(publishers))
    work(first, inputs[:120])
    state.save(first, publishers)
    work(first, inputs[120:170])  # the crash comes here: published, but not in the saved state
    spool.close()

    spool = Spool(folder)
    publishers = Publishers(None, "p", spool)
    publishers.resume()
    assert SavedState(folder, SETTINGS, "2").load() is None  # of another version
    pipeline, taken, sequences = SavedState(folder, SETTINGS, "1").load()
    publishers.repeat(sequences)
    gateway = Spool(tmp_path / "gateway")
    for arrival in inputs:
        batch = pb.AccelBatch.FromString(arrival.payload)
        gateway.append(
            "accel", "cube", 7, batch.header.sequence, batch.header.utc_ns, arrival.payload
        )
    asked: list[Question] = []

    def ask(question: Question) -> None:
        asked.append(question)
        second.answered(question, gateway.answer(question.query, question.stream[0]))

    second = Worker(pipeline, put_into(publishers), ask)
    for (device, name), (run, last) in taken.items():
        second.mender.seed(device, name, run, last)
    work_with_answers(second, inputs[200:])  # what came between is asked of the gateway
    assert [question.stream for question in asked] == [("cube", GATEWAY)]
    assert published(spool) == expected
    gateway.close()
    spool.close()


def work_with_answers(worker: Worker, some: list[Arrival]) -> None:
    """Like `work`, but the end comes behind the answers that the messages ask for."""
    for arrival in some:
        worker.offer(arrival)
    thread = threading.Thread(target=worker.work, args=(threading.Event(),))
    thread.start()
    while len(worker.inbox) or worker.mender.asking:
        thread.join(0.05)
    worker.finish()
    thread.join(60.0)
    assert not thread.is_alive() and worker.failure is None


def test_what_nobody_kept_is_a_gap_for_the_estimators_and_no_end():
    inputs = arrivals()
    outputs: list[Output] = []
    worker = Worker(Pipeline(SETTINGS), outputs.append)
    work_with_answers(worker, inputs[:50] + inputs[80:100])
    assert worker.mender.counts() == {"cube/accel": (0, 30)}
    indices = {o.message.for_index for o in outputs if o.topic is RATE}  # five samples in a batch
    assert max(indices) >= 495 and not any(250 <= index < 400 for index in indices)


def life(folder, settings: EstimatorSettings) -> tuple[Worker, Spool]:
    """One life of an estimator, from the saved state when there is one."""
    spool = Spool(folder)
    publishers, state = Publishers(None, "p", spool), SavedState(folder, settings, "1")
    publishers.resume()
    pipeline, taken, sequences = state.load() or (Pipeline(settings), {}, {})
    if sequences:
        publishers.repeat(sequences)
    worker = Worker(
        pipeline, put_into(publishers), save=lambda worker: state.save(worker, publishers)
    )
    for (device, name), (run, last) in taken.items():
        worker.mender.seed(device, name, run, last)
    return worker, spool


@pytest.mark.parametrize("cards", [1, 2])
def test_an_estimator_killed_right_after_an_order_goes_on_with_the_card_that_was_ordered(
    tmp_path, cards
):
    layout = find_layout("cube", 0.05)
    readings = tumble(imperfect(layout, 11), plan(14))
    found, noise = find(readings, 0.01)
    solved = fit(layout, collect(readings, found), noise=noise)
    settings = EstimatorSettings(navigators=[], rate=["products-ekf"], cards=tmp_path / "cards")
    named = []
    for k in range(cards):
        date = f"2026-01-0{k + 1}T03:04:05Z"
        card = make_card(solved, layout, layout.axis_names, device="cube", date=date, poses=14)
        write_card(card, settings.cards / f"{card.id}.toml")
        named.append(card.id)
    inputs, folder = arrivals(), tmp_path / "estimates"
    first, spool = life(folder, settings)
    work(first, inputs[:20])
    answers: list[pb.Reply] = []
    for name in named:
        action = pb.EstimatorCommand.ACTION_USE_CARD
        first.order(pb.EstimatorCommand(action=action, device="cube", card=name), answers.append)
    work(first, [])  # killed before the next sample
    assert [answer.ok for answer in answers] == [True] * cards
    spool.close()
    second, spool = life(folder, settings)
    work(second, inputs[20:60])
    said = [
        pb.RateBatch.FromString(p)
        for topic, _, p in published(spool)
        if topic == "rate/products-ekf"
    ]
    assert [m.for_index for m in said] == sorted({m.for_index for m in said})
    assert [m.header.sequence for m in said] == list(range(1, len(said) + 1))
    assert [m.calibration for m in said] == [""] * 20 + [named[-1]] * 40
    spool.close()


def test_a_full_disk_costs_the_state_only_as_long_as_it_is_full(tmp_path, caplog):
    spool = Spool(tmp_path)
    publishers, saved = Publishers(None, "p", spool), SavedState(tmp_path, SETTINGS, "1")
    worker = Worker(Pipeline(SETTINGS), put_into(publishers))
    work(worker, arrivals()[:20])
    (tmp_path / "state.new").symlink_to("/dev/full")
    saved.save(worker, publishers)
    assert "No space left" in saved.message and "free some space" in caplog.text
    assert saved.load() is None
    saved.save(worker, publishers)
    assert not saved.message and "saved again" in caplog.text
    assert saved.load() is not None
    spool.close()
