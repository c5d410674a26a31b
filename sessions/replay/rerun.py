"""A recording through other estimators or other settings: a new session with the old inputs and the
new estimates.

The new session stands beside the old one, so that both can be reported, compared and replayed.
Estimates carry the receive time of the input they follow from.
"""

import shutil
from collections.abc import Iterable, Iterator
from pathlib import Path

from messages.contract.topics import ATTITUDE, AXES, ESTIMATOR, PIPELINE_INPUTS, POSE, parse
from sessions.export.table import Progress, Selection, messages, silent
from sessions.library.annotations import SessionNote, add_note
from sessions.recording.manifest import (
    SESSION_ID,
    Manifest,
    SessionError,
    check_id,
    next_number,
)
from sessions.recording.mcap_damage import Damage
from sessions.recording.mcap_log import say
from sessions.recording.settings import RecorderSettings
from sessions.recording.store import SessionStore, versions
from sessions.replay.reproduce import ESTIMATES, Pipeline, give_orders

COMPUTED = (*ESTIMATES, POSE, ESTIMATOR, ATTITUDE, AXES)  # what a pipeline publishes


def estimates_again(
    path: Path,
    pipeline: Pipeline,
    name: str = "",
    progress: Progress = silent,
    damage: Damage | None = None,
) -> Iterator[tuple[int, str, bytes]]:
    """(receive time ns, bus key, payload) of the inputs as recorded and of the estimates as
    computed now.

    `name` is added to the names of the new estimators, and the old estimates stay beside them;
    without it the new ones take their place. Header sequences count from 1 per key. What cannot be
    read is counted in `damage`. Raises SessionError for a file without any message, OSError.
    """
    damage = Damage() if damage is None else damage
    counts: dict[str, int] = {}
    size, seen = max(1, path.stat().st_size), 0
    give_orders(path, pipeline)
    for row, topic, message in messages(path, Selection(), damage):
        seen += len(row.payload) + 40
        if topic not in COMPUTED or name:
            yield row.log_ns, row.key, row.payload
        if message is None or topic not in PIPELINE_INPUTS:
            continue
        prefix = parse(row.key).prefix
        try:
            outputs = list(pipeline.on(topic, message))
        except ValueError:
            continue  # as live: such an input is counted there and ignored
        for out_topic, device, estimator, estimate in outputs:
            label = f"{estimator}-{name}"[:32] if name and estimator else estimator
            key = out_topic.key(prefix, device, label)
            counts[key] = counts.get(key, 0) + 1
            if "header" in estimate.DESCRIPTOR.fields_by_name:
                estimate.header.sequence = counts[key]
            yield row.log_ns, key, estimate.SerializeToString()
        if sum(counts.values()) % 1000 < 2:
            progress(min(0.99, seen / (4 * size)), "estimating")
    say(path, damage)
    if not seen:
        raise SessionError(f"{path}: {'; '.join(damage.said()) or 'it has no message'}")
    progress(1.0, "estimated")


def note_damage(folder: Path, damage: Damage) -> None:
    """Say in a session what was wrong with the recording that it is of. Raises as add_note."""
    for text in damage.said():
        add_note(folder, SessionNote(text=f"of a recording that is {text}"))


def write_session(
    root: Path,
    session: str,
    rows: Iterable[tuple[int, str, bytes]],
    note: str,
    configuration: dict[str, object],
) -> Path:
    """A closed session of these messages; its folder. An id that is taken gets -2, -3 ... at its
    end.

    Raises SessionError for an id that is none, for no messages, for a disk that refuses; OSError.
    """
    check_id(session)
    store: SessionStore | None = None
    try:
        for log_ns, key, payload in rows:
            if store is None:
                store = _open(root, session, log_ns, note, configuration)
            store.add(log_ns, key, payload)
            if store.messages % 2000 == 0:
                store.flush()
                if store.error:
                    raise SessionError(store.error)
        if store is None:
            raise SessionError(f"session {session}: no message to write")
        if not store.close():
            raise SessionError(store.error)
    except BaseException:
        if store is not None:  # half a session would look like one that a crash cut off
            store.close()
            shutil.rmtree(store.folder, ignore_errors=True)
        raise
    return store.folder


def _open(
    root: Path, session: str, start_ns: int, note: str, configuration: dict[str, object]
) -> SessionStore:
    settings = RecorderSettings(root=root, auto_start=False)
    for attempt in range(1, 100):
        name = session if attempt == 1 else f"{session}-{attempt}"
        manifest = Manifest(
            id=name,
            number=next_number(root),
            note=note,
            start_utc_ns=start_ns,
            end_utc_ns=start_ns,
            versions=versions(),
            configuration=configuration,
        )
        try:
            return SessionStore(root / name, settings, manifest)
        except FileExistsError:
            continue
    raise SessionError(f"session {session}: a hundred of that name are in {root}")


def rerun_id(path: Path, name: str) -> str:
    """Id of the new session, after the old one's: 20260131-120000-table ->
    20260131-120000-table-ukf.
    """
    base = path.parent.name if SESSION_ID.fullmatch(path.parent.name) else "00000000-000000"
    wanted = f"{base}-{name or 'rerun'}"
    return wanted if SESSION_ID.fullmatch(wanted) else f"{base[:15]}-{name or 'rerun'}"
