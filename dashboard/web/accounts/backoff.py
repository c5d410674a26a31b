"""Waiting times for wrong passwords, links and tokens, by address."""

import ipaddress
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

NAMES = 64  # of an address that are counted each for itself
ADDRESSES = 4096  # addresses whose failures are remembered; the oldest go first


class WaitError(Exception):
    """Too many wrong passwords from this address."""

    def __init__(self, seconds: float) -> None:
        super().__init__(f"too many wrong passwords from this address: wait {seconds:.0f} s")
        self.seconds = seconds


@dataclass
class Failures:
    """Of one network."""

    of: Counter[str] = field(default_factory=Counter)  # failures, by what was tried
    allowed: float = 0.0  # time of the next attempt

    def name(self, about: str) -> str:
        """Under which it is counted; of very many all that come after them together."""
        return about[:64] if about[:64] in self.of or len(self.of) < NAMES else ""


class Backoff:
    """Waiting time per address: none for the first failures, then 1, 2, 4 ... s up to a limit."""

    def __init__(self, free: int, longest_s: float, clock: Callable[[], float]) -> None:
        self._free, self._longest, self._clock = free, longest_s, clock
        self._failures: dict[str, Failures] = {}  # by network

    @staticmethod
    def network(address: str) -> str:
        """An IPv6 host owns a /64: count that as one address."""
        try:
            parsed = ipaddress.ip_address(address)
        except ValueError:
            return address
        return (
            str(ipaddress.ip_network((parsed, 64), strict=False))
            if parsed.version == 6
            else address
        )

    def attempt(self, address: str, about: str) -> None:
        """Count an attempt as failed before it is verified, so that parallel ones gain nothing;
        raises WaitError. about: whose password, or what else is tried.
        """
        key, now = self.network(address), self._clock()
        known = self._failures.pop(key, None) or Failures()
        if now > known.allowed + self._longest:
            known.of.clear()
        self._failures[key] = known
        if now < known.allowed:
            known.allowed = min(known.allowed, now + self._longest)  # also when the clock went back
            raise WaitError(known.allowed - now)
        known.of[known.name(about)] += 1
        over = known.of.total() - self._free
        wait = min(2.0 ** min(over, 30), self._longest) if over >= 0 else 0.0
        known.allowed = now + wait
        while len(self._failures) > ADDRESSES:
            self._failures.pop(next(iter(self._failures)))

    def forgive(self, address: str, about: str) -> None:
        """It was right after all. What was tried about others stays: who has a password of his own
        could else guess at another's for ever.
        """
        key = self.network(address)
        known = self._failures.get(key)
        if known is None:
            return
        known.of.pop(known.name(about), None)
        known.allowed = min(known.allowed, self._clock())
        if not known.of:
            del self._failures[key]
