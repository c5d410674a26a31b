"""`gyrofree demo`: all services on this machine, fed by a simulated table or a played log, behind
one printed URL.

The configuration that the demo runs with is written to <folder>/gyrofree.toml, so that every
process can also be started by hand.
"""

import secrets
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from dashboard.web.users import add_user, issue_link_token, link_token_waits
from gyrofree.config import Settings, load
from gyrofree.running.doctor import port_taken
from gyrofree.running.process import EXIT_TAKEN, fail, start_logging, stop_on_signals
from gyrofree.running.supervisor import Supervisor
from gyrofree.running.watch import SERVICES, Watch
from sessions.library.catalogue import Catalogue

USER = "demo"


@dataclass(frozen=True)
class Plan:
    """What a demo run consists of."""

    folder: Path  # journal, recordings, users and the written configuration
    board: list[str]  # arguments of `gyrofree` that play the board
    device: str
    layout: str
    port: int  # of the dashboard
    bus_port: int
    host: str = "127.0.0.1"
    record: bool = True
    time_scale: float = 1.0  # seconds of the log per second
    estimator: str = ""  # further lines of [estimator]
    once: bool = False  # the board is a log that is played to its end
    command: str = "demo"  # what the person called
    table: bool = False  # the board stands on a table that takes orders


SIMULATED = {  # boards of `gyrofree simulate` besides the table: its arguments, device, layout
    "arm": (["simulate", "--arm", "3"], "cube", "cube"),
    "tilt": (["simulate", "--tilt", "--device", "tilt-board"], "tilt-board", "analogue"),
}
ESTIMATOR = {
    "arm": (
        'rate = ["products-free", "least-squares"]\ngyro_free_rate = "products-free"\n'
        'gyro_free_navigation = ["huber", "kf"]\nuse_every_fix = 2\n'
    ),
    "tilt": "navigators = []\n",
}


def write_configuration(plan: Plan) -> Path:
    """The demo's gyrofree.toml."""
    path = plan.folder / "gyrofree.toml"
    plan.folder.mkdir(parents=True, exist_ok=True)
    path.write_text(
        f"""# Written by `gyrofree {plan.command}`.
# Start any of its services by hand with --config on this file.
[bus]
router = "tcp/127.0.0.1:{plan.bus_port}"
listen = ["tcp/127.0.0.1:{plan.bus_port}"]

[gateway]
journal = "{plan.folder / "journal"}"

[[gateway.devices]]
name = "{plan.device}"
port = "{plan.folder / "board"}"
layout = "{plan.layout}"
time_scale = {plan.time_scale}

[estimator]
journal = "{plan.folder / "estimates"}"
axes = "{plan.folder / "axes"}"
cards = "{plan.folder / "cards"}"
{plan.estimator}
[recorder]
root = "{plan.folder / "sessions"}"
auto_start = {str(plan.record).lower()}

[procedures]
root = "{plan.folder / "procedures"}"
folder = "{plan.folder / "own-procedures"}"
{_table(plan)}
[alarms]
state = "{plan.folder / "alarms.json"}"

[dashboard]
host = "{plan.host}"
port = {plan.port}
users = "{plan.folder / "users.json"}"
sessions_root = "{plan.folder / "sessions"}"
demo = true
"""
    )
    return path


def _table(plan: Plan) -> str:
    """The simulated table as one that procedures drive."""
    if not plan.table:
        return ""
    return f"""[[procedures.tables]]
device = "{plan.device}"
port = "{plan.folder / "table"}"
description = "simulated"
"""


def run(plan: Plan) -> None:
    """Run until Ctrl-C; raises typer.Exit with a code when it cannot."""
    start_logging()
    stop = stop_on_signals()
    look_for_others(("bus", "--bus-port", plan.bus_port), ("dashboard", "--port", plan.port))
    config = write_configuration(plan)
    settings = load(config)
    supervisor = _supervise(plan, config)
    supervisor.say(f"starting; configuration and data in {plan.folder}")
    link = sign_in_link(settings)
    Watch(supervisor, settings, lambda: [(f"open  {link()}", "bold green")]).run(stop)
    if supervisor.done:
        print(_summary(settings, plan))


def _summary(settings: Settings, plan: Plan) -> str:
    """What is left of a log that was played."""
    newest = next(iter(Catalogue(Path(settings.recorder.root)).list()), None)
    if newest is None:
        return f"played to its end; nothing was recorded in {plan.folder}"
    return (
        f"played to its end: session {newest.id}, {newest.seconds:.1f} s,"
        f" {newest.messages:,} messages, {newest.lost} lost, in {settings.recorder.root}"
    )


def _supervise(plan: Plan, config: Path) -> Supervisor:
    supervisor = Supervisor(name=plan.command)
    port = plan.folder / "board"  # is not there before the board, which comes last
    for service in SERVICES:
        hushed = (f"{port}: not there", f"{port}: open") if service == "gateway" else None
        supervisor.add(service, service, "--config", str(config), hushed=hushed)
    add_board(supervisor, plan, config)
    return supervisor


def add_board(supervisor: Supervisor, plan: Plan, config: Path) -> None:
    """The board comes last: estimators that see its first standstill know its heading and biases
    from the start.
    """
    name, *arguments = plan.board  # a log's name may begin with -, and comes last
    places = [f"--config={config}", f"--link={plan.folder / 'board'}"]
    places += [f"--table-link={plan.folder / 'table'}"] if plan.table else []
    board = [name, *places, *arguments]
    supervisor.add("board", *board, waits_for=("estimator", "estimating"), once=plan.once)


def look_for_others(*wanted: tuple[str, str, int]) -> None:
    """End with a word where a port is taken; wanted: whose, the option for it, the port."""
    for what, option, port in wanted:
        if port_taken("127.0.0.1", port):
            raise fail(
                f"{what} port {port} is taken: end what uses it (`ss -ltnp`), or choose {option}",
                EXIT_TAKEN,
            )


def sign_in_link(settings: Settings) -> Callable[[], str]:
    """A fresh demo user with a password nobody knows; what gives the page's address, with the token
    that signs in as it, once, as long as that was not used.
    """
    users = Path(settings.dashboard.users)
    add_user(users, USER, secrets.token_urlsafe(24), "operator")
    token = issue_link_token(users, USER)

    def link() -> str:
        waits = link_token_waits(users, token)
        return settings.dashboard.url + (f"/login/link?token={token}" if waits else "")

    return link
