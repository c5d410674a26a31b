"""Waiting times for wrong passwords, links and tokens, by address."""

import ipaddress
from collections.abc import Callable

ADDRESSES = 4096  # addresses whose failures are remembered; the oldest go first


class WaitError(Exception):
    """Too many wrong passwords from this address."""

    def __init__(self, seconds: float) -> None:
        super().__init__(f"too many wrong passwords from this address: wait {seconds:.0f} s")
        self.seconds = seconds


class Backoff:
    """Waiting time per address: none for the first failures, then 1, 2, 4 ... s up to a limit."""

    def __init__(self, free: int, longest_s: float, clock: Callable[[], float]) -> None:
        self._free, self._longest, self._clock = free, longest_s, clock
        self._failures: dict[
            str, tuple[int, float]
        ] = {}  # network -> failures, time of the next attempt

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

    def attempt(self, address: str) -> None:
        """Count an attempt as failed before it is verified, so that parallel ones gain nothing;
        raises WaitError.
        """
        key, now = self.network(address), self._clock()
        count, allowed = self._failures.pop(key, (0, 0.0))
        if now > allowed + self._longest:
            count = 0
        if now < allowed:
            allowed = min(allowed, now + self._longest)  # also when the clock went back
            self._failures[key] = (count, allowed)
            raise WaitError(allowed - now)
        over = count + 1 - self._free
        wait = min(2.0 ** min(over, 30), self._longest) if over >= 0 else 0.0
        self._failures[key] = (count + 1, now + wait)
        while len(self._failures) > ADDRESSES:
            self._failures.pop(next(iter(self._failures)))

    def forgive(self, address: str) -> None:
        """The password was right after all."""
        self._failures.pop(self.network(address), None)
