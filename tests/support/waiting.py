"""Waiting for what comes about by itself."""

import time
from collections.abc import Callable
from typing import TypeVar

Value = TypeVar("Value")


def until(
    condition: Callable[[], Value], what: str | Callable[[], str] = "", seconds: float = 120.0
) -> Value:
    """The first true value of condition(); a busy machine is given time.

    `what` is waited for: a text, or what makes one when it did not come. Raises AssertionError.
    """
    end = time.monotonic() + seconds
    while not (value := condition()):
        if time.monotonic() > end:
            said = what() if callable(what) else what
            raise AssertionError(f"not within {seconds:g} s: {said or condition}")
        time.sleep(0.02)
    return value
