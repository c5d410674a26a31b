"""`gyrofree users`: who may sign in to the dashboard."""

import json
import os
import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import typer

from dashboard.web.accounts.audit import Audit
from dashboard.web.programs.tokens import issue_token, load_tokens, revoke_token
from dashboard.web.users import UsersError, add_user, load_users, remove_user
from gyrofree.commands.options import AsJson, Config, say, settings_of
from gyrofree.commands.parser import Commands
from gyrofree.running.process import EXIT_CONFIG, fail

app = Commands(
    no_args_is_help=True, rich_markup_mode=None, help="Who may sign in to the dashboard."
)


@app.command("add")
def users_add(
    name: Annotated[str, typer.Argument(help="User name.")],
    role: Annotated[
        str,
        typer.Option(help="viewer looks, operator also records and drives, admin manages users."),
    ],
    config: Config = None,
) -> None:
    """Add a user or change password and role; the password is asked for, or read from standard
    input.
    """
    settings = settings_of(config)
    interactive = sys.stdin.isatty()
    password = (
        typer.prompt("Password", hide_input=True, confirmation_prompt=True)
        if interactive
        else input()
    )
    try:
        add_user(settings.dashboard.users, name, password, role)
    except UsersError as error:
        raise fail(error, EXIT_CONFIG) from None
    _written(settings.dashboard.users, f"user made or changed, {role}", name)
    say(f"{name} may sign in as {role}")


tokens = Commands(
    no_args_is_help=True, rich_markup_mode=None, help="API tokens: for programs, with an end."
)
app.add_typer(tokens, name="token")


@tokens.command("create")
def token_create(
    user: Annotated[str, typer.Argument(help="User whose token it is.")],
    name: Annotated[str, typer.Option(help="What it is for.")],
    role: Annotated[str, typer.Option(help="At most what the user may do.")] = "viewer",
    days: Annotated[float, typer.Option(min=0.001, max=36500.0, help="Until it ends.")] = 90.0,
    config: Config = None,
) -> None:
    """Make a token and print it on standard output, once: only its hash is kept."""
    try:
        users_file = settings_of(config).dashboard.users
        secret, entry = issue_token(users_file, user, name, role, days)
    except UsersError as error:
        raise fail(error, EXIT_CONFIG) from None
    _written(users_file, "token made", f"{entry.id} ({name}) of {user}, {role}")
    say(f"token {entry.id} of {user} ({role}) ends {_day(entry.ends)}", file=sys.stderr)
    say(secret)


@tokens.command("list")
def token_list(as_json: AsJson = False, config: Config = None) -> None:
    """Tokens, their roles and ends; never the tokens themselves."""
    try:
        found = load_tokens(settings_of(config).dashboard.users).values()
    except UsersError as error:
        raise fail(error) from None
    if as_json:
        kept = ("id", "user", "name", "role", "created", "ends")
        say(json.dumps([{key: getattr(one, key) for key in kept} for one in found], indent=2))
        return
    if not found:
        say("no tokens; make one: gyrofree users token create USER --name 'what it is for'")
    for one in found:
        end = "ended" if one.over else "ends"
        say(f"{one.id}\t{one.user}\t{one.role}\t{end} {_day(one.ends)}\t{one.name}")


@tokens.command("revoke")
def token_revoke(
    token: Annotated[str, typer.Argument(help="Id of the token, as `list` shows it.")],
    config: Config = None,
) -> None:
    """Take a token back; it is of no use at once."""
    try:
        users_file = settings_of(config).dashboard.users
        gone = revoke_token(users_file, token)
    except UsersError as error:
        raise fail(error) from None
    _written(users_file, "token revoked", f"{gone.id} ({gone.name}) of {gone.user}")
    say(f"token {gone.id} ({gone.name}) of {gone.user} is revoked")


def _written(users_file: Path, what: str, detail: str) -> None:
    """In the page's log of who did what; the account of this machine is who."""
    Audit(users_file).done(what, f"command line, account {os.getuid()}", detail=detail)


def _day(seconds: float) -> str:
    return datetime.fromtimestamp(seconds, UTC).strftime("%Y-%m-%d %H:%M UTC")


@app.command("list")
def users_list(as_json: AsJson = False, config: Config = None) -> None:
    """Users and their roles."""
    try:
        found = load_users(settings_of(config).dashboard.users)
    except UsersError as error:
        raise fail(error) from None
    if as_json:
        say(
            json.dumps(
                [{"name": user.name, "role": user.role.name} for user in found.values()], indent=2
            )
        )
        return
    if not found:
        say("nobody may sign in yet; add somebody: gyrofree users add NAME --role operator")
    for user in found.values():
        say(f"{user.name}\t{user.role.name}")


@app.command("remove")
def users_remove(
    name: Annotated[str, typer.Argument(help="User name.")], config: Config = None
) -> None:
    """Take a user's right to sign in."""
    users_file = settings_of(config).dashboard.users
    try:
        remove_user(users_file, name)
    except UsersError as error:
        raise fail(error) from None
    _written(users_file, "user removed", name)
