"""The recorder as a service: its bus, its loop, and what earlier runs of it left to recover."""

import logging
import threading
import time
from pathlib import Path

import zenoh

from messages.bus import orders
from messages.bus.claiming import Claim
from messages.bus.session import BusSettings, Publishers, subscribe
from messages.bus.turns import in_turn, sessions
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import RECORDER, STATUS
from messages.history.answers import Asker
from sessions.library.catalogue import Catalogue
from sessions.library.remove import Retention, retain
from sessions.recording.manifest import SessionError
from sessions.recording.recorder import DRAIN_S, Recorder
from sessions.recording.recover import cut_off, recover_all, recover_session
from sessions.recording.settings import RecorderSettings

log = logging.getLogger(__name__)

STATUS_S = 1.0
RESUME_S = 600.0  # a session that was cut off within this time is gone on with
RESUME_BYTES = 256 * 1024**2  # larger ones are recovered beside the recording, and not gone on with


def run(
    settings: RecorderSettings,
    bus: BusSettings,
    stop: threading.Event,
    configuration: dict[str, object] | None = None,
) -> None:
    """Record until `stop` is set; then the running session is closed.

    `configuration` goes into session.json of every session. A router that is not there yet is
    waited for. While another recorder serves, this one waits; it takes over what was recorded.
    """
    with sessions(bus, stop) as mine:
        if mine is None:
            return
        status = _Heard()
        listening = subscribe(mine.session, STATUS, bus.prefix, status.take, RECORDER)

        def serve(claimed: Claim) -> None:
            _serve(settings, bus, configuration, mine.session, claimed, status.of_another, stop)
            status.forget()

        in_turn(mine, bus.prefix, STATUS.source, stop, serve)
        listening.undeclare()


class _Heard:
    """What another recorder last said."""

    def __init__(self) -> None:
        self.of_another = pb.RecorderStatus()

    def take(self, _: str, status: pb.RecorderStatus) -> None:
        """Zenoh's thread."""
        self.of_another.CopyFrom(status)

    def forget(self) -> None:
        """It was ourselves."""
        self.of_another.Clear()


def _serve(
    settings: RecorderSettings,
    bus: BusSettings,
    configuration: dict[str, object] | None,
    session: zenoh.Session,
    claimed: Claim,
    before: pb.RecorderStatus,
    stop: threading.Event,
) -> None:
    """Record until `stop`, or until another recorder has taken over; go on with what the one
    `before` recorded when it was gone.
    """
    publishers = Publishers(session, bus.prefix)
    publishers.number = claimed.number
    recorder = Recorder(settings, bus, configuration, lambda q: asker.ask(q, *q.stream, q.query))
    asker = Asker(session, bus.prefix, recorder.on_answer, recorder.fence)
    samples = session.declare_subscriber(f"{bus.prefix}/**", recorder.on_sample)
    control = orders.take(session, bus.prefix, orders.RECORDER, recorder.on_order)
    fence = recorder.fence.declare(session, bus.prefix)
    if not _go_on(recorder, settings.root) and before.recording:
        recorder.take_over(before.session)
    # the session that begins now has its session.json before recovery looks at the folders
    recorder.step()
    # Beside the recording, not before it: a large file takes a minute, and what runs is locked
    # against recovery.
    # When the process ends first, the session stays open and the next start does it.
    threading.Thread(target=_tend, args=(settings,), name="recovery", daemon=True).start()
    next_status, said = 0.0, None
    try:
        with recorder.loop:
            while not (stop.is_set() or claimed.lost.is_set()):
                recorder.loop.turn()
                recorder.step()
                # at once where it begins or ends: who takes over goes on by what was heard last
                if time.monotonic() >= next_status or recorder.recording != said:
                    next_status, said = time.monotonic() + STATUS_S, recorder.recording
                    publishers.put(STATUS, RECORDER, recorder.status())
                recorder.wake.wait(DRAIN_S)
    finally:
        samples.undeclare()
        control.undeclare()
        fence.undeclare()
        recorder.close()
        asker.close()
        if not claimed.lost.is_set():
            publishers.put(STATUS, RECORDER, recorder.status())


def _tend(settings: RecorderSettings) -> None:
    """Recover what was cut off; then the rules of retention, if there are any."""
    recover_all(settings.root)
    rule = Retention(settings.keep_days, settings.keep_bytes)
    if rule != Retention():
        retain(Catalogue(settings.root), rule)


def _go_on(recorder: Recorder, root: Path) -> bool:
    """Recover the session that a crash cut off a moment ago, and go on with it; older ones are not
    gone on with. False: there is none.
    """
    folder = cut_off(root, RESUME_S, RESUME_BYTES)
    if folder is None:
        return False
    recorder.listen()  # a recovery takes a second: what comes meanwhile belongs to the next session
    try:
        manifest = recover_session(folder)
    except (SessionError, OSError) as error:
        log.error("recovery: %s", error)
        return False
    if manifest is not None:
        recorder.resume(manifest)
    return manifest is not None
