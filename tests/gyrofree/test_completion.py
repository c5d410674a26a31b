"""What a shell is told after Tab: bash itself where it is, the others by how they ask."""

import os
import shutil
import subprocess
import sys

import pytest

ASK = "import sys; sys.argv = ['gyrofree']; from gyrofree.commands.main import main; main()"
SHELLS = ("bash", "zsh", "fish")


def asked(**variables):
    return subprocess.run(
        [sys.executable, "-P", "-c", ASK],
        env=os.environ | {"_GYROFREE_COMPLETE": "", **variables},
        capture_output=True,
        text=True,
        timeout=60,
    ).stdout


def script(shell):
    done = subprocess.run(
        [sys.executable, "-P", "-m", "gyrofree", "completion", shell],
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize(
    ("line", "wanted"),
    [("gyrofree con", {"config"}), ("gyrofree config ", {"check", "show", "default", "reference"})],
)
def test_each_shell_is_answered(line, wanted):
    words = line.split(" ")
    bash = asked(
        _GYROFREE_COMPLETE="complete_bash", COMP_WORDS=line, COMP_CWORD=str(len(words) - 1)
    )
    assert wanted <= set(bash.split())
    zsh = asked(_GYROFREE_COMPLETE="complete_zsh", _TYPER_COMPLETE_ARGS=line)
    fish = asked(
        _GYROFREE_COMPLETE="complete_fish",
        _TYPER_COMPLETE_ARGS=line,
        _TYPER_COMPLETE_FISH_ACTION="get-args",
    )
    for said in (zsh, fish):
        assert all(name in said for name in wanted), said


@pytest.mark.parametrize("shell", SHELLS)
def test_the_script_says_how_to_install_it_and_is_right_for_its_shell(shell):
    text = script(shell)
    assert "# To install: gyrofree completion " + shell in text
    assert f"complete_{shell}" in text and "_GYROFREE_COMPLETE" in text
    assert shell != "zsh" or text.startswith("#compdef gyrofree")
    if shutil.which(shell):
        checked = subprocess.run([shell, "-n"], input=text, text=True, capture_output=True)
        assert checked.returncode == 0, checked.stderr


@pytest.mark.skipif(not shutil.which("bash"), reason="bash is not here")
def test_tab_in_bash(tmp_path):
    """The function that the script defines, called as bash calls it."""
    program = tmp_path / "gyrofree"
    program.write_text(f'#!/bin/sh\nexec {sys.executable} -P -c "{ASK}"\n')
    program.chmod(0o755)
    after = f"""
COMP_WORDS=({program} up --w); COMP_CWORD=2
"$(complete -p gyrofree | sed 's/.*-F \\([^ ]*\\).*/\\1/')" {program}
printf '%s\\n' "${{COMPREPLY[@]}}"
"""
    done = subprocess.run(
        ["bash", "--norc"], input=script("bash") + after, capture_output=True, text=True, timeout=60
    )
    assert done.stdout.split() == ["--without"], done.stderr
