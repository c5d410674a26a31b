"""`gyrofree sessions note` and `tag`: what people say of a session."""

import json
import time
from typing import Annotated

import typer

from gyrofree.commands.options import (
    AsJson,
    Config,
    SessionId,
    catalogue_of,
    say,
    settings_of,
)
from gyrofree.running.process import EXIT_CONFIG, fail
from messages.text import reason
from sessions.library.annotations import SessionNote, add_note, change_annotations
from sessions.recording.manifest import check_id


def note(
    session: SessionId,
    text: Annotated[str, typer.Argument(help="The remark.")],
    at: Annotated[
        float | None,
        typer.Option(
            min=-1e9, max=1e9, help="s from the session's start; default: about all of it."
        ),
    ] = None,
    author: Annotated[str, typer.Option(help="Who says so.")] = "",
    as_json: AsJson = False,
    config: Config = None,
) -> None:
    """Add a remark to a session; the recording itself is never changed."""
    try:
        folder = catalogue_of(settings_of(config)).root / check_id(session)
        notes = add_note(
            folder, SessionNote(text=text, author=author, at_s=at, written_utc_ns=time.time_ns())
        ).notes
    except (ValueError, OSError) as error:
        raise fail(error) from None
    if as_json:
        say(json.dumps([one.model_dump(mode="json") for one in notes], indent=2))
    else:
        say(f"{session}: {len(notes)} note{'' if len(notes) == 1 else 's'}")


def tag(
    session: SessionId,
    add: Annotated[list[str] | None, typer.Option(help="Tag to add; may be given again.")] = None,
    remove: Annotated[list[str] | None, typer.Option(help="Tag to take away.")] = None,
    title: Annotated[str | None, typer.Option(help="New title.")] = None,
    outcome: Annotated[str | None, typer.Option(help="pass, fail, incomplete, or empty.")] = None,
    as_json: AsJson = False,
    config: Config = None,
) -> None:
    """Title, tags and outcome of a session."""

    def change(was):
        tags = (set(was.tags) | set(add or ())) - set(remove or ())
        new = {
            "tags": sorted(tags),
            "title": was.title if title is None else title,
            "outcome": was.outcome if outcome is None else outcome,
        }
        return type(was).model_validate(was.model_dump() | new)

    try:
        folder = catalogue_of(settings_of(config)).root / check_id(session)
        changed = change_annotations(folder, change)
    except (ValueError, OSError) as error:
        raise fail(reason(error).splitlines()[0], EXIT_CONFIG) from None
    if as_json:
        say(json.dumps(changed.model_dump(mode="json"), indent=2))
        return
    outcome = f"; {changed.outcome}" if changed.outcome else ""
    say(
        f"{session}: {changed.title or 'no title'};"
        f" tags {', '.join(changed.tags) or 'none'}{outcome}"
    )
