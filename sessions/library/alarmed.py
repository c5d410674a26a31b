"""When what was wrong, of the alarms in a recording (topic alarm)."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import ALARM
from messages.text import plain
from sessions.export.table import Selection, messages
from sessions.recording.mcap_damage import Damage

LEVELS = {
    pb.Alarm.LEVEL_WATCH: "watch",
    pb.Alarm.LEVEL_WARNING: "warning",
    pb.Alarm.LEVEL_CRITICAL: "critical",
}


@dataclass(frozen=True)
class Episode:
    """One alarm from its beginning to its end."""

    device: str  # that the status was about; alarms of the bench stand in every device's
    of_bench: bool
    id: str
    title: str
    level: str
    begin_ns: int  # UTC
    end_ns: int  # 0: it had not ended
    acknowledged_by: str = ""
    acknowledged_ns: int = 0
    note: str = ""
    first_out: bool = False


class Episodes:
    """Collects them out of statuses, in any order that a recording has."""

    def __init__(self) -> None:
        self._found: dict[tuple[str, str, int], Episode] = {}

    def take(self, status: pb.AlarmStatus) -> None:
        """One status."""
        device = status.header.device
        for one in status.alarms:
            if not one.raised_utc_ns:
                continue
            key = device, one.id if one.device else f"bench/{one.id}", one.raised_utc_ns
            before = self._found.get(key)
            title = plain(one.title) if before is None else before.title
            self._found[key] = Episode(
                device,
                not one.device,
                plain(one.id),
                title,
                LEVELS.get(one.level, "watch"),
                one.raised_utc_ns,
                one.returned_utc_ns,
                plain(one.acknowledged_by),
                one.acknowledged_utc_ns,
                plain(one.note),
                one.first_out,
            )

    def result(self) -> list[Episode]:
        """In the order of their beginnings."""
        return sorted(self._found.values(), key=lambda one: (one.begin_ns, one.device, one.id))

    def ranges(self, first_ns: int, last_ns: int) -> Iterator[tuple[float, str, float]]:
        """Begin, s after first_ns, words and length, s, of those between two moments; one of the
        bench stands in every device's status, and once here.
        """
        seen = set()
        for one in self.result():
            about = (one.id if one.of_bench else f"{one.device}/{one.id}"), one.begin_ns
            begin_ns, end_ns = max(one.begin_ns, first_ns), min(one.end_ns or last_ns, last_ns)
            if about not in seen and begin_ns <= end_ns:
                length_s = max((end_ns - begin_ns) / 1e9, 1e-3)
                yield (begin_ns - first_ns) / 1e9, f"{one.level}: {one.title}", length_s
            seen.add(about)


def episodes(paths: Iterable[Path]) -> list[Episode]:
    """Of the files of a recording. Raises OSError."""
    found = Episodes()
    for path in paths:
        # what is damaged is told by the reading that takes the samples
        for _, _, message in messages(path, Selection(frozenset([ALARM.name])), Damage()):
            if isinstance(message, pb.AlarmStatus):
                found.take(message)
    return found.result()
