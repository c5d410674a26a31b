"""Calling a compiled function without asking for the types of its arguments again: records make
that slow.
"""

from collections.abc import Callable
from typing import Any


class Direct:
    """A compiled function that is always called with the same types; the first call compiles and
    checks them.
    """

    def __init__(self, function: Any) -> None:
        self._function = function
        self._entry: Callable[..., Any] | None = None

    def __call__(self, *arguments: Any) -> Any:
        if self._entry is not None:
            return self._entry(*arguments)
        result = self._function(*arguments)
        overloads = getattr(self._function, "overloads", None)  # none where numba is switched off
        if overloads is not None and len(overloads) == 1:
            self._entry = next(iter(overloads.values())).entry_point
        return result
