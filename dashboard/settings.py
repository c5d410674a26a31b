"""[dashboard] of gyrofree.toml."""

import ipaddress
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, field_validator, model_validator

from messages.setting import setting


class DashboardSettings(BaseModel):
    """What the web side needs to know; relative paths are taken from the folder the process runs
    in.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    host: str = setting(
        "127.0.0.1", "address that the one exposed port listens on; 0.0.0.0 for all", shown=True
    )
    port: int = setting(
        8080, "if it is taken, the dashboard says so and stops", shown=True, ge=1, le=65535
    )
    viser_port: int = setting(
        0, "of the scene, on the loopback only; 0 takes any free one", ge=0, le=65535
    )
    users: Path = setting(
        Path("var/state/users.json"),
        "who may sign in: `gyrofree users add NAME --role operator`; sign-ins lie beside it",
        shown=True,
    )
    sessions_root: Path = setting(
        Path("var/sessions"),
        "folder of the recorded sessions, the one of `[recorder] root`",
        shown=True,
    )
    map: Path | None = setting(
        None, "PMTiles file whose tiles lie under tracks and fixes; none: a plain grid", shown=True
    )
    demo: bool = setting(False, "says so on the pages; the demo's link signs in without a password")

    allowed_hosts: list[str] = setting([], "names besides localhost that people type to get here")
    tls_certificate: Path | None = setting(
        None,
        "PEM file of the certificate and its chain: the port speaks TLS by itself; other files are"
        " taken when they change",
        shown=True,
    )
    tls_key: Path | None = setting(None, "PEM file of its private key", shown=True)
    secure_cookies: bool = setting(
        False, "true behind a proxy with TLS: `__Host-` cookie, Secure, HSTS"
    )
    trusted_proxies: list[str] = setting([], "addresses whose X-Forwarded-For is believed")

    oidc_issuer: str = setting(
        "", "identity provider of the lab (OpenID Connect), as https://id.example.org/lab"
    )
    oidc_client: str = setting("", "what this dashboard is called there")
    oidc_secret: Path | None = setting(None, "file of its secret there; none: a public client")
    oidc_address: str = setting(
        "", "this page as browsers see it, as https://bench.example.org; they come back there"
    )
    oidc_suffix: str = setting("lab", "its people are called NAME@suffix here")
    oidc_scope: str = setting("openid profile", "what is asked for")
    oidc_name_claim: str = setting("preferred_username", "their name; absent: `sub`")
    oidc_role_claim: str = setting("groups", "says what they may do")
    oidc_admins: list[str] = setting([], "values of it that make an admin")
    oidc_operators: list[str] = setting([], "values of it that make an operator")
    oidc_viewers: list[str] = setting([], 'values of it that make a viewer; `["*"]`: everybody')
    oidc_ca: Path | None = setting(None, "PEM file of who vouches for the provider's certificate")

    session_hours: float = setting(12.0, "longest sign-in", unit="h", gt=0, le=720)
    idle_hours: float = setting(
        12.0, "a sign-in unused for so long ends; to look on is no use", unit="h", gt=0, le=720
    )
    sign_ins_per_user: int = setting(
        10, "of one user at a time; a new one ends the oldest", ge=1, le=1000
    )
    link_minutes: float = setting(
        15.0, "life of a one-time sign-in link", unit="min", gt=0, le=1440
    )
    free_attempts: int = setting(
        3, "wrong passwords of one address before it has to wait", ge=1, le=100
    )
    longest_wait_s: float = setting(
        300.0, "longest of the doubling waits after them", unit="s", gt=0, le=86400
    )

    live: Literal["auto", "preview", "full"] = setting(
        "auto",
        "what another place asks of home's boards: a preview, as many samples a second as the link"
        " carries, and everything where that fits (auto); a preview at most; always everything",
        shown=True,
    )
    preview_hz: int = setting(
        50, "samples of a preview at most: 50, 20, 10, 5, 2 or 1", unit="Hz", ge=1, le=50
    )
    devices: int = setting(64, "shown; a silent one makes room for another", ge=1, le=1000)
    history_bytes: int = setting(
        1 << 30,
        "memory for what the charts show; when it is full they reach back less far",
        unit="bytes",
        ge=1 << 24,
    )

    connections: int = setting(800, "open at a time, of all addresses", ge=16, le=100_000)
    connections_per_address: int = setting(
        100, "of them from one address, which is no trusted proxy", ge=8, le=100_000
    )
    request_s: float = setting(
        10.0, "to ask for something, or the connection is ended", unit="s", gt=0, le=300
    )
    take_s: float = setting(
        60.0, "a client that takes nothing for so long is dropped", unit="s", gt=0, le=3600
    )
    scenes_per_user: int = setting(12, "open scenes of a user, that is tabs", ge=1, le=1000)
    scenes: int = setting(64, "open scenes of all users", ge=1, le=10_000)
    body_limit: int = setting(
        65536, "largest body of a request", unit="bytes", ge=1024, le=10_000_000
    )
    upload_bytes_per_user: int = setting(
        2 << 30, "logs and photos of one user that are being sent", unit="bytes", ge=1 << 20
    )
    body_timeout_s: float = setting(10.0, "to receive that body", unit="s", gt=0, le=300)
    message_limit: int = setting(
        65536, "largest message from a browser's scene", unit="bytes", ge=1024, le=10_000_000
    )
    message_rate: float = setting(
        300.0, "messages of one browser; more closes it", unit="1/s", gt=0, le=10_000
    )
    stall_s: float = setting(
        10.0, "a browser's scene that takes nothing for so long is dropped", unit="s", gt=0, le=300
    )
    stale_s: float = setting(
        3.0, "a device silent for so long is shown as stale", unit="s", gt=0, le=300
    )

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

    @model_validator(mode="after")
    def _both_files_of_tls(self) -> "DashboardSettings":
        if (self.tls_certificate is None) != (self.tls_key is None):
            raise ValueError("tls_certificate and tls_key: want both, or none")
        return self

    @model_validator(mode="after")
    def _whole_provider(self) -> "DashboardSettings":
        if not self.oidc_issuer:
            return self
        if not self.oidc_client or not self.oidc_address:
            raise ValueError("oidc_issuer: want oidc_client and oidc_address, too")
        if not (self.oidc_admins or self.oidc_operators or self.oidc_viewers):
            raise ValueError("oidc_issuer: nobody gets a role; want oidc_viewers or others")
        for url in (self.oidc_issuer, self.oidc_address):
            local = url.startswith(("http://127.0.0.1", "http://localhost", "http://[::1]"))
            if not url.startswith("https://") and not local:
                raise ValueError(f"{url!r}: want https://")
        return self

    @property
    def secure(self) -> bool:
        """Browsers reach it by https, ours or a proxy's."""
        return self.secure_cookies or self.tls_certificate is not None

    @property
    def cookie(self) -> str:
        """Name of the cookie. Cookies do not know ports, so the port is in the name where __Host-
        is not possible.
        """
        return "__Host-gyrofree" if self.secure else f"gyrofree-{self.port}"

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
        return f"{'https' if self.secure else 'http'}://{host}:{self.port}"
