"""What browsers have in common: those that look at the same are brought up to date one after the
other, and what one of them was drawn need not be worked out for the next.
"""

from collections.abc import Callable, Hashable
from typing import Any, TypeVar

Made = TypeVar("Made")


class Shared:
    """Results of one round of updates, by what they are of."""

    def __init__(self) -> None:
        self._found: dict[Hashable, Any] = {}

    def begin(self) -> None:
        """A new round: nothing is known yet."""
        self._found = {}

    def once(self, key: Hashable, make: Callable[[], Made]) -> Made:
        """The result of make() for this key, made at most once a round."""
        if key not in self._found:
            self._found[key] = make()
        return self._found[key]
