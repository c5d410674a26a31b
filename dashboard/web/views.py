"""What each person had on the live page: kept beside the users file, so that it is the same from
any browser. It is the text of a link and nothing that acts.
"""

import json
import logging
import re
import threading
from pathlib import Path

from dashboard.web.users import write_private

log = logging.getLogger(__name__)

LONGEST = 6000  # characters, with a person's own curves
VIEW = re.compile(rf"[A-Za-z0-9=&._%+*-]{{0,{LONGEST}}}")  # as URLSearchParams writes it
LIVE = "live"


class Views:
    """The last view of each user, by name."""

    def __init__(self, path: Path) -> None:
        self._path, self._lock = path, threading.Lock()
        self._views = self._load()

    def of(self, user: str, page: str = LIVE) -> str:
        """The last one of a kind of page, empty for none."""
        return self._views.get(_key(user, page), "")

    def keep(self, user: str, view: str, page: str = LIVE) -> None:
        """Remember it. Raises ValueError for what is no view, OSError when it cannot be written."""
        if not VIEW.fullmatch(view):
            raise ValueError("view: want the part of a link after the question mark")
        with self._lock:
            self._views[_key(user, page)] = view
            write_private(self._path, json.dumps(self._views))

    def _load(self) -> dict[str, str]:
        try:
            found = json.loads(self._path.read_text(encoding="utf-8"))
            return {user: view for user, view in found.items() if VIEW.fullmatch(view)}
        except FileNotFoundError:
            return {}
        except (OSError, ValueError, TypeError, AttributeError, RecursionError) as error:
            log.warning("%s: %s: everybody's view begins anew", self._path, error)
            return {}


def _key(user: str, page: str) -> str:
    """No user's name has a blank."""
    return user if page == LIVE else f"{user} {page}"
