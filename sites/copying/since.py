"""Long answers that change a little, told by what has changed.

Home's list of sessions and the list of a recording that runs are asked for every second, and
only their ends change. Who asks says by its hash which answer he has; he is told how much of it
still stands, and what comes behind that.
"""

import hashlib
from collections import OrderedDict
from collections.abc import Callable

SINCE = "since"  # chunk of a key: before the hash of an answer
NOTHING = "0" * 64  # the hash of who has none
MOST_TOLD = 64  # answers that home keeps, to compare with
MOST_TOLD_BYTES = 32 << 20  # of them together
MOST_HEARD = 64  # questions of which an answer is kept


def common(one: bytes, other: bytes) -> int:
    """How many bytes at the beginning are the same."""
    kept, step = 0, 1 << 16
    while step:
        end = min(kept + step, len(one), len(other))
        if kept < end and one[kept:end] == other[kept:end]:
            kept = end
        else:
            step //= 2
    return kept


class Told:
    """Home's end: the answers that were given, by their hash. Not for several threads."""

    def __init__(self) -> None:
        self._answers: OrderedDict[str, bytes] = OrderedDict()

    def since(self, sha256: str, answer: bytes) -> bytes:
        """`<bytes that still stand> <sha256>`, a line's end, and the rest of the answer."""
        before = self._answers.get(sha256, b"")
        kept = common(before, answer)
        now = hashlib.sha256(answer).hexdigest()
        self._answers[now] = answer
        self._answers.move_to_end(now)
        while len(self._answers) > MOST_TOLD or self._size() > MOST_TOLD_BYTES:
            self._answers.popitem(last=False)
        return f"{kept} {now}\n".encode() + answer[kept:]

    def _size(self) -> int:
        return sum(map(len, self._answers.values()))


class Heard:
    """The other end: the newest answer to each question."""

    def __init__(self) -> None:
        self._answers: OrderedDict[str, tuple[str, bytes]] = OrderedDict()

    def asked(self, what: str, ask: Callable[[str], bytes]) -> bytes:
        """The answer to `what`, of which only what is new was asked for. Raises ValueError where
        it does not fit to what is here: it is then asked for as a whole the next time.
        """
        sha256, before = self._answers.pop(what, (NOTHING, b""))
        head, _, rest = ask(f"{what}/{SINCE}/{sha256}").partition(b"\n")
        kept, _, now = head.decode("ascii").partition(" ")
        answer = before[: int(kept)] + rest
        if hashlib.sha256(answer).hexdigest() != now:
            raise ValueError(f"the answer to {what} does not fit to the one before")
        self._answers[what] = now, answer
        while len(self._answers) > MOST_HEARD:
            self._answers.popitem(last=False)
        return answer
