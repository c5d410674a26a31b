"""Ways on which home is asked: its lanes where there are any, else the routers' own link."""

from collections.abc import Callable

import zenoh

from messages.contract.topics import MOST_LANES
from messages.previews.frames import lane_key
from sites.roles import SEGMENTS, segment_key

Ask = Callable[[str], bytes]  # a question below segment_key; raises SiteError
Asked = Callable[[str], bytes]  # the same, by its whole key
Ways = Callable[[], list[Ask]]  # that are open at this moment, one at least


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
