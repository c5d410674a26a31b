"""`gyrofree doctor`: what is wrong with this machine, and what to do."""

import json
from typing import Annotated

import typer
from rich.table import Table
from rich.text import Text

from gyrofree.commands.options import AsJson, Config, say, settings_of, show_table
from gyrofree.running.process import EXIT_CONFIG as CONFIG
from gyrofree.running.process import EXIT_FAILED, fail


def doctor(
    health: Annotated[
        str,
        typer.Option(help="Only ask this running service for a sign of life: router, gateway, ..."),
    ] = "",
    as_json: AsJson = False,
    config: Config = None,
) -> None:
    """Check ports, permissions, clock, disk and versions, and say what to do."""
    from gyrofree.running import doctor as examination

    settings = settings_of(config)
    services = ("router", *examination.SIGN_OF_LIFE, "dashboard")
    if health and health not in services:
        raise fail(f"--health {health!r}: want one of {', '.join(services)}", CONFIG)
    findings = [examination.health(health, settings)] if health else examination.examine(settings)
    if as_json:
        say(json.dumps(examination.as_json(findings), indent=2))
    else:
        table = Table("check", "state", "found", "what to do")
        colour = {"ok": "green", "warn": "yellow", "fail": "bold red"}
        for finding in findings:
            state = Text(finding.state, colour[finding.state])
            table.add_row(finding.check, state, finding.found, finding.remedy)
        show_table(table)
    if any(finding.state == "fail" for finding in findings):
        raise typer.Exit(EXIT_FAILED)
