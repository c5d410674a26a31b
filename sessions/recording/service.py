"""The recorder as a service: its bus, its loop, and what earlier runs of it left to recover."""

import logging
import threading
import time
from pathlib import Path

from messages.bus import orders
from messages.bus.session import BusSettings, BusUnavailable, Publishers, open_client
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
    waited for.
    """
    try:
        session = open_client(bus, stop)
    except BusUnavailable:
        if stop.is_set():
            return
        raise
    with session:
        publishers = Publishers(session, bus.prefix)
        asker = Asker(
            session, bus.prefix, lambda question, reply: recorder.on_answer(question, reply)
        )
        recorder = Recorder(
            settings, bus, configuration, lambda q: asker.ask(q, *q.stream, q.query)
        )
        samples = session.declare_subscriber(f"{bus.prefix}/**", recorder.on_sample)
        control = orders.take(session, bus.prefix, orders.RECORDER, recorder.on_order)
        fence = recorder.fence.declare(session, bus.prefix)
        _go_on(recorder, settings.root)
        # the session that begins now has its session.json before recovery looks at the folders
        recorder.step()
        # Beside the recording, not before it: a large file takes a minute, and what runs is locked
        # against recovery.
        # When the process ends first, the session stays open and the next start does it.
        threading.Thread(target=_tend, args=(settings,), name="recovery", daemon=True).start()
        next_status = 0.0
        try:
            while not stop.is_set():
                recorder.step()
                if time.monotonic() >= next_status:
                    next_status = time.monotonic() + STATUS_S
                    publishers.put(STATUS, RECORDER, recorder.status())
                recorder.wake.wait(DRAIN_S)
        finally:
            samples.undeclare()
            control.undeclare()
            fence.undeclare()
            recorder.close()
            asker.close()
            publishers.put(STATUS, RECORDER, recorder.status())


def _tend(settings: RecorderSettings) -> None:
    """Recover what was cut off; then the rules of retention, if there are any."""
    recover_all(settings.root)
    rule = Retention(settings.keep_days, settings.keep_bytes)
    if rule != Retention():
        retain(Catalogue(settings.root), rule)


def _go_on(recorder: Recorder, root: Path) -> None:
    """Recover the session that a crash cut off a moment ago, and go on with it; older ones are not
    gone on with.
    """
    folder = cut_off(root, RESUME_S, RESUME_BYTES)
    if folder is None:
        return
    recorder.listen()  # a recovery takes a second: what comes meanwhile belongs to the next session
    try:
        manifest = recover_session(folder)
    except (SessionError, OSError) as error:
        log.error("recovery: %s", error)
        return
    if manifest is not None:
        recorder.resume(manifest)
