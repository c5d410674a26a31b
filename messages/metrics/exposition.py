"""Messages become figures when somebody asks: nothing is counted twice, and nothing is made up.

A topic that has been silent for longer than SILENT_S gives no figures, only its age: what is not
known now is absent, and a rule with `absent()` or on the age sees it.
"""

import threading
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from google.protobuf.message import Message
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric

from messages.contract import topics as tp
from messages.contract.topics import Topic
from messages.metrics.table import FIGURES, TOPICS, labels_of

SILENT_S = 10.0  # s; the slowest topic of the table comes every two
MOST = 4096  # streams that are remembered; a foreign publisher cannot fill the memory
AGE = (
    "gyrofree_message_age_seconds",
    "since the newest message of a topic; figures of one older than 10 s are absent",
    ("topic", "device", "estimator"),
)
PUBLISHED = (
    "gyrofree_published_messages_total",
    "messages that this process has published",
    ("topic", "device", "estimator"),
)


@dataclass(frozen=True)
class Said:
    """The newest message of a stream."""

    topic: Topic
    device: str
    estimator: str
    message: Message
    arrived: float  # s, monotonic


class Newest:
    """The newest messages that a process has published itself, and how many it did."""

    def __init__(self) -> None:
        self._said: dict[tuple[str, str, str], Said] = {}
        self._count: Counter[tuple[str, str, str]] = Counter()
        self._lock = threading.Lock()

    def take(self, topic: Topic, device: str, estimator: str, message: Message) -> None:
        """One message, as it is published; called for each, so it is short."""
        key = (topic.name, device, estimator)
        with self._lock:
            if key in self._count or len(self._count) < MOST:
                self._count[key] += 1
                if topic.name in TOPICS:
                    copy = type(message)()
                    copy.CopyFrom(message)  # its publisher may go on with it
                    self._said[key] = Said(topic, device, estimator, copy, time.monotonic())

    def said(self) -> list[Said]:
        """Of the topics that have figures."""
        with self._lock:
            return list(self._said.values())

    def counts(self) -> list[Metric]:
        """What was published."""
        with self._lock:
            counted = dict(self._count)
        name, text, labels = PUBLISHED
        return [family_of(name, "counter", text, labels, counted)]


class OfMessages:
    """A collector of what messages say. `said` gives the newest of each stream."""

    def __init__(self, said: Callable[[], Iterable[Said]]) -> None:
        self._said = said

    def collect(self) -> Iterator[Metric]:
        """All families; called by the library."""
        now = time.monotonic()
        said = list(self._said())
        ages = {(one.topic.name, one.device, one.estimator): now - one.arrived for one in said}
        yield family_of(AGE[0], "gauge", *AGE[1:], ages)
        fresh: dict[str, list[Said]] = {}
        for one in said:
            if now - one.arrived <= SILENT_S:
                fresh.setdefault(one.topic.name, []).append(one)
        for figure in FIGURES:
            labels = (*labels_of(figure.topic), *figure.labels)
            found: dict[tuple[str, ...], float] = {}  # each series once, whatever was published
            for one in fresh.get(figure.topic.name, []):
                own = _own(one)
                found |= {(*own, *more): value for more, value in figure.values(one.message)}
            if found:
                yield family_of(figure.name, figure.kind, figure.text, labels, found)


def family_of(
    name: str,
    kind: str,
    text: str,
    labels: Iterable[str] = (),
    values: Mapping[tuple[str, ...], float] = MappingProxyType({}),
) -> Metric:
    """A family of figures, by the values of their labels."""
    made = CounterMetricFamily if kind == "counter" else GaugeMetricFamily
    family = made(name.removesuffix("_total"), text, labels=tuple(labels))
    for each, value in values.items():
        family.add_metric(each, value)
    return family


def _own(one: Said) -> tuple[str, ...]:
    if one.topic is tp.STATUS:
        return ()
    return (one.device, one.estimator) if one.topic.per_estimator else (one.device,)
