"""`gyrofree up`: the services of gyrofree.toml under one roof, for boards that are real.

Where nobody may sign in yet, a one-time link is printed that signs in as the administrator
FIRST, who has a password that nobody knows; he goes as soon as there is another administrator.
"""

import secrets
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urlsplit

from dashboard.web.users import (
    Role,
    UsersError,
    add_user,
    issue_link_token,
    load_users,
    remove_user,
)
from gyrofree.config import Settings
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

FIRST = "first"  # administrator by a one-time link, while there is no other


@dataclass(frozen=True)
class Plan:
    """What is to run."""

    settings: Settings
    config: Path | None  # file of the settings; None: the defaults
    services: tuple[str, ...] = SERVICES


def run(plan: Plan) -> None:
    """Run until Ctrl-C; raises typer.Exit with a code when it cannot."""
    start_logging()
    stop = stop_on_signals()
    _look_for_others(plan)
    settings = plan.settings
    supervisor = Supervisor(name="up")
    for service in plan.services:
        supervisor.add(service, service, *(["--config", str(plan.config)] if plan.config else []))
    welcome = _welcome(settings) if "dashboard" in plan.services else []
    supervisor.say(f"starting {', '.join(plan.services)}; {_boards(plan)}")
    Watch(supervisor, settings, welcome).run(stop)


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


def _welcome(settings: Settings) -> list[tuple[str, str]]:
    """The lines that say where the page is and how to enter."""
    users, url = settings.dashboard.users, settings.dashboard.url
    try:
        others = {name: user for name, user in load_users(users).items() if name != FIRST}
        if others:
            if any(user.role is Role.admin for user in others.values()):
                _forget_first(users)
            return [(f"open  {url}", "bold green")]
        add_user(users, FIRST, secrets.token_urlsafe(24), Role.admin)
        minutes = settings.dashboard.link_minutes
        token = issue_link_token(users, FIRST, 60.0 * minutes)
    except UsersError as error:
        raise fail(error, EXIT_CONFIG) from None
    return [
        (f"open  {url}/login/link?token={token}", "bold green"),
        (f"nobody may sign in yet: that link signs in once, within {minutes:g} min", ""),
        (
            "for good: gyrofree users add NAME --role admin   (then sign in at the address above)",
            "",
        ),
    ]


def _forget_first(users: Path) -> None:
    if FIRST in load_users(users):
        remove_user(users, FIRST)
