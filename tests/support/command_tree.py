"""Every command of the command line, by its name."""

import typer

from gyrofree.commands.main import app


def commands(command=None, name=()):
    """Commands below one (without it: all of them) with the words that lead to each."""
    command = command or typer.main.get_command(app)
    if not hasattr(command, "commands"):
        return {" ".join(name): command}
    found = {}
    for key, inner in command.commands.items():
        found |= commands(inner, (*name, key))
    return found
