"""What goes along with every service: its log, the order that changes how much it logs, and its
figures at a port of its own.
"""

import logging
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gyrofree.operations import log_form
from gyrofree.operations.log_level import LogLevel
from gyrofree.operations.settings import LogSettings, MetricsSettings
from messages.bus.attending import attend

LOOPBACK = ("127.0.0.1", "::1", "localhost")

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Attended:
    """One service with its settings."""

    service: str  # one of operations.settings.SERVICES
    log: LogSettings
    metrics: MetricsSettings
    folders: dict[str, Path]  # whose disks it fills, by the key that names them

    def start(self, verbose: bool) -> LogLevel:
        """Log, take orders about that, and serve figures; call once, in the main thread."""
        log_form.start(self.service, self.log, verbose)
        level = LogLevel()
        attend(level.listen)
        self._serve()
        return level

    def _serve(self) -> None:
        port = self.metrics.port_of(self.service)
        if not port:
            return
        # here: who serves no figures needs no package for it
        from prometheus_client import start_http_server

        from messages.metrics.own import Own

        own = Own(self.folders)
        try:
            start_http_server(port, self.metrics.host, registry=own.registry)
        except OSError as error:
            why = error.strerror or error
            log.warning(
                "[metrics] port %d of %s: %s; figures of this process are not served",
                port,
                self.metrics.host,
                why,
            )
            return
        own.watch()
        log.info("figures at http://%s:%d/metrics", self.metrics.host, port)
        if self.metrics.host not in LOOPBACK:
            log.warning("[metrics] host %s: whoever reaches it reads them", self.metrics.host)


def attended(settings: Any, service: str) -> Attended:
    """A service of these Settings."""
    folders = {
        "gateway": {"gateway.journal": settings.gateway.journal},
        "estimator": {"estimator.journal": settings.estimator.journal},
        "recorder": {"recorder.root": settings.recorder.root},
        "procedures": {"procedures.root": settings.procedures.root},
        "alarms": {"alarms.state": settings.alarms.state},
        "dashboard": {
            "dashboard.sessions_root": settings.dashboard.sessions_root,
            "dashboard.users": settings.dashboard.users,
        },
    }
    named = {k: Path(v) for k, v in folders.get(service, {}).items() if v is not None}
    return Attended(service, settings.log, settings.metrics, named)
