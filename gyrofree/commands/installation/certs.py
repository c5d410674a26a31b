"""`gyrofree certs`: the certificates of a site, issued and revoked at its home."""

import datetime as dt
import json
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from gyrofree.commands.installation.site import _folder, _named
from gyrofree.commands.options import AsJson, Config, say, settings_of, show_table
from gyrofree.commands.parser import Commands, output_folder
from gyrofree.running.process import EXIT_CONFIG, EXIT_FAILED, fail
from sites.place import SiteError, load_place

app = Commands(
    no_args_is_help=True,
    rich_markup_mode=None,
    help="Certificates of a site: list, issue for another machine, renew, revoke.",
)


@app.command("list")
def certs_list(as_json: AsJson = False, config: Config = None) -> None:
    """All that count here: role, place, end, and whether they stand."""
    from sites.enrolment import known_here

    folder = _folder(settings_of(config))
    try:
        found = known_here(folder, load_place(folder))
    except SiteError as error:
        raise fail(error, EXIT_CONFIG) from None
    now = dt.datetime.now(dt.UTC)
    if as_json:
        rows = [e.model_dump(mode="json") | {"stands": e.stands(now)} for e in found]
        return say(json.dumps(rows, indent=1))
    table = Table("name", "role", "place", "boards", "ends (UTC)", "", box=None)
    for each in found:
        ends = f"{each.ends:%Y-%m-%d %H:%M}"
        boards = ", ".join(each.devices)
        table.add_row(each.common_name, each.role, each.place, boards, ends, _state(each, now))
    show_table(table)


@app.command("issue")
def certs_issue(
    role: Annotated[str, typer.Argument(help="gateway, viewer, operator, simulator ...")],
    name: Annotated[str, typer.Argument(help="Name of the machine.", callback=_named)],
    out: Annotated[
        Path, typer.Option(callback=output_folder(), help="Folder for its files; carry it there.")
    ],
    board: Annotated[
        list[str] | None, typer.Option(help="A gateway's board; may stand often.")
    ] = None,
    days: Annotated[float, typer.Option(min=0.001, max=3650.0, help="Until it ends.")] = 90.0,
    as_json: AsJson = False,
    config: Config = None,
) -> None:
    """Key and certificate for a process on another machine of this place."""
    from sites.authority import Authority
    from sites.handing_out import hand_out

    folder = _folder(settings_of(config))
    try:
        issued = hand_out(
            Authority(folder), folder, role, name, tuple(board or ()), dt.timedelta(days=days), out
        )
    except (SiteError, OSError) as error:
        raise fail(error, EXIT_FAILED) from None
    if as_json:
        return say(issued.model_dump_json())
    say(f"{issued.common_name} until {issued.ends:%Y-%m-%d %H:%M UTC} in {out}")


@app.command("renew")
def certs_renew(
    role: Annotated[str, typer.Argument(help="Of this role; left out: all of this place.")] = "",
    as_json: AsJson = False,
    config: Config = None,
) -> None:
    """New keys and certificates for this place now, at its home; `up` does it in time.

    Also where a file of theirs is damaged or gone.
    """
    from sites.authority import Authority
    from sites.enrolment import Registrar, is_whole
    from sites.joining import issue_here
    from sites.roles import SERVICES
    from sites.service import own_roles, renew

    folder = _folder(settings_of(config))
    try:
        place = load_place(folder)
        if not place.at_home:
            raise SiteError(
                "away from home certificates are renewed by `gyrofree up`, over the bus"
            )
        there = list(dict.fromkeys((*own_roles(folder), *SERVICES)))
        if role and role not in there:
            raise SiteError(f"no certificate of {role!r} here; there are {', '.join(there)}")
        chosen = [role] if role else own_roles(folder)
        for each in chosen:
            if is_whole(folder, each):
                renew(folder, each, Registrar(folder).renew_own)
            else:
                issue_here(folder, Authority(folder), place, (each,))
    except (SiteError, OSError, ValueError) as error:
        raise fail(error, EXIT_FAILED) from None
    say(json.dumps({"renewed": chosen}) if as_json else f"renewed: {', '.join(chosen)}")


@app.command("revoke")
def certs_revoke(
    common_name: Annotated[str, typer.Argument(help="As `gyrofree certs list` shows it.")],
    as_json: AsJson = False,
    config: Config = None,
) -> None:
    """Take every right from a certificate; its name is never given again."""
    from sites.authority import Authority

    try:
        count = Authority(_folder(settings_of(config))).revoke(common_name)
    except (SiteError, OSError) as error:
        raise fail(error, EXIT_FAILED) from None
    if as_json:
        return say(json.dumps({"common_name": common_name, "revoked": count}))
    say(f"{common_name}: {count} revoked; a running `gyrofree up` shuts it out at once")


def _state(each, now: dt.datetime) -> str:
    if each.revoked is not None:
        return f"revoked {each.revoked:%Y-%m-%d}"
    return "good" if each.stands(now) else "ended"
