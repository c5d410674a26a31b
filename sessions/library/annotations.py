"""What people add to a session: title, tags, outcome, notes. Kept beside the recording, which is
never changed.

annotations.json stands in the session's folder; it is replaced in one step, under a lock, so that
two people cannot lose each other's words. Notes typed while recording are in the recording too
(topic note).
"""

import fcntl
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from messages import text
from sessions.recording.manifest import SESSION_NAME, Nanoseconds, SessionError

FILE = "annotations.json"
TAG = re.compile(r"[a-z0-9][a-z0-9_.-]{0,31}")
Outcome = Literal["", "pass", "fail", "incomplete"]


class SessionNote(BaseModel):
    """A remark about a moment, or about the whole session."""

    model_config = ConfigDict(extra="ignore")

    text: str = Field(min_length=1, max_length=2000)
    author: str = ""
    written_utc_ns: Nanoseconds = 0  # ns since 1970
    # s from the session's start; None: about all of it
    at_s: float | None = Field(default=None, allow_inf_nan=False)


class Annotations(BaseModel):
    """The content of annotations.json."""

    model_config = ConfigDict(extra="ignore")

    title: str = Field(default="", max_length=200)
    tags: list[str] = []
    outcome: Outcome = ""
    notes: list[SessionNote] = []


def read_annotations(folder: Path) -> Annotations:
    """Of a session's folder; empty where there is none. Raises SessionError for a damaged file."""
    path = folder / FILE
    try:
        return Annotations.model_validate_json(path.read_bytes())
    except FileNotFoundError:
        return Annotations()
    except OSError as error:
        raise SessionError(f"{path}: {error.strerror}") from error
    except ValidationError as error:
        raise SessionError(
            f"{path}: {error.errors()[0]['msg']}; move it away, the recording is not touched"
        ) from error


def change_annotations(folder: Path, change: Callable[[Annotations], Annotations]) -> Annotations:
    """Read, change, replace, under a lock; raises SessionError (also for what is no tag),
    OSError.
    """
    if not folder.is_dir():
        raise SessionError(f"{folder}: no such session")
    with (folder / (FILE + ".lock")).open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        changed = change(read_annotations(folder))
        _check_words(changed)
        for tag in changed.tags:
            if not TAG.fullmatch(tag):
                raise SessionError(
                    f"tag {tag[:40]!r}: want a-z, 0-9, dot, dash, underscore, at most 32 characters"
                )
        one_form = {"tags": sorted(set(changed.tags)), "title": text.composed(changed.title)}
        changed = changed.model_copy(update=one_form)
        new = folder / (FILE + ".new")
        with new.open("w", encoding="utf-8") as stream:
            stream.write(changed.model_dump_json(indent=1) + "\n")
            stream.flush()
            os.fsync(stream.fileno())
        os.replace(new, folder / FILE)
    return changed


def give_title(folder: Path, name: str) -> None:
    """The name that a person gave a session, where its id could not take all of it. Raises as
    change_annotations.
    """
    if name and not SESSION_NAME.fullmatch(name):
        change_annotations(folder, lambda was: was.model_copy(update={"title": name}))


def _check_words(said: Annotations) -> None:
    """Raises SessionError for words that act on what they are shown in: see messages.text."""
    words = [("title", said.title, False)]
    for one in said.notes[-1:]:  # those before it were looked at when they were written
        words += [("note", one.text, True), ("author", one.author, False)]
    for what, word, lines in words:
        if fault := text.check(word, lines):
            raise SessionError(f"{what}: {fault}")


def add_note(folder: Path, note: SessionNote) -> Annotations:
    """One remark more."""
    return change_annotations(
        folder, lambda was: was.model_copy(update={"notes": [*was.notes, note]})
    )
