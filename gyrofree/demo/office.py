"""`gyrofree demo --office`: the lab of the demo, and an office that watches it over a slow line.

Both are places of one site on this machine, each with a folder, a router and a page of its own, as
`gyrofree site init`, `invite` and `join` would make them. SIGUSR1 pulls the cable between them.
"""

import datetime as dt
import os
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from dashboard.settings import DashboardSettings
from gyrofree.config import Settings, load
from gyrofree.demo.bench import (
    Plan,
    add_board,
    look_for_others,
    sign_in_link,
    write_configuration,
)
from gyrofree.demo.slow_line import SlowLine
from gyrofree.running.process import start_logging, stop_on_signals
from gyrofree.running.supervisor import Supervisor
from gyrofree.running.up import COMMANDS
from gyrofree.running.watch import Watch
from gyrofree.setup.site import services, write_place
from messages.bus.tls import TRUSTED
from sessions.recording.settings import RecorderSettings
from sites.enrolment import Registrar, keep, new_requests
from sites.invitation import invite
from sites.joining import join_question, make_site

LAB, OFFICE = "lab", "office"
RATE_BPS, DELAY_S = 1e6, 0.1  # of the line between them, each way
LIFE = dt.timedelta(hours=1)  # of an invitation that is used at once


def run(plan: Plan) -> None:
    """Run until Ctrl-C; raises typer.Exit with a code when it cannot.

    The office's page has the port after the lab's, its router the one after the lab's router, the
    line between them the next.
    """
    start_logging()
    page, router, line = plan.port + 1, plan.bus_port + 1, plan.bus_port + 2
    look_for_others(
        ("bus", "--bus-port", plan.bus_port),
        ("office's bus", "--bus-port", router),
        ("line's", "--bus-port", line),
        ("dashboard", "--port", plan.port),
        ("office's dashboard", "--port", page),
    )
    lab, office = (plan.folder / place / "gyrofree.toml" for place in (LAB, OFFICE))
    plan = replace(plan, folder=lab.parent)
    _make_places(plan, lab, office)
    slow, supervisor = SlowLine(line, router, RATE_BPS, DELAY_S), Supervisor(name=plan.command)

    def pull() -> None:
        slow.pulled = not slow.pulled
        said = "is pulled" if slow.pulled else "is in again"
        supervisor.say(f"the cable between lab and office {said}", "bold yellow")

    stop = stop_on_signals(pull)
    _supervise(supervisor, plan, lab, office)
    supervisor.say(f"starting; configuration and data in {lab.parent} and {office.parent}")
    try:
        Watch(supervisor, load(office), _welcome(lab, office)).run(stop)
    finally:
        slow.close()


def _welcome(lab: Path, office: Path) -> Callable[[], list[tuple[str, str]]]:
    links = {place: sign_in_link(load(path)) for place, path in ((LAB, lab), (OFFICE, office))}
    cable = f"kill -USR1 {os.getpid()}"

    def said() -> list[tuple[str, str]]:
        return [
            *((f"open  {link()}   ({place})", "bold green") for place, link in links.items()),
            (f"between them 1 Mbit/s, 200 ms there and back; `{cable}` pulls the cable", ""),
        ]

    return said


def _make_places(plan: Plan, lab: Path, office: Path) -> None:
    """Configurations, certificates and rights, all anew; recordings and users stay."""
    for config in (lab, office):
        shutil.rmtree(config.parent / "site", ignore_errors=True)
        config.unlink(missing_ok=True)
    write_configuration(plan)
    at_home, away = lab.parent / "site", office.parent / "site"
    make_site(at_home, LAB, ("simulator",))
    write_place(lab, LAB, at_home, f"tls/127.0.0.1:{plan.bus_port}", plan.bus_port)
    address = f"tls/127.0.0.1:{plan.bus_port + 2}"
    given, _ = invite(at_home, OFFICE, "operator", address, LIFE)
    made = new_requests()
    answer = Registrar(at_home).join(join_question(given, made))
    away.mkdir(parents=True)
    (away / TRUSTED).write_text(given.trusted)
    keep(away, answer, {role: key for role, (key, _) in made.items()}, given.trusted.encode())
    router = plan.bus_port + 1
    write_place(
        office, LAB, away, f"tls/127.0.0.1:{router}", router, _of_office(plan, office.parent)
    )


def _of_office(plan: Plan, folder: Path) -> Settings:
    page = DashboardSettings(
        host=plan.host,
        port=plan.port + 1,
        users=folder / "users.json",
        sessions_root=folder / "sessions",
        demo=True,
    )
    return Settings(dashboard=page, recorder=RecorderSettings(root=folder / "sessions"))


def _supervise(supervisor: Supervisor, plan: Plan, lab: Path, office: Path) -> None:
    port = lab.parent / "board"
    for place, config in ((LAB, lab), (OFFICE, office)):
        for service in services(load(config)):
            hushed = (f"{port}: not there", f"{port}: open") if service == "gateway" else None
            name = service if place == LAB else f"{OFFICE}-{service}"
            words = COMMANDS.get(service, (service,))
            supervisor.add(name, *words, "--config", str(config), hushed=hushed)
    add_board(supervisor, plan, lab)
