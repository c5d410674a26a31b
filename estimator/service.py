"""The estimator process: samples in, motion out, on the bus.

A shell: the pipeline is pipeline.py, its thread worker.py. With a journal folder what is published
is kept and the state is saved (saved_state.py), so that it goes on after a crash as before it.
"""

import logging
import threading
from collections.abc import Callable
from typing import Any

import zenoh

from estimator.output import Output
from estimator.pipeline import Pipeline
from estimator.saved_state import SavedState, version
from estimator.settings import EstimatorSettings
from estimator.worker import Worker
from messages.bus import orders
from messages.bus.claiming import Claim
from messages.bus.fencing import Fence
from messages.bus.session import BusSettings, Publishers
from messages.bus.turns import in_turn, sessions
from messages.clock import elapsed_ns
from messages.contract.door import Door
from messages.contract.topics import ESTIMATES, PIPELINE_INPUTS, REPLAY_SUFFIX
from messages.history.answers import Asker, declare
from messages.history.journal_folder import JournalBusy
from messages.history.mending_state import Arrival
from messages.history.spool import Spool

log = logging.getLogger(__name__)

LOOK_S = 0.2  # between two looks at what may end it
GONE_S = 600.0  # a device silent for so long makes room where there is none left
WAITING_S = 300.0  # for a gateway that is there and does not answer; its samples wait meanwhile
END_S = 3.0  # for what is queued when the service is to end


def run(settings: EstimatorSettings, bus: BusSettings, stop: threading.Event) -> None:
    """Estimate until `stop` is set; sets it itself and raises when the worker fails. A second
    estimator waits, whichever filters it has: what it would say of a board's axes, and do with an
    order, would be said and done twice. One that was stopped while another took its place does too.
    """
    Pipeline(settings)  # raises at once for settings that name what does not exist
    with sessions(bus, stop) as mine:
        if mine is not None:
            in_turn(
                mine,
                bus.prefix,
                ESTIMATES,
                stop,
                lambda claimed: _serve(settings, bus, mine.session, claimed, stop),
            )


def _serve(
    settings: EstimatorSettings,
    bus: BusSettings,
    session: zenoh.Session,
    claimed: Claim,
    stop: threading.Event,
) -> None:
    """Estimate until `stop`, or until another has claimed the same."""
    spool = _open_spool(settings)
    publishers = Publishers(session, bus.prefix, spool)
    if spool is not None:
        spool.journal.outrun(claimed.number - 1)
        claimed.raise_to(spool.journal.run)
    publishers.number = claimed.number
    fence = Fence(lambda *refusal: worker.door.refuse(*refusal))
    asker = Asker(
        session,
        bus.prefix,
        lambda question, reply: worker.answered(question, reply),
        fence,
        patience_s=WAITING_S,
    )
    saved = SavedState(settings.journal, settings, version()) if spool is not None else None
    trouble = _trouble(saved, spool)
    worker = _worker(Pipeline(settings), publishers, asker, saved, settings, trouble)
    failed = threading.Event()
    thread = threading.Thread(target=worker.work, args=(failed,), name="estimator", daemon=True)
    thread.start()
    answering = [declare(session, bus.prefix, "*", ESTIMATES, spool)] if spool is not None else []
    # One subscriber for all topics: each has a thread of its own, and a fix must not overtake
    # its samples.
    subscriber = session.declare_subscriber(f"{bus.prefix}/*/*", _on(worker, fence))
    answering += [
        orders.take(session, bus.prefix, orders.ESTIMATOR, worker.take_order, "*"),
        fence.declare(session, bus.prefix),
    ]
    log.info(
        "estimating: rate %s; navigation %s",
        ", ".join(settings.rate),
        ", ".join(settings.navigators),
    )
    while not (stop.is_set() or failed.is_set() or claimed.lost.is_set()):
        stop.wait(LOOK_S)
    if claimed.lost.is_set():
        publishers.hold()
    subscriber.undeclare()
    worker.finish()
    thread.join(timeout=END_S)
    # the next start goes on from the saved state, and this one's words go nowhere
    behind = thread.is_alive()
    for queryable in answering:
        queryable.undeclare()
    asker.close()
    if spool is not None:
        spool.close()
    if behind and not claimed.lost.is_set():
        log.warning(
            "ended while samples waited%s",
            ": the next start takes them up" if saved is not None else "",
        )
        return
    if worker.failure is not None:
        stop.set()
        raise worker.failure
    if saved is not None:
        saved.forget()


def _worker(
    pipeline: Pipeline,
    publishers: Publishers,
    asker: Asker,
    saved: SavedState | None,
    settings: EstimatorSettings,
    trouble: Callable[[], str],
) -> Worker:
    """A worker that goes on from the saved state when there is one."""
    found = saved.load() if saved is not None else None
    publishers.resume()
    if found is not None:
        pipeline = found[0]
        publishers.repeat(found[2])

    def put(output: Output) -> None:
        publishers.put(output.topic, output.device, output.message, output.estimator)

    worker = Worker(
        pipeline,
        put,
        lambda question: asker.ask(question, *question.stream, question.query),
        None if saved is None else lambda worker: saved.save(worker, publishers),
        Door("estimator", most_devices=settings.max_devices, gone_s=GONE_S),
        trouble,
    )
    if found is not None:
        for (device, name), (run_, last) in found[1].items():
            worker.mender.seed(device, name, run_, last)
        log.info("going on from the state of before: %d inputs known", len(found[1]))
    return worker


def _trouble(saved: SavedState | None, spool: Spool | None) -> Callable[[], str]:
    """What cannot be kept at this moment, for people."""

    def trouble() -> str:
        kept = "" if spool is None else spool.journal.message
        state = "" if saved is None else saved.message
        return "; ".join(filter(None, (state, kept and f"estimates are not kept: {kept}")))

    return trouble


def _open_spool(settings: EstimatorSettings) -> Spool | None:
    if settings.journal is None:
        return None
    try:
        return Spool(settings.journal, settings.journal_bytes, settings.journal_age_s)
    except JournalBusy as busy:
        log.error("%s; estimates are published, but not kept for who misses some", busy)
        return None


def _on(worker: Worker, fence: Fence) -> Callable[[Any], None]:
    def on_sample(sample: Any) -> None:
        key = str(sample.key_expr)
        address = worker.door.address(key)
        # a replay makes its own estimates
        if address is None or address.device.endswith(REPLAY_SUFFIX):
            return
        if (
            address.topic in PIPELINE_INPUTS
            and worker.door.admit(key, address, len(sample.payload))
            and fence.admit(key, sample.attachment)
        ):
            for gone in worker.door.gone():
                worker.forget(gone)
            payload = sample.payload.to_bytes()
            worker.offer(
                Arrival(address.topic, address.device, address.estimator, payload, elapsed_ns())
            )

    return on_sample
