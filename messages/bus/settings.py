"""[bus] of gyrofree.toml, and what it means to Zenoh."""

import resource
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Self

from pydantic import BaseModel, ConfigDict, PrivateAttr

from messages.bus import tls
from messages.contract.names import Name
from messages.setting import setting

LARGEST = 16 << 20  # bytes; messages have at most 1 MB, answers to questions 8
PATIENCE_US = 100_000  # that a full queue is waited for


class BusSettings(BaseModel):
    """[bus]: how the processes find one another."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    prefix: Name = setting(
        "gyrofree",
        "first part of every bus key; two installations on one router differ in it",
        shown=True,
    )
    router: str = setting("tcp/127.0.0.1:7447", "where all processes find the router", shown=True)
    listen: list[str] = setting(
        ["tcp/127.0.0.1:7447"],
        "where the router listens; beyond loopback read docs/deployment.md first",
        shown=True,
    )
    tls: Path | None = setting(
        None,
        "folder of this place's certificates, which `gyrofree site` makes: every link is then"
        " encrypted, and each process may say only what its role needs; without it plain TCP, for"
        " the loopback of one machine",
    )
    # 2 s noticed a frozen process sooner, but on a machine busy with drawing in software it also
    # cut off live ones, and lost 3 % of all messages.
    lease_ms: int = setting(
        10_000, "a peer that shows no life for so long is cut off", unit="ms", ge=200, le=60_000
    )

    zenohd: Path | None = setting(
        None,
        "Zenoh's own router, a program: `gyrofree router` runs it in its own place, with the same"
        " listeners, certificates and rules (docs/sites.md)",
    )

    _role: str = PrivateAttr("operator")

    def acting_as(self, role: str) -> Self:
        """The same for a process of this role, which shows its certificate."""
        copy = self.model_copy()
        copy._role = role
        return copy

    @property
    def role(self) -> str:
        """What this process is; a person's command is an operator's."""
        return self._role


# Between places. TCP tries again after twice the time each time, so a connection that was cut for
# long would come back long after the link did: it is given up after the lease, and a new one made.
FAR_LEASE_MS = 5_000
ACCEPT_MS = 4_500  # a little more than who is far away takes to be known
PENDING = 2_000  # connections that are not known yet; of a process's files, which are raised to it
FAR_ATTEMPT_MS = 4_000  # of a client; with 5 % loss and 200 ms a handshake takes 1 s, hardly ever 4


def room_for_connections() -> None:
    """Let this process, a router, have as many open files as it may have connections."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = 2 * PENDING + 1000
    if soft < wanted:
        most = wanted if hard == resource.RLIM_INFINITY else min(wanted, hard)
        resource.setrlimit(resource.RLIMIT_NOFILE, (most, hard))


def configuration(settings: BusSettings, mode: str, mesh: Iterable[str] = ()) -> dict[str, Any]:
    """Zenoh's settings for a "client" or the "router", which keeps calling those of `mesh`, by
    their paths in its configuration. Raises IdentityError without a certificate.
    """
    values = {
        "mode": mode,
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "timestamping/enabled": True,
        # A pool of 16 MiB in every process for messages above 3 kB, left in /dev/shm by every one
        # that is killed.
        "transport/shared_memory/enabled": False,
        "transport/link/tx/lease": settings.lease_ms,
        # A process that gets no processor for a while must not lose messages: room for 16 batches
        # of 64 KiB, and some patience before DROP drops. Express publishing would be no faster at
        # these rates (measured), but takes a batch for each message: bursts of 17 were cut off.
        "transport/link/tx/queue/size/data": 16,
        # A larger message is put together nowhere: Zenoh would take a GB for one, in each process
        # that listens.
        "transport/link/rx/max_message_size": LARGEST,
        "transport/link/tx/queue/congestion_control/drop/wait_before_drop": PATIENCE_US,
    }
    if settings.tls is not None:
        values |= tls.values(settings.tls, settings.role)
    if mode == "router":
        values |= {
            # Whoever holds a certificate, a revoked one too, can begin connections and say no more:
            # 100 of them, Zenoh's own limit, kept everybody else out for 10 s, again and again.
            "transport/unicast/accept_timeout": ACCEPT_MS,
            "transport/unicast/accept_pending": PENDING,
            "transport/unicast/max_sessions": PENDING,
        }
        values["listen/endpoints"] = settings.listen
        values["connect/endpoints"] = list(mesh)
        values[
            "connect/timeout_ms"
        ] = -1  # another site may come later; else it is given up for good
        values["connect/exit_on_failure"] = False
        values["connect/retry"] = {
            "period_init_ms": 200,
            "period_max_ms": 500,
            "period_increase_factor": 1.5,
        }
        # Of a preview: what does not fit is dropped, and does not wait behind what is older.
        values["transport/link/tx/queue/size/interactive_low"] = 1
        if settings.tls is not None:
            values["transport/link/tx/lease"] = min(settings.lease_ms, FAR_LEASE_MS)
        return values
    values["connect/endpoints"] = [settings.router]
    near = any(host in settings.router for host in ("/127.0.0.1:", "/localhost:", "/[::1]:"))
    values["connect/timeout_ms"] = 1000 if near else FAR_ATTEMPT_MS
    values["listen/endpoints"] = []
    # Look for a router that went away every second: what was missed shall be on the screen within
    # five.
    values["connect/retry"] = {
        "period_init_ms": 500,
        "period_max_ms": 1000,
        "period_increase_factor": 1.5,
    }
    return values
