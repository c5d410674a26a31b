"""`gyrofree setup` from listening to the written file: what is heard proposes, a person decides."""

import os
import sys
from dataclasses import dataclass
from pathlib import Path

from dashboard.web.users import USER_NAME, Role, UsersError, add_user, load_users
from gyrofree.config import ConfigError, Settings, load
from gyrofree.running.process import EXIT_CONFIG, fail
from gyrofree.setup.answers import NAMES, Answers, free_name, layouts_for, settings_with, write
from gyrofree.setup.asked import Asker, password_in
from gyrofree.setup.ear import BOARD, RECEIVER, Board
from gyrofree.setup.ports import BAUDS, Found, listen, names
from messages.contract.names import NAME

WHAT_IT_IS = {"cube": 12, "imu": 6, "analogue": 0}  # axes to propose layouts for, before any sample


@dataclass(frozen=True)
class Wishes:
    """What the command line has answered already; None or "": to be asked."""

    port: str = ""
    baud: int | None = None
    name: str = ""
    layout: str = ""
    half_side_m: float | None = None
    pulses_per_rev: int | None = None
    gnss_port: str | None = None
    gnss_baud: int | None = None
    user: str | None = None
    password_file: str = ""
    dashboard_port: int | None = None
    bus_port: int | None = None


@dataclass(frozen=True)
class Manner:
    """How it is done."""

    config: Path
    ports_in: Path
    seconds: float  # to listen at a port
    listen: bool
    look: bool  # listen only
    force: bool
    yes: bool  # ask nothing
    silent: bool  # nor say anything


def hold(wishes: Wishes, manner: Manner) -> dict:
    """Listen, ask, write; what came of it. Ends the command with a word where it cannot go on."""
    asker = Asker(manner.yes or not sys.stdin.isatty(), manner.silent)
    before = _before(manner, asker)
    found = _heard(wishes, manner, asker)
    result: dict = {"ports": [one.as_dict() for one in found]}
    if manner.look:
        if not found:
            raise fail("no serial port is there")
        return result
    answers = _answers(wishes, found, before, asker)
    try:
        settings = settings_with(before, answers)
    except ConfigError as error:
        raise fail(error, EXIT_CONFIG) from None
    user = _user(wishes, settings, asker)
    try:
        kept = write(manner.config, settings)
        if user:
            add_user(settings.dashboard.users, *user, Role.admin)
    except (OSError, UsersError) as error:
        raise fail(error) from None
    words = "gyrofree up" + _named(manner.config)
    asker.say(f"written: {manner.config}" + (f"; the old one is {kept}" if kept else ""))
    if user:
        asker.say(f"{user[0]} may sign in as administrator")
    asker.say(f"next:  {words}", "bold green")
    device = next(d for d in settings.gateway.devices if d.name == answers.name)
    return result | {
        "file": str(manner.config),
        "kept": str(kept) if kept else None,
        "device": device.model_dump(mode="json", exclude_unset=True),
        "layout": settings.estimator.layout_of(answers.name).model_dump(mode="json"),
        "user": user[0] if user else None,
        "next": words,
    }


def _named(config: Path) -> str:
    return "" if config == Path("gyrofree.toml") else f" --config {config}"


def _before(manner: Manner, asker: Asker) -> Settings:
    """What the file says that is there; another than the defaults is only changed when that is
    meant.
    """
    path = manner.config
    if not path.exists():
        return Settings()
    try:
        before = load(path)
    except ConfigError as error:
        if manner.force:
            return Settings()
        raise fail(f"{error}\n--force writes it anew and keeps it as a copy", EXIT_CONFIG) from None
    if manner.look or manner.force or before == Settings():
        return before
    boards = ", ".join(device.name for device in before.gateway.devices) or "no board"
    what = f"{path} is in use already ({boards})"
    if asker.quiet:
        raise fail(f"{what}: --force adds the board and keeps a copy", EXIT_CONFIG)
    if not asker.yes(f"{what}. Add a board to it, and keep a copy of it as it is?", False):
        raise fail("nothing was written; --config FILE writes another file")
    return before


def _heard(wishes: Wishes, manner: Manner, asker: Asker) -> list[Found]:
    """What speaks on the port that was named, and on those that are there."""
    there = names(manner.ports_in)
    wanted = [p for p in (wishes.port, wishes.gnss_port) if p]
    ports = list(dict.fromkeys([*wanted, *([] if wishes.port and not manner.look else there)]))
    if not manner.listen:
        return []
    if not ports:
        asker.say("no serial port is there: plug the board in, or name a port of its own", "yellow")
    bauds = {wishes.port: wishes.baud, wishes.gnss_port: wishes.gnss_baud}
    found = [listen(port, bauds.get(port), manner.seconds, asker.say) for port in ports]
    asker.heard(found)
    return found


def _answers(wishes: Wishes, found: list[Found], before: Settings, asker: Asker) -> Answers:
    chosen = _board(wishes, found, asker)
    heard = chosen.ear.board if chosen.ear is not None and chosen.kind == BOARD else Board()
    kind = heard.kind or "cube"
    taken = {device.name for device in before.gateway.devices if device.port != chosen.port}
    name = wishes.name or asker.text(
        "Name of the board on the bus",
        _name_of(chosen.port, before) or free_name(NAMES[kind], taken),
        lambda text: "" if NAME.fullmatch(text) else "want a-z, 0-9, _ and - after a first letter",
    )
    layout, half_side_m = "cube", 0.05
    if kind == "cube":
        layout, half_side_m = _layout(wishes, heard.axes or WHAT_IT_IS[kind], before, name, asker)
    pulses = wishes.pulses_per_rev or asker.whole(
        "Tachometer: pulses in one turn of the table", 360, 1, 1_000_000
    )
    gnss_port, gnss_baud = _receiver(wishes, found, heard, chosen, asker)
    baud = wishes.baud or chosen.baud
    return Answers(
        chosen.port,
        name,
        baud,
        kind,
        layout,
        half_side_m,
        pulses,
        gnss_port,
        gnss_baud,
        wishes.dashboard_port,
        wishes.bus_port,
    )


def _board(wishes: Wishes, found: list[Found], asker: Asker) -> Found:
    """The port that was named or is chosen, with what was heard there."""
    by_name = {one.port: one for one in found}
    likely = [one for one in found if one.kind == BOARD] or found
    if wishes.port:
        return by_name.get(wishes.port) or Found(wishes.port, wishes.baud or BAUDS[0], None)
    if asker.quiet and len([one for one in found if one.kind == BOARD]) != 1:
        heard = "; ".join(f"{one.port}: {one.said}" for one in found) or "no serial port is there"
        raise fail(f"which port is the board's? Name it with --port. {heard}", EXIT_CONFIG)
    proposal = str(found.index(likely[0]) + 1) if likely else ""

    answer = asker.text(
        "Port of the board: its number above, or a path",
        proposal,
        lambda text: (
            _listed(text, found) if text else "want a path such as /dev/ttyUSB0, or tcp://host:port"
        ),
    )
    if answer.isdecimal() and 0 < int(answer) <= len(found):
        return found[int(answer) - 1]
    return by_name.get(answer) or Found(answer, wishes.baud or BAUDS[0], None)


def _listed(text: str, found: list[Found]) -> str:
    """Why a number is none of the ports that were listed; "" for a path too."""
    if text.isdecimal() and not 0 < int(text) <= len(found):
        return f"no port {text} in the list above"
    return ""


def _name_of(port: str, before: Settings) -> str:
    """The board that was on this port before."""
    return next((d.name for d in before.gateway.devices if d.port == port), "")


def _layout(
    wishes: Wishes, axes: int, before: Settings, name: str, asker: Asker
) -> tuple[str, float]:
    known, old = layouts_for(axes), before.estimator.layout_of(name)

    def right(text: str) -> str:
        if text in layouts_for(0) or (text.endswith(".toml") and os.path.isfile(text)):
            return ""
        return f"{text!r}: want one of {', '.join(known)}, or a TOML file that is there"

    layout = wishes.layout
    if layout and (fault := right(layout)):
        raise fail(f"--layout {fault}", EXIT_CONFIG)
    proposal = old.file or (old.kind if old.kind in known else known[0])
    layout = layout or asker.text(
        f"Layout of its {axes} accelerometer axes ({', '.join(known)}, or a TOML file)",
        proposal,
        right,
    )
    if layout.endswith(".toml"):
        return layout, old.half_side_m
    half = wishes.half_side_m or asker.number(
        "Half side: from the centre to a face, m", old.half_side_m, 0.001, 10.0
    )
    return layout, half


def _receiver(
    wishes: Wishes, found: list[Found], heard: Board, chosen: Found, asker: Asker
) -> tuple[str, int]:
    """Port and baud of a receiver of its own; "" for none."""
    others = {one.port: one for one in found if one.kind == RECEIVER and one is not chosen}
    proposal = "" if heard.messages else next(iter(others), "")
    port = wishes.gnss_port
    if port is None:
        port = asker.text(
            "Port of a GNSS receiver of its own (empty: none)",
            proposal,
            lambda text: _listed(text, found),
        )
    if port.isdecimal() and 0 < int(port) <= len(found):
        port = found[int(port) - 1].port
    if not port:
        return "", 38400
    baud = wishes.gnss_baud or (others[port].baud if port in others else 0)
    return port, baud or asker.whole("Baud of the receiver", 38400, 1200, 4_000_000)


def _user(wishes: Wishes, settings: Settings, asker: Asker) -> tuple[str, str] | None:
    """Name and password of the first user; None where there is one, or none is wanted."""
    try:
        known = load_users(settings.dashboard.users)
    except UsersError as error:
        raise fail(error, EXIT_CONFIG) from None
    name = wishes.user
    if name is None:
        if known or asker.quiet:
            return None
        name = asker.text(
            "First user, an administrator (empty: none; `gyrofree up` prints a link instead)",
            "",
            lambda text: "" if not text or USER_NAME.fullmatch(text) else "want letters, digits",
        )
    if not name:
        return None
    if wishes.password_file:
        return name, password_in(wishes.password_file)
    if asker.quiet:
        raise fail(f"--user {name}: the password comes by --password-file", EXIT_CONFIG)
    return name, asker.password(name)
