"""The figures of /metrics: what all services say of themselves, and what the dashboard says."""

from collections.abc import Iterator

import prometheus_client
from prometheus_client.core import CollectorRegistry, Metric
from prometheus_client.exposition import choose_encoder

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
OWN = (ENDED, REFUSED, DROPPED, STREAMS, DEVICES)


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
