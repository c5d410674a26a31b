"""`gyrofree up`: the services of gyrofree.toml under one roof, for boards that are real.

Where nobody may sign in yet, a one-time link is printed that signs in as the administrator
FIRST, who has a password that nobody knows; he goes as soon as there is another administrator.
"""

import secrets
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from urllib.parse import urlsplit

from dashboard.web.users import (
    Role,
    UsersError,
    add_user,
    issue_link_token,
    link_token_waits,
    load_users,
    remove_user,
)
from gyrofree.config import DEFAULT_PATH, ConfigError, Settings, load
from gyrofree.operations.log_form import wanted
from gyrofree.running.doctor import port_taken
from gyrofree.running.process import (
    EXIT_CONFIG,
    EXIT_TAKEN,
    fail,
    start_logging,
    stop_on_signals,
)
from gyrofree.running.supervisor import Supervisor
from gyrofree.running.watch import SERVICES, Watch
from gyrofree.setup.site import Renewed, chain, endings

COMMANDS = {"site": ("site", "serve")}  # of a service that is not called as its command
FIRST = "first"  # administrator by a one-time link, while there is no other


@dataclass(frozen=True)
class Plan:
    """What is to run."""

    settings: Settings
    config: Path | None  # file of the settings; None: the defaults
    services: tuple[str, ...] = SERVICES

    @property
    def asks(self) -> bool:
        """True where the page asks for the first board."""
        return not self.settings.gateway.devices and {"gateway", "dashboard"} <= set(self.services)


class FirstBoard:
    """Starts the services of a board anew once the file has one: the page or `gyrofree setup` wrote
    it.
    """

    def __init__(self, plan: Plan, supervisor: Supervisor) -> None:
        self._path = plan.config or DEFAULT_PATH
        self._supervisor, self._plan = supervisor, plan
        self._stamp, self._done = self._now(), False

    def look(self) -> None:
        """Once; cheap."""
        stamp = self._now()
        if self._done or stamp == self._stamp:
            return
        self._stamp = stamp
        try:
            settings = load(self._path)
        except ConfigError as error:
            self._supervisor.say(f"{self._path} has changed, but {error}", "yellow")
            return
        if settings.gateway.devices:
            self._done = True
            plan = replace(self._plan, settings=settings, config=self._path)
            self._supervisor.say(f"the first board: {_boards(plan)}", "bold green")
            self._supervisor.restart("gateway", "estimator", "record", "procedures")

    def _now(self) -> tuple[int, int] | None:
        try:
            status = self._path.stat()
        except OSError:
            return None
        return status.st_mtime_ns, status.st_ino


def run(plan: Plan) -> None:
    """Run until Ctrl-C; raises typer.Exit with a code when it cannot."""
    settings = plan.settings
    start_logging(settings.log)
    stop = stop_on_signals()
    _look_for_others(plan)
    supervisor = Supervisor(name="up", as_json=wanted(settings.log) == "json")
    for service in plan.services:
        words = COMMANDS.get(service, (service,))
        options = ["--config", str(plan.config)] if plan.config else []
        options += ["--setup"] if service == "dashboard" and plan.asks else []
        supervisor.add(service, *words, *options)
    welcome = _welcome(settings) if "dashboard" in plan.services else list
    supervisor.say(f"starting {', '.join(plan.services)}; {_boards(plan)}")
    looks = [FirstBoard(plan, supervisor).look] if plan.asks else []
    if settings.bus.tls is not None:
        looks.append(Renewed(settings, supervisor).look)
        for line in endings(settings.bus.tls):
            supervisor.say(line, "yellow")
    Watch(supervisor, settings, welcome, chain(*looks)).run(stop)


def _boards(plan: Plan) -> str:
    """What is to be read, in words."""
    source = plan.config or "defaults, no gyrofree.toml"
    devices = plan.settings.gateway.devices
    if not devices:
        return f"no board in {source} yet: `gyrofree setup` finds it"
    return f"{source}: " + ", ".join(f"{d.name} on {d.port}" for d in devices)


def _look_for_others(plan: Plan) -> None:
    """End with a word where a port is taken that a service would listen on."""
    settings = plan.settings
    wanted = []
    if "router" in plan.services:
        for endpoint in settings.bus.listen:
            address = urlsplit(f"//{endpoint.partition('/')[2]}")
            wanted.append((address.hostname or "", address.port or 0, "[bus] listen and router"))
    if "dashboard" in plan.services:
        wanted.append((settings.dashboard.host, settings.dashboard.port, "[dashboard] port"))
    for host, port, key in wanted:
        if port and port_taken(host, port):
            raise fail(
                f"port {port} of {host} is taken: gyrofree runs already (`ss -ltnp` names who), or"
                f" choose another {key} in gyrofree.toml",
                EXIT_TAKEN,
            )


def _welcome(settings: Settings) -> Callable[[], list[tuple[str, str]]]:
    """What gives the lines that say where the page is and how to enter."""
    users, url = settings.dashboard.users, settings.dashboard.url
    plain = [(f"open  {url}", "bold green")]
    try:
        others = {name: user for name, user in load_users(users).items() if name != FIRST}
        if others:
            if any(user.role is Role.admin for user in others.values()):
                _forget_first(users)
            return lambda: plain
        add_user(users, FIRST, secrets.token_urlsafe(24), Role.admin)
        minutes = settings.dashboard.link_minutes
        token = issue_link_token(users, FIRST, 60.0 * minutes)
    except UsersError as error:
        raise fail(error, EXIT_CONFIG) from None
    first = [
        (f"open  {url}/login/link?token={token}", "bold green"),
        (f"nobody may sign in yet: that link signs in once, within {minutes:g} min", ""),
        (
            "for good: gyrofree users add NAME --role admin   (then sign in at the address above)",
            "",
        ),
    ]
    return lambda: first if link_token_waits(users, token) else plain


def _forget_first(users: Path) -> None:
    if FIRST in load_users(users):
        remove_user(users, FIRST)
