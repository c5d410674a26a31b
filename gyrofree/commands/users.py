"""`gyrofree users`: who may sign in to the dashboard."""

import json
import sys
from typing import Annotated

import typer

from dashboard.web.users import UsersError, add_user, load_users, remove_user
from gyrofree.commands.options import AsJson, Config, say, settings_of
from gyrofree.running.process import EXIT_CONFIG, fail

app = typer.Typer(
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
    say(f"{name} may sign in as {role}")


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
    try:
        remove_user(settings_of(config).dashboard.users, name)
    except UsersError as error:
        raise fail(error) from None
