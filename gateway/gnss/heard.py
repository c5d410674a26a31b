"""What is heard of a receiver, in words, once a second: nothing while fixes come and nothing is
refused.

Every refusal is said by name, and where no position comes, what does come and what to do.
"""

from collections import Counter, deque
from collections.abc import Iterable

from gateway.gnss.decoder import GnssDecoder

WINDOW_S = 10.0  # what is said is of so many seconds
PATIENCE_S = 4.0  # without a fix, before that is said
FEW_PACKETS = 2  # so many beginnings of a foreign packet are chance
MOST_TOLD = 4  # names in one sentence
MOSTLY = 0.5  # of the messages damaged: that is what is wrong
WANTED = "switch on UBX NAV-PVT, or NMEA GGA and RMC with checksums"


def counts_of(decoder: GnssDecoder, placed: int, unplaced: int) -> Counter[tuple[str, str]]:
    """All that is counted of a receiver, by kind and name. placed, unplaced: fixes with a position
    and epochs without one.
    """
    stream = decoder.stream
    found: Counter[tuple[str, str]] = Counter()
    kinds = {
        "heard": decoder.heard,
        "refused": decoder.refused,
        "unchecked": stream.unchecked,
        "damaged": stream.reasons,
        "foreign": stream.foreign.packets,
    }
    for kind, counter in kinds.items():
        found.update({(kind, name): n for name, n in counter.items()})
    found["fixes", "placed"], found["fixes", "unplaced"] = placed, unplaced
    found["bytes", "skipped"] = stream.foreign.bytes
    return found


class Heard:
    """Looks at the counts once a second; remembers those of the last seconds."""

    def __init__(self) -> None:
        self._past: deque[tuple[float, Counter[tuple[str, str]]]] = deque()

    def say(self, now_s: float, counts: Counter[tuple[str, str]], steps: list[str]) -> str:
        """What a person should know at now_s (monotonic); steps: of the receiver's time, in
        words.
        """
        past = self._past
        if not past:
            past.append((now_s, counts if counts["fixes", "placed"] else Counter()))
        elif not counts - past[0][1]:
            past.clear()  # silence is no wait for a position: that begins with what comes next
        past.append((now_s, counts))
        while len(past) > 2 and past[1][0] <= now_s - WINDOW_S:
            past.popleft()
        new = counts - past[0][1]
        told = [*steps]
        if new["fixes", "placed"] == 0 and now_s - past[0][0] >= PATIENCE_S:
            told += _why_silent(new)
        elif refused := _of(new, "refused"):
            told.append(f"refused in the last seconds: {_names(refused)}")
        return f"receiver: {'; '.join(told)}" if told else ""


def _why_silent(new: Counter[tuple[str, str]]) -> list[str]:
    """Why no position has come."""
    if not new:
        return []
    told = ["no position"]
    if new["fixes", "unplaced"]:
        told.append("its messages say that it has no satellite fix (or a simulated or manual one)")
    if refused := _of(new, "refused"):
        told.append(f"refused: {_names(refused)}")
    if unchecked := _of(new, "unchecked"):
        told.append(
            f"sentences without a checksum are not believed: {_names(unchecked)}; switch the"
            " receiver's checksums on"
        )
    foreign = [(name, n) for name, n in _of(new, "foreign") if n > FEW_PACKETS]
    if foreign:
        told.append(f"{_names(foreign)} is not read; {WANTED}")
    heard, damaged = _of(new, "heard"), _of(new, "damaged")
    if heard and not new["fixes", "unplaced"] and not refused:
        told.append(f"heard {_names(heard)}: none has a position; {WANTED}")
    if sum(n for _, n in damaged) > MOSTLY * sum(n for _, n in [*heard, *damaged]):
        told.append(f"damaged: {_names(damaged)}; check speed and ground of its line")
    if len(told) == 1:
        told.append(
            f"{new['bytes', 'skipped']} bytes came that are no message known here; most likely the"
            " speed is wrong: set `gnss_baud` to the receiver's"
        )
    return told


def _of(counts: Counter[tuple[str, str]], kind: str) -> list[tuple[str, int]]:
    """Names of one kind, the most frequent first."""
    found = [(name, n) for (of, name), n in counts.items() if of == kind and n > 0]
    return sorted(found, key=lambda item: (-item[1], item[0]))


def _names(counted: Iterable[tuple[str, int]]) -> str:
    every = [f"{n} {name}" for name, n in counted]
    more = f" and {len(every) - MOST_TOLD} other kinds" if len(every) > MOST_TOLD else ""
    return ", ".join(every[:MOST_TOLD]) + more
