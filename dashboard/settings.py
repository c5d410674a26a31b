"""[dashboard] of gyrofree.toml."""

import ipaddress
from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field, field_validator


class DashboardSettings(BaseModel):
    """What the web side needs to know; relative paths are taken from the folder the process runs
    in.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    host: str = "127.0.0.1"  # address the one exposed port listens on; 0.0.0.0 for all
    port: int = Field(
        default=8080, ge=1, le=65535
    )  # if it is taken, the dashboard says so and stops
    viser_port: int = Field(
        default=0, ge=0, le=65535
    )  # of the scene, on the loopback only; 0 takes any free one
    users: Path = Path(
        "state/users.json"
    )  # `gyrofree users add` writes it; sign-ins and links live beside it
    sessions_root: Path = Path(
        "sessions-data"
    )  # folder of the recorded sessions, the one of [recorder] root
    demo: bool = False  # says so on the pages; the demo's link signs in without a password

    allowed_hosts: list[str] = Field(
        default_factory=list
    )  # names besides localhost that people type to get here
    secure_cookies: bool = False  # true behind TLS: __Host- cookie, Secure, HSTS
    trusted_proxies: list[str] = Field(
        default_factory=list
    )  # addresses whose X-Forwarded-For is believed

    session_hours: float = Field(default=12.0, gt=0, le=720)  # h, longest sign-in
    idle_hours: float = Field(default=2.0, gt=0, le=720)  # h, a sign-in unused for this long ends
    link_minutes: float = Field(default=15.0, gt=0, le=1440)  # min, life of a one-time sign-in link
    free_attempts: int = Field(
        default=3, ge=1, le=100
    )  # wrong passwords of one address before it has to wait
    longest_wait_s: float = Field(
        default=300.0, gt=0, le=86400
    )  # s, of the doubling wait after them

    devices: int = Field(default=64, ge=1, le=1000)  # shown; a silent one makes room for another
    history_bytes: int = Field(
        default=1 << 30, ge=1 << 24
    )  # memory for what the charts show; when it is full they reach back less far

    connections: int = Field(default=800, ge=16, le=100_000)  # at a time; see web/connections.py
    connections_per_address: int = Field(default=100, ge=8, le=100_000)  # of them; not of proxies
    request_s: float = Field(default=10.0, gt=0, le=300)  # s, to ask for something, or it is ended
    take_s: float = Field(default=60.0, gt=0, le=3600)  # s, a client that takes nothing is dropped
    scenes_per_user: int = Field(default=12, ge=1, le=1000)  # open scenes, that is tabs
    scenes: int = Field(default=64, ge=1, le=10_000)  # of all users
    body_limit: int = Field(default=65536, ge=1024, le=10_000_000)  # bytes of one request's body
    body_timeout_s: float = Field(default=10.0, gt=0, le=300)  # s, to receive that body
    message_limit: int = Field(
        default=65536, ge=1024, le=10_000_000
    )  # bytes of one message from a browser's scene
    message_rate: float = Field(
        default=300.0, gt=0, le=10_000
    )  # 1/s, messages of one browser; more closes it
    stall_s: float = Field(
        default=10.0, gt=0, le=300
    )  # s, a browser that takes nothing for so long is dropped
    stale_s: float = Field(
        default=3.0, gt=0, le=300
    )  # s, a device silent for so long is shown as stale

    @field_validator("allowed_hosts")
    @classmethod
    def _hosts_without_port(cls, value: list[str]) -> list[str]:
        for host in value:
            if not host or any(character in host for character in ":/*@ "):
                raise ValueError(
                    f"{host!r}: want a bare host name such as cube.example.org, without scheme or"
                    " port"
                )
        return [host.lower() for host in value]

    @property
    def cookie(self) -> str:
        """Name of the cookie. Cookies do not know ports, so the port is in the name where __Host-
        is not possible.
        """
        return "__Host-gyrofree" if self.secure_cookies else f"gyrofree-{self.port}"

    @property
    def url(self) -> str:
        """Where a person on this machine finds the dashboard."""
        host = self.host
        try:
            address = ipaddress.ip_address(host)
            host = (
                "127.0.0.1"
                if address.is_unspecified
                else f"[{host}]"
                if address.version == 6
                else host
            )
        except ValueError:
            pass
        return f"{'https' if self.secure_cookies else 'http'}://{host}:{self.port}"
