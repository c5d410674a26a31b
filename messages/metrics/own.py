"""What a process says of itself: what it publishes, logs, and how much room there is for it."""

import logging
import shutil
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import prometheus_client
from prometheus_client.core import CollectorRegistry, Metric

from messages.bus.session import Publishers
from messages.metrics.exposition import Newest, OfMessages, family_of

LOGGED = ("gyrofree_log_messages_total", "counter", "lines of this process's log", ("level",))
FREE = ("gyrofree_disk_free_bytes", "gauge", "room on the disk of a folder", ("folder",))
SIZE = ("gyrofree_disk_size_bytes", "gauge", "size of that disk", ("folder",))


class Counting(logging.Handler):
    """Counts lines by their level, and writes none."""

    def __init__(self) -> None:
        super().__init__()
        self.lines: Counter[str] = Counter()

    def emit(self, record: logging.LogRecord) -> None:
        """Count one."""
        self.lines[record.levelname.lower()] += 1

    def collect(self) -> Iterator[Metric]:
        """For the library."""
        counted = {(level,): float(count) for level, count in self.lines.items()}
        name, kind, text, labels = LOGGED
        yield family_of(name, kind, text, labels, counted)


class Disks:
    """Room on the disks of named folders, as it is when somebody asks."""

    def __init__(self, folders: dict[str, Path]) -> None:
        """folders: by the key of the configuration that names them."""
        self._folders = folders

    def collect(self) -> Iterator[Metric]:
        """For the library. A folder that is not there has no figure."""
        found = {}
        for name, folder in self._folders.items():
            there = next((one for one in (folder, *folder.parents) if one.exists()), None)
            if there is not None:
                found[(name,)] = shutil.disk_usage(there)
        for (name, kind, text, labels), field in ((FREE, "free"), (SIZE, "total")):
            values = {key: float(getattr(usage, field)) for key, usage in found.items()}
            yield family_of(name, kind, text, labels, values)


class Own:
    """The figures of this process."""

    def __init__(self, folders: dict[str, Path]) -> None:
        self.newest, self._logged = Newest(), Counting()
        self.registry = CollectorRegistry(auto_describe=False)
        prometheus_client.ProcessCollector(registry=self.registry)
        prometheus_client.GCCollector(registry=self.registry)
        self._add(self._logged, Disks(folders), OfMessages(self.newest.said))
        self._add(_Collected(self.newest.counts))

    def watch(self) -> None:
        """From now on: what is published and logged."""
        Publishers.heard = self.newest.take
        logging.getLogger().addHandler(self._logged)

    def _add(self, *collectors: object) -> None:
        for each in collectors:
            self.registry.register(each)  # type: ignore[arg-type]


class _Collected:
    def __init__(self, families: Callable[[], Iterable[Metric]]) -> None:
        self.collect = families
