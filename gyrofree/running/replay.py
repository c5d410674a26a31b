"""A recording found, and sent through the bus again."""

import threading
import time
from dataclasses import dataclass
from pathlib import Path

from gyrofree.config import Settings
from sessions.library.catalogue import Catalogue


def find(settings: Settings, session: str) -> Path:
    """MCAP file of an id or path; raises LookupError that says what there is."""
    try:
        if Path(session).is_file():
            return Path(session)
    except OSError as error:  # a name that no file can have
        raise LookupError(f"{session[:60]}: {error.strerror}") from None
    catalogue = Catalogue(Path(settings.recorder.root))
    try:
        return catalogue.path(session)
    except (LookupError, ValueError):
        ids = ", ".join(info.id for info in catalogue.list()[:5]) or "none"
        raise LookupError(
            f"no recording {session!r} in {settings.recorder.root}; newest there: {ids}"
        ) from None


class ReplayError(RuntimeError):
    """A replay that cannot begin; the text says why."""


@dataclass(frozen=True)
class Options:
    """How a recording is played."""

    speed: float = 1.0
    at_s: float = 0.0  # begin at this second of it
    paused: bool = False
    stay: bool = False  # wait at the end for orders
    rate: tuple[str, ...] = ()  # rate estimators instead of the configured ones
    overlay: bool = False  # publish the recorded estimates beside the new ones


def run(settings: Settings, path: Path, options: Options, stop: threading.Event) -> None:
    """Play a recording on the bus and obey the orders on <prefix>/replay/control. Raises
    ReplayError while another replay does.
    """
    from estimator.pipeline import Pipeline
    from messages.bus import orders
    from messages.bus.claiming import claim
    from messages.bus.session import Publishers
    from messages.bus.turns import sessions
    from messages.contract.topics import REPLAY, claim_key
    from sessions.replay.playback import Playback
    from sessions.replay.replay import DRAIN_S, Outlet

    estimator = settings.estimator
    if options.rate:
        estimator = estimator.model_copy(update={"rate": list(options.rate)})
    Pipeline(estimator)  # names that do not exist are refused now
    prefix, others = settings.bus.prefix, []
    with sessions(settings.bus, stop) as mine:
        if mine is None:
            return
        bases = [claim_key(prefix, REPLAY.source)]
        claimed = claim(mine, bases, time.time_ns(), stop, others.append, wait=False)
        if others:
            raise ReplayError(
                f"another replay runs on this bus ({others[0]}): end it first, or give this one"
                " another [bus] prefix"
            )
        if claimed is None:
            return
        session = mine.session
        outlet, publishers = Outlet(session, prefix), Publishers(session, prefix)
        publishers.number = claimed.number
        playback = Playback(
            path,
            outlet.put,
            lambda: Pipeline(estimator),
            speed=options.speed,
            at_s=options.at_s,
            paused=options.paused,
            show_recorded=options.overlay,
        )
        control = orders.take(
            session,
            prefix,
            orders.REPLAY,
            lambda order: playback.order(order.command, order.answer),
        )
        try:
            playback.run(
                stop, lambda status: publishers.put(REPLAY, REPLAY.name, status), options.stay
            )
            stop.wait(DRAIN_S)
        finally:
            control.undeclare()
            claimed.release()
