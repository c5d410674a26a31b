"""Ports that stay open while the gateway is not there.

A gateway that is killed takes its descriptors with it: the port closes, and what the board says until the next one has
opened it is lost. So each open port is also given to somebody who does nothing but hold it (gyrofree/guardian.py). The
kernel goes on collecting its bytes, and the next gateway takes the port over as it is and reads them.
"""


class Keeper:
    """Keeps nothing: for a gateway that nobody guards."""

    def keep(self, url: str, fd: int) -> None:
        """Hold an open port for whoever comes after us."""

    def drop(self, url: str) -> None:
        """Let a port go that was lost or closed, so that it can be opened anew."""

    def take(self, url: str) -> int | None:
        """Descriptor of a port that an earlier life left open, once; None when there is none."""
        return None

    def holds(self, url: str) -> bool:
        """True while `take` has something to give."""
        return False
