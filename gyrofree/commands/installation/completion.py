"""`gyrofree completion`: what has a shell complete commands, options and files."""

from enum import StrEnum
from typing import Annotated

import typer
from typer.completion import get_completion_script

from gyrofree.commands.options import say

VARIABLE = "_GYROFREE_COMPLETE"  # by which the shell asks the program
INSTALL = {
    "bash": "gyrofree completion bash > ~/.local/share/bash-completion/completions/gyrofree",
    "zsh": "gyrofree completion zsh > ~/.zfunc/_gyrofree   with fpath+=~/.zfunc before compinit",
    "fish": "gyrofree completion fish > ~/.config/fish/completions/gyrofree.fish",
}


class Shell(StrEnum):
    """Shells that are known."""

    bash = "bash"
    zsh = "zsh"
    fish = "fish"


def completion(
    shell: Annotated[Shell, typer.Argument(help="The shell: bash, zsh or fish.")],
) -> None:
    """Print what has the shell complete `gyrofree`, with the line that installs it.

    For the shell that runs: eval "$(gyrofree completion bash)".
    """
    script = get_completion_script(prog_name="gyrofree", complete_var=VARIABLE, shell=shell.value)
    # zsh wants its word for autoloaded functions on the first line.
    first, _, rest = script.partition("\n")
    note = f"# To install: {INSTALL[shell.value]}"
    say("\n".join([first, note, rest] if first.startswith("#compdef") else [note, script]))
