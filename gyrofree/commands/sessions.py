"""`gyrofree sessions`, `export`, `report`, `rerun`, `reprocess`: what happened, found, checked,
compared, handed on.
"""

import json
import sys
from dataclasses import asdict
from datetime import UTC, datetime
from typing import Annotated, Any

import typer
from rich.table import Column, Table

from gyrofree.commands.annotate import note, tag
from gyrofree.commands.compare import compare
from gyrofree.commands.options import (
    AsJson,
    Config,
    SessionId,
    catalogue_of,
    nothing_in,
    say,
    settings_of,
    show_table,
)
from gyrofree.commands.parser import Commands
from gyrofree.commands.run import progress_bar
from gyrofree.running.process import EXIT_FAILED, fail
from sessions.library.annotations import read_annotations
from sessions.library.catalogue import Catalogue
from sessions.library.copied import read_copied
from sessions.recording.manifest import SessionError

app = Commands(
    no_args_is_help=True,
    rich_markup_mode=None,
    help="Recorded sessions: list, look, verify, delete.",
)
app.command("compare")(compare)


@app.command("list")
def list_sessions(
    search: Annotated[
        str, typer.Option(help="Words that id, device, tags, notes or state must have.")
    ] = "",
    as_json: AsJson = False,
    config: Config = None,
) -> None:
    """All sessions, newest first."""
    try:
        rows = [
            row for row in summaries(catalogue_of(settings_of(config))) if _matches(row, search)
        ]
    except SessionError as error:
        raise fail(error) from None
    if as_json:
        say(json.dumps(rows, indent=2))
        return
    if not rows:
        say(nothing_in(catalogue_of(settings_of(config)).root, search))
        return
    head = ("device", "start (UTC)", "length", "state", "complete", "size", "tags", "title")
    table = Table(Column("id", no_wrap=True), *head)
    for row in rows:
        start = datetime.fromtimestamp(row["start_utc_s"], UTC)
        table.add_row(
            row["id"],
            ", ".join(row["devices"]),
            f"{start:%Y-%m-%d %H:%M:%S}",
            f"{row['seconds']:.1f} s",
            row["state"],
            _percent(row["completeness"]),
            f"{row['bytes'] / 1e6:.2f} MB",
            ", ".join(row["tags"]),
            row["title"],
        )
    show_table(table)


def summaries(catalogue: Catalogue) -> list[dict[str, Any]]:
    """One dict per session, for people and programs; raises SessionError."""
    rows = []
    for info in catalogue.list():
        notes = info.annotations
        total = info.messages + info.lost
        rows.append(
            {
                "id": info.id,
                "devices": list(info.devices),
                "sources": list(info.sources),
                "start_utc_s": info.start_utc_ns / 1e9,
                "seconds": info.seconds,
                "state": info.state,
                "bytes": info.bytes,
                "messages": info.messages,
                "lost": info.lost,
                "completeness": info.messages / total if total else None,
                "note": info.note,
                "title": notes.title,
                "tags": notes.tags,
                "outcome": notes.outcome,
                "notes": len(notes.notes),
                "problem": info.problem,
            }
        )
    return rows


def _matches(row: dict[str, Any], search: str) -> bool:
    hay = " ".join(
        str(row[name])
        for name in ("id", "devices", "sources", "state", "note", "title", "tags", "outcome")
    )
    return all(word in hay.lower() for word in search.lower().split())


def _percent(share: float | None) -> str:
    return "unknown" if share is None else f"{100 * share:.4g} %"


@app.command()
def show(session: SessionId, as_json: AsJson = False, config: Config = None) -> None:
    """Everything that is known of one session: topics, losses, versions, notes."""
    catalogue = catalogue_of(settings_of(config))
    try:
        catalogue.get(session)
        manifest, notes = catalogue.manifest(session), read_annotations(catalogue.root / session)
        copied = read_copied(catalogue.root / session)
    except SessionError as error:
        raise fail(error) from None
    if as_json:
        say(
            json.dumps(
                manifest.model_dump(mode="json")
                | {"annotations": notes.model_dump(mode="json")}
                | {"copied": copied and copied.model_dump(mode="json")},
                indent=2,
            )
        )
        return
    say(
        f"{manifest.id}: {manifest.state}, {manifest.bytes / 1e6:.2f} MB, sha256"
        f" {manifest.sha256 or 'not yet'}"
    )
    for name, value in (
        ("note", manifest.note),
        ("title", notes.title),
        ("tags", ", ".join(notes.tags)),
        ("outcome", notes.outcome),
        ("recovery", manifest.recovery),
    ):
        if value:
            say(f"{name}: {value}")
    table = Table(
        Column("topic", no_wrap=True),
        "messages",
        "lost",
        "publisher restarts",
        "repeated",
        "unreadable",
    )
    for key, count in sorted(manifest.keys.items()):
        cells = (count.messages, count.lost, count.restarts, count.repeated, count.unreadable)
        table.add_row(key, *map(str, cells))
    show_table(table)
    for name, hashes in sorted(copied.files.items()) if copied else ():
        said = "equal" if hashes.equal else f"DIFFERENT, {hashes.home_sha256}"
        say(f"{name}: {hashes.here_sha256} at {copied.here}, at {copied.home} {said}")
    for one in notes.notes:
        when = "all" if one.at_s is None else f"{one.at_s:.2f} s"
        say(f"{when}  {one.author}: {one.text}")


@app.command()
def verify(session: SessionId, as_json: AsJson = False, config: Config = None) -> None:
    """Read a session whole: its hash, every message, every count. Exit code 1 when something is
    amiss.
    """
    from sessions.library.verify import verify as examine

    catalogue = catalogue_of(settings_of(config))
    try:
        catalogue.get(session)
        with progress_bar() as progress:
            found = examine(catalogue.root / session, progress)
    except (SessionError, OSError) as error:
        raise fail(error) from None
    if as_json:
        say(json.dumps(asdict(found) | {"ok": found.ok}, indent=2))
    else:
        said = {
            True: "matches",
            False: "DOES NOT MATCH",
            None: "is not there yet: the session is open",
        }[found.hash_ok]
        say(
            f"{session}: {found.state}; its hash {said}; {found.messages:,} messages readable;"
            f" {found.damage}"
        )
        if found.others:
            say(f"  {found.others}")
        say(f"  curves for drawing: {found.curves}")
        for key, text in found.differing.items():
            say(f"  {key}: {text}")
    if not found.ok:
        raise typer.Exit(EXIT_FAILED)


@app.command()
def delete(
    session: SessionId,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask.")] = False,
    as_json: AsJson = False,
    config: Config = None,
) -> None:
    """Delete a session for good."""
    from sessions.library.remove import remove

    catalogue = catalogue_of(settings_of(config))
    try:
        info = catalogue.get(session)
        if not yes and not typer.confirm(f"Delete {session}, {info.bytes / 1e6:.2f} MB, for good?"):
            raise fail("nothing was deleted")
        freed = remove(catalogue, session)
    except (SessionError, OSError) as error:
        raise fail(error) from None
    text = f"{session} deleted, {freed / 1e6:.2f} MB freed"
    say(json.dumps({"deleted": session, "freed_bytes": freed}) if as_json else text)


@app.command()
def retain(
    days: Annotated[
        float | None,
        typer.Option(
            min=0,
            max=36500,
            help="Sessions older than this go; 0: no limit; default [recorder] keep_days.",
        ),
    ] = None,
    max_gb: Annotated[
        float | None,
        typer.Option(
            min=0,
            max=1e9,
            help="Oldest go until all are below this; 0: no limit; default [recorder] keep_bytes.",
        ),
    ] = None,
    yes: Annotated[
        bool, typer.Option("--yes", help="Really delete; without it only the list is shown.")
    ] = False,
    as_json: AsJson = False,
    config: Config = None,
) -> None:
    """Apply rules of retention. Sessions with the tag `keep`, and those being recorded, always
    stay.

    The recorder applies those of the configuration by itself when it starts.
    """
    from sessions.library.remove import Retention, remove, too_many

    settings = settings_of(config)
    catalogue, kept = catalogue_of(settings), settings.recorder
    rule = Retention(
        kept.keep_days if days is None else days,
        kept.keep_bytes if max_gb is None else int(max_gb * 1e9),
    )
    try:
        going = too_many(catalogue, rule)
        if as_json:
            rows = [{"id": info.id, "bytes": info.bytes, "deleted": yes} for info in going]
            say(json.dumps(rows, indent=2))
        for info in going:
            if not as_json:
                say(f"{info.id}  {info.bytes / 1e6:.2f} MB")
            if yes:
                remove(catalogue, info.id)
    except (SessionError, OSError) as error:
        raise fail(error) from None
    say(
        f"{len(going)} sessions {'deleted' if yes else 'would go; --yes deletes them'}",
        file=sys.stderr,
    )


app.command("note")(note)
app.command("tag")(tag)
