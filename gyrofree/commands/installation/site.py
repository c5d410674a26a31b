"""`gyrofree site`: several places that work as one, over encrypted links."""

import datetime as dt
import json
import sys
import threading
from pathlib import Path
from typing import Annotated

import typer
import zenoh
from rich.table import Table

from gyrofree.commands.installation.site_status import site_status
from gyrofree.commands.installation.zenohd import zenohd_config
from gyrofree.commands.options import AsJson, Config, Verbose, say, settings_of, show_table
from gyrofree.commands.parser import Commands, output_folder
from gyrofree.config import DEFAULT_PATH, ConfigError, Settings
from gyrofree.operations.attending import attended
from gyrofree.running.process import (
    EXIT_CONFIG,
    EXIT_FAILED,
    EXIT_TAKEN,
    fail,
    run_service,
    start_logging,
    stop_on_signals,
)
from messages.contract.names import NAME
from sites.place import SiteError, load_place

FOLDER = Path("var/site")
PORT = 7447

app = Commands(
    no_args_is_help=True,
    rich_markup_mode=None,
    help="Several places as one site: make it, invite, join, prove who may do what.",
)

Folder = Annotated[
    Path,
    typer.Option(callback=output_folder(), help="Folder of this place's certificates and keys."),
]
File = Annotated[Path, typer.Option("--config", "-c", help="Configuration to be written.")]


def _named(name: str) -> str:
    if not NAME.fullmatch(name):
        raise typer.BadParameter(
            f"{name[:40]!r}: want a-z, 0-9, _ and - after a first letter, at most 32 characters"
        )
    return name


@app.command("init")
def site_init(
    name: Annotated[str, typer.Argument(help="Name of the site.", callback=_named)],
    folder: Folder = FOLDER,
    port: Annotated[int, typer.Option(min=1, max=65535, help="Port of the router.")] = PORT,
    simulator: Annotated[
        bool, typer.Option("--simulator", help="Also a certificate for a simulated board.")
    ] = False,
    as_json: AsJson = False,
    config: File = DEFAULT_PATH,
) -> None:
    """Make a site whose home is here: its authority, certificates, and the configuration."""
    from gyrofree.setup.site import of_no_site, unfinished, write_place
    from sites.joining import make_site

    try:
        of_no_site(config, folder)
        place = unfinished(config, folder)
        if place is None or (place.site, place.at_home) != (name, True):
            place = make_site(folder, name, ("simulator",) if simulator else ())
        write_place(config, place.site, folder, f"tls/127.0.0.1:{port}", port)
    except (SiteError, ConfigError, OSError) as error:
        raise fail(error, EXIT_CONFIG) from None
    if as_json:
        return say(json.dumps({"site": name, "folder": str(folder), "config": str(config)}))
    say(f"site {name}: authority and certificates in {folder}; {config} written")
    say("keep a copy of that folder in a safe place: who has authority/ca.key can let anybody in")
    say("next: `gyrofree up`; `gyrofree site invite PLACE --address HOST` lets others watch")


@app.command("invite")
def site_invite(
    place: Annotated[str, typer.Argument(help="Name for the other place.", callback=_named)],
    address: Annotated[
        str, typer.Option(help="Where its router is reached from here: HOST or HOST:PORT.")
    ],
    seat: Annotated[
        str, typer.Option(help="What its people may do here: viewer or operator.")
    ] = "viewer",
    days: Annotated[float, typer.Option(min=0.001, max=90.0, help="Until it ends.")] = 7.0,
    as_json: AsJson = False,
    config: Config = None,
) -> None:
    """Print a one-time invitation for another place, and call its router from now on."""
    from sites.invitation import invite

    if seat not in ("viewer", "operator"):
        raise typer.BadParameter(f"{seat!r}: want viewer or operator", param_hint="--seat")
    folder, life = _folder(settings_of(config)), dt.timedelta(days=days)
    try:
        invitation, _ = invite(folder, place, seat, _endpoint(address), life)
    except (SiteError, OSError) as error:
        raise fail(error, EXIT_FAILED) from None
    if as_json:
        line = {"place": place, "seat": seat, "ends": invitation.ends.isoformat()}
        return say(json.dumps(line | {"invitation": invitation.line()}))
    say(f"once, until {invitation.ends:%Y-%m-%d %H:%M UTC}, at {place}:", file=sys.stderr)
    say("  gyrofree site join", file=sys.stderr)
    say(invitation.line())


@app.command("join")
def site_join(
    invitation: Annotated[
        str, typer.Argument(help="The line, or a file with it; left out: it is asked for.")
    ] = "",
    listen: Annotated[
        str, typer.Option(help="Where the home may call: ADDRESS or ADDRESS:PORT.")
    ] = "0.0.0.0",
    folder: Folder = FOLDER,
    as_json: AsJson = False,
    config: File = DEFAULT_PATH,
) -> None:
    """Join a site by an invitation: waits for its home to call, then writes the configuration."""
    from gyrofree.setup.site import of_no_site, unfinished, write_place
    from sites.invitation import read_invitation
    from sites.joining import join

    line = invitation or typer.prompt("Invitation", hide_input=True)
    try:
        if not line.startswith("gyrofree-") and Path(line).is_file():
            line = Path(line).read_text(errors="replace")
        start_logging()
        of_no_site(config, folder)
        endpoint, stop = _endpoint(listen), stop_on_signals()
        invited, place = read_invitation(line), unfinished(config, folder)
        if place is None or (place.site, place.place) != (invited.site, invited.place):
            place = join(folder, invited, endpoint, stop, lambda text: say(text, file=sys.stderr))
        write_place(config, place.site, folder, endpoint, int(endpoint.rpartition(":")[2]))
    except (SiteError, ConfigError, OSError) as error:
        raise fail(error, EXIT_CONFIG) from None
    except zenoh.ZError as error:
        raise fail(f"{listen}: {str(error).split(' at /')[0]}", EXIT_TAKEN) from None
    if as_json:
        return say(place.model_dump_json())
    say(f"{place.place} has joined {place.site}, its people as {place.seat}; {config} written")
    say("next: `gyrofree up`")


@app.command("show")
def site_show(as_json: AsJson = False, config: Config = None) -> None:
    """Who this place is, its peers, and when its certificates end."""
    from sites.service import own_certificates

    folder = _folder(settings_of(config))
    try:
        place, ends = load_place(folder), own_certificates(folder)
    except SiteError as error:
        raise fail(error, EXIT_CONFIG) from None
    if as_json:
        told = place.model_dump(mode="json")
        return say(json.dumps(told | {"certificates": {r: e.isoformat() for r, e in ends.items()}}))
    say(f"place {place.place} of site {place.site}; home {place.home}; people as {place.seat}")
    for peer in place.peers:
        say(f"  calls {peer.place} at {peer.address}, whose people are {peer.seat}s")
    for role, end in ends.items():
        say(f"  certificate of {role} until {end:%Y-%m-%d %H:%M UTC}")


app.command("status")(site_status)
app.command("zenohd-config")(zenohd_config)


@app.command("copies")
def site_copies(as_json: AsJson = False, config: Config = None) -> None:
    """Home's recordings that are here, with the sha256 of both."""
    from sites.copying.fetching import load_copies

    found = load_copies(_folder(settings_of(config)))
    if as_json:
        return say(json.dumps(found, indent=1))
    if not found:
        say("no copies yet: at home there is nothing to copy, elsewhere `gyrofree up` makes them")
    for session, copy in sorted(found.items()):
        for name, both in copy.get("files", {}).items():
            equal = "equal" if both["home_sha256"] == both["here_sha256"] else "DIFFERENT"
            say(f"{session}  {name:<16} {equal}  {both['here_sha256']}  {copy['equal_since']}")


@app.command("remove")
def site_remove(
    place: Annotated[str, typer.Argument(help="Name of the place.")],
    as_json: AsJson = False,
    config: Config = None,
) -> None:
    """Send a place away: its certificates lose every right, and it is not called any more."""
    from sites.removal import remove

    try:
        count = remove(_folder(settings_of(config)), place)
    except (SiteError, OSError) as error:
        raise fail(error) from None
    if as_json:
        return say(json.dumps({"place": place, "revoked": count}))
    say(f"{place} is removed, {count} certificates revoked; `gyrofree up` lets it in no more")


@app.command("check")
def site_check(as_json: AsJson = False, config: Config = None) -> None:
    """Try what each certificate of this place may do, on a router of its own with the same rules.

    Ends with 1 where the router lets through what it must not, or drops what it should not.
    """
    from gyrofree.setup.site import access
    from sites.check import try_all
    from sites.service import own_certificates

    settings = settings_of(config)
    folder = _folder(settings)
    boards = [device.name for device in settings.gateway.devices] or ["board"]
    settings = _with_board(settings, boards[0])
    try:
        place = load_place(folder)
        rules, roles = access(settings, folder, place), list(own_certificates(folder))
        if not as_json:
            say(f"trying {len(roles)} certificates, a few seconds ...", file=sys.stderr)
        found = try_all(folder, place, rules, roles, boards[0])
    except (SiteError, ConfigError, ConnectionError) as error:
        raise fail(error, EXIT_CONFIG) from None
    except zenoh.ZError as error:
        raise fail(str(error).split(" at /")[0]) from None
    if as_json:
        rows = [
            {"role": v.role, "deed": v.deed, "allowed": v.allowed, "good": v.good} for v in found
        ]
        say(json.dumps(rows))
    else:
        _matrix(found)
    wrong = [verdict.text for verdict in found if not verdict.good]
    for line in wrong:
        say(line, file=sys.stderr)
    if wrong:
        raise typer.Exit(EXIT_FAILED)


@app.command("serve")
def site_serve(config: Config = None, verbose: Verbose = False) -> None:
    """Let invited places join, renew certificates in time, copy recordings; `up` runs it."""
    settings = settings_of(config)
    folder = _folder(settings)

    def body(stop: threading.Event) -> None:
        from gyrofree.setup.site import own_alarms
        from sites import service

        try:
            sessions, beside = Path(settings.recorder.root), own_alarms(settings)
            bus = settings.bus.acting_as("authority")
            service.run(folder, sessions, bus, stop, settings.site, beside)
        except SiteError as error:
            raise ConfigError(str(error)) from None

    run_service(body, verbose, attended(settings, "authority"))


def _folder(settings: Settings) -> Path:
    if settings.bus.tls is None:
        raise fail(
            "this installation belongs to no site: `gyrofree site init NAME` makes one, `gyrofree"
            " site join` joins one",
            EXIT_CONFIG,
        )
    return settings.bus.tls


def _endpoint(text: str) -> str:
    """ "tls/host:port" of an address as people write it."""
    host, colon, port = text.rpartition(":")
    if not colon or not port.isdigit() or (":" in host and not host.startswith("[")):
        host, port = text, str(PORT)
    host = f"[{host}]" if ":" in host and not host.startswith("[") else host
    if not host or any(character in host for character in " /#?,\n") or not 0 < int(port) < 65536:
        raise typer.BadParameter(f"{text[:60]!r}: want HOST, or HOST:PORT")
    return f"tls/{host}:{port}"


def _with_board(settings: Settings, name: str) -> Settings:
    """The rules of a place without boards are tried with one of this name."""
    if settings.gateway.devices:
        return settings
    from gateway.settings import DeviceSettings

    gateway = settings.gateway.model_copy(
        update={"devices": [DeviceSettings(name=name, port="/dev/null")]}
    )
    return settings.model_copy(update={"gateway": gateway})


def _matrix(found: list) -> None:
    """One row for each deed, one column for each certificate."""
    roles = list(dict.fromkeys(verdict.role for verdict in found))
    by = {(verdict.deed, verdict.role): verdict for verdict in found}
    rows = []
    for deed in dict.fromkeys(verdict.deed for verdict in found):
        cells = [by[deed, role] for role in roles]
        rows.append([deed, *(_cell(cell) for cell in cells)])
    table = Table(*(["what", *roles]), box=None)
    for row in rows:
        table.add_row(*row)
    show_table(table)


def _cell(verdict) -> str:
    return ("yes" if verdict.allowed else "-") + ("" if verdict.good else " WRONG")
