"""The alarms of a session, as a table of its report: what was wrong while it was measured."""

from collections.abc import Mapping
from pathlib import Path

from messages.contract.topics import ALARM
from sessions.library.alarmed import Episode, episodes
from sessions.recording.manifest import Manifest
from sessions.report.data import Run
from sessions.report.grids import Grid

MOST = 200  # rows


def in_files(files: Mapping[Path, Manifest | None]) -> list[Episode]:
    """Of a recording's files; those that are known to have none are not read. Raises OSError."""
    return episodes(
        path
        for path, manifest in files.items()
        if manifest is None or any(key.endswith(f"/{ALARM.name}") for key in manifest.keys)
    )


def of_run(found: list[Episode], run: Run) -> list[Episode]:
    """Those of its device and of the bench that were there within the run."""
    begin, end = run.start_utc_s, run.start_utc_s + run.seconds
    return [
        one
        for one in found
        if one.device == run.device
        and one.begin_ns * 1e-9 <= end
        and (not one.end_ns or one.end_ns * 1e-9 >= begin)
    ]


def alarms(found: list[Episode], run: Run) -> Grid | None:
    """Times in s from the first sample of the run; None where there were none."""
    if not found:
        return None
    rows = [
        (
            one.title,
            one.level,
            f"{one.begin_ns * 1e-9 - run.start_utc_s:.1f}",
            f"{one.end_ns * 1e-9 - run.start_utc_s:.1f}" if one.end_ns else "not ended",
            _noted(one),
        )
        for one in found[:MOST]
    ]
    remark = "Times in s from the first sample; below zero: it was there before."
    if len(found) > MOST:
        remark += f" {len(found) - MOST} more are in the recording."
    return Grid("Alarms", ("what", "level", "from, s", "to, s", "acknowledged"), rows, remark)


def _noted(one: Episode) -> str:
    if not one.acknowledged_by:
        return "no"
    return f"{one.acknowledged_by}: {one.note}" if one.note else one.acknowledged_by


def as_json(found: list[Episode], run: Run) -> list[dict[str, object]]:
    """The same for programs."""
    return [
        {
            "id": one.id,
            "title": one.title,
            "level": one.level,
            "from_s": one.begin_ns * 1e-9 - run.start_utc_s,
            "to_s": one.end_ns * 1e-9 - run.start_utc_s if one.end_ns else None,
            "acknowledged_by": one.acknowledged_by or None,
            "note": one.note,
            "first_out": one.first_out,
            "bench": one.of_bench,
        }
        for one in found
    ]
