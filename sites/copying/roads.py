"""Ways on which home is asked: its lanes where there are any, else the routers' own link."""

import threading
from collections.abc import Callable, Iterator, Sequence

import zenoh

from messages.contract.topics import MOST_LANES
from messages.previews.frames import lane_key
from sites.place import SiteError
from sites.roles import SEGMENTS, segment_key

Ask = Callable[[str], bytes]  # a question below segment_key; raises SiteError
Asked = Callable[[str], bytes]  # the same, by its whole key


class Roads:
    """The lanes of this moment."""

    def __init__(self, session: zenoh.Session, site: str, asked: Asked) -> None:
        self._main = _below(segment_key(site) + "/", asked)
        self._lanes = []
        for number in range(MOST_LANES):
            below = lane_key(site, number) + SEGMENTS
            seen = session.declare_querier(f"{below}index")
            self._lanes.append((seen, _below(below, asked)))

    def __call__(self) -> list[Ask]:
        """All there are, the routers' own link only where there is no lane."""
        return [ask for seen, ask in self._lanes if seen.matching_status.matching] or [self._main]


def _below(start: str, asked: Asked) -> Ask:
    return lambda what: asked(start + what)


def all_of(
    wanted: Iterator[tuple[int, str]],
    name: str,
    asks: Sequence[Ask],
    keep: Callable[[int, str, bytes], bool],
    stop: Callable[[], bool],
) -> bool:
    """Ask for every (first byte, sha256) of a file, on all roads at once; `keep` says whether a
    piece is what it should be, and is called by one at a time. False when one is not, or `stop`
    came first; raises SiteError when the last road has failed.
    """
    lock, again, bad = threading.Lock(), [], []
    faults: list[SiteError] = []

    def take() -> tuple[int, str] | None:
        with lock:
            if bad or stop():
                return None
            return again.pop() if again else next(wanted, None)

    def work(ask: Ask) -> None:
        while (piece := take()) is not None:
            try:
                content = ask(f"{name}/{piece[0]}-{piece[1]}")
            except SiteError as error:
                with lock:
                    again.append(piece)
                    faults.append(error)
                return
            with lock:
                if not keep(*piece, content):
                    bad.append(piece)

    threads = [threading.Thread(target=work, args=(ask,), name="copying") for ask in asks[1:]]
    for thread in threads:
        thread.start()
    work(asks[0])
    for thread in threads:
        thread.join()
    if faults and not bad and not stop() and (again or next(wanted, None) is not None):
        raise faults[0]
    return not bad and not stop()
