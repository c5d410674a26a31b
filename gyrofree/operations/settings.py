"""[log] and [metrics]."""

from typing import Literal

from pydantic import BaseModel, ConfigDict

from messages.setting import setting

# in the order of their ports
SERVICES = (
    "router",
    "gateway",
    "estimator",
    "recorder",
    "procedures",
    "alarms",
    "dashboard",
    "authority",
)


class LogSettings(BaseModel):
    """[log]: what the services write on stderr."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    format: Literal["text", "json"] = setting(
        "text", "lines for people, or one JSON object a line for programs"
    )
    level: Literal["debug", "info", "warning", "error"] = setting(
        "info", "the least that is written; `gyrofree log-level` changes it for a while"
    )


class MetricsSettings(BaseModel):
    """[metrics]: figures for Prometheus, of each service at a port of its own."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    port: int = setting(
        0,
        "of the router's; the others follow in the order of docs/operations.md; 0: none is served",
        ge=0,
        le=65_535 - len(SERVICES),
    )
    host: str = setting(
        "127.0.0.1", "where they listen; nobody has to sign in there, so not where others reach it"
    )

    def port_of(self, service: str) -> int:
        """Of one service; 0: none."""
        return self.port + SERVICES.index(service) if self.port else 0
