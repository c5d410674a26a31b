"""The figures of /metrics: what all services say of themselves, and what the dashboard says."""

from collections.abc import Iterator

import prometheus_client
from prometheus_client.core import CollectorRegistry, Metric
from prometheus_client.exposition import choose_encoder

from dashboard.data.places import places
from dashboard.data.store import Store
from dashboard.web.front import Front
from messages.contract import topics as tp
from messages.metrics.exposition import OfMessages, Said, family_of
from messages.metrics.own import Disks
from messages.metrics.table import TOPICS

ENDED = (
    "gyrofree_dashboard_connections_ended_total",
    "counter",
    "connections that the dashboard ended, by the reason",
    ("reason",),
)
REFUSED = (
    "gyrofree_dashboard_refused_messages_total",
    "counter",
    "messages that are not shown, by what was wrong",
    ("reason",),
)
DROPPED = (
    "gyrofree_dashboard_dropped_messages_total",
    "counter",
    "messages that the dashboard could not keep up with",
    (),
)
STREAMS = ("gyrofree_dashboard_streams", "gauge", "streams of values that are open", ())
DEVICES = ("gyrofree_dashboard_devices", "gauge", "devices that the dashboard has heard", ())
OF_SERVICE = ("place", "service")
RUNNING = (
    "gyrofree_service_running",
    "gauge",
    "1 for a process that runs, 0 for one that hangs, is frozen, gone or not known",
    OF_SERVICE,
)
SILENT = (
    "gyrofree_service_silent_seconds",
    "gauge",
    "since its last sign of life, of which there are two a second",
    OF_SERVICE,
)
TURN = (
    "gyrofree_service_turn_age_seconds",
    "gauge",
    "since the last turn of its loop that stands longest, measured by what a turn may take",
    OF_SERVICE,
)
TURN_MOST = (
    "gyrofree_service_turn_limit_seconds",
    "gauge",
    "what a turn of that loop may take; a process beyond it hangs",
    OF_SERVICE,
)
CLOCK = (
    "gyrofree_service_clock_ahead_seconds",
    "gauge",
    "its clock minus home's, where that was measured",
    OF_SERVICE,
)
CERTIFICATE = (
    "gyrofree_service_certificate_end_timestamp_seconds",
    "gauge",
    "when its certificate ends, since 1970",
    OF_SERVICE,
)
OWN = (
    ENDED,
    REFUSED,
    DROPPED,
    STREAMS,
    DEVICES,
    RUNNING,
    SILENT,
    TURN,
    TURN_MOST,
    CLOCK,
    CERTIFICATE,
)


class Page:
    """What the dashboard counts."""

    def __init__(self, front: Front, streams: int) -> None:
        self._front, self._streams = front, streams

    def collect(self) -> Iterator[Metric]:
        """For the library."""
        ended = {(why,): float(count) for why, count in dict(self._front.ended).items()}
        yield family_of(*ENDED, ended)
        yield family_of(*STREAMS, {(): float(self._streams)})
        store = self._front.store
        if store is None:
            return
        refused = {(kind,): float(count) for kind, count in store.door.counts().items()}
        yield family_of(*REFUSED, refused)
        yield family_of(*DROPPED, {(): float(store.dropped)})
        yield family_of(*DEVICES, {(): float(len(store.names()))})
        yield from _presence(store)


def _presence(store: Store) -> Iterator[Metric]:
    """Of every process, as the page of places has it; what is not known is absent."""
    services = {
        (place["name"], one["name"]): one
        for place in places(store.presence)
        for one in place["services"]
    }
    fields = (
        (SILENT, "silent_s"),
        (TURN, "turn_ago_s"),
        (TURN_MOST, "turn_most_s"),
        (CLOCK, "clock_ahead_s"),
        (CERTIFICATE, "certificate_ends_s"),
    )
    running = {key: float(one["state"] == "running") for key, one in services.items()}
    yield family_of(*RUNNING, running)
    for figure, field in fields:
        known = {key: one[field] for key, one in services.items() if one[field] is not None}
        yield family_of(*figure, known)


def text(front: Front, streams: int, accept: str) -> tuple[bytes, str]:
    """All figures in the format that the asker prefers, and its name."""
    registry = CollectorRegistry(auto_describe=False)
    prometheus_client.ProcessCollector(registry=registry)
    settings = front.settings
    folders = {
        "dashboard.sessions_root": settings.sessions_root,
        "dashboard.users": settings.users.parent,
    }
    store = front.store
    said = OfMessages(lambda: [] if store is None else list(_said(store)))
    for collector in (Disks(folders), Page(front, streams), said):
        registry.register(collector)  # type: ignore[arg-type]
    encoder, kind = choose_encoder(accept)
    return encoder(registry), kind


def _said(store: Store) -> Iterator[Said]:
    """The newest of each stream that has figures; a replay is none of this bench's services."""
    with store.lock:
        if store.recorder is not None:
            yield Said(tp.STATUS, tp.RECORDER, "", store.recorder.message, store.recorder.arrived)
        for name, device in store.devices.items():
            for (topic, estimator), newest in device.latest.items():
                heard = newest.arrived > 0.0  # not asked for later, as the past is
                if topic in TOPICS and heard and not name.endswith(tp.REPLAY_SUFFIX):
                    yield Said(tp.BY_NAME[topic], name, estimator, newest.message, newest.arrived)
