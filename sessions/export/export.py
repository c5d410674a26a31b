"""A recording in other people's formats. SI units stand in the column names; docs/recordings.md
describes the files.

csv      one file per bus key            parquet  one file per bus key, zstd
mat      one file, a struct per key      mcap     the same recording, cut by time or topic; rate
kml/gpx  tracks of fixes and of every             estimates one by one, all else as on the bus
         navigation filter

Big recordings stream: only mat holds all in memory.
"""

import csv
import re
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from google.protobuf.message import DecodeError
from numpy.typing import NDArray
from scipy.io import savemat

from inertial.whole_file import whole_files
from messages.contract import gyrofree_pb2 as pb
from messages.contract import rates
from messages.contract.topics import GNSS, LOG, NAV, RATE, Topic, parse
from messages.text import cell
from sessions.export.columns import Column
from sessions.export.table import (
    Block,
    Progress,
    Selection,
    Survey,
    Table,
    blocks,
    silent,
    survey,
    tables,
)
from sessions.export.track import write_gpx, write_kml
from sessions.recording.mcap_append import McapLog
from sessions.recording.mcap_log import Recorded
from sessions.recording.samples import decode
from sessions.recording.timeline import straight

RATE_ESTIMATE: Topic = replace(RATE, type=pb.RateEstimate)  # one sample of a batch
ROW_GROUP = 20_000  # rows of Parquet written at once


class ExportError(ValueError):
    """Nothing to export, or a place that cannot be written; the text says which."""


def file_stem(key: str) -> str:
    """`gyrofree/cube/rate/products-ekf` -> `cube.rate.products-ekf`: the file name of a key."""
    return ".".join(key.split("/")[1:])


def to_csv(
    path: Path, out: Path, selection: Selection = Selection(), progress: Progress = silent
) -> list[Path]:
    """One CSV per key into the folder `out`; empty cells where a number is not known.

    Raises ExportError for a selection without messages, OSError for what cannot be read or written.
    """
    found = _surveyed(path, selection, progress)
    files: dict[str, Path] = {}
    with ExitStack() as stack:
        writers = {}
        for key, columns in found.columns.items():
            files[key] = out / f"{file_stem(key)}.csv"
            writers[key] = csv.writer(
                stack.enter_context(files[key].open("w", newline="", encoding="utf-8"))
            )
            writers[key].writerow([column.name for column in columns.names])
        for key, block in blocks(path, found, selection, _second_half(progress)):
            columns = found.columns[key].names
            cells = [_cells(column, block[column.name]) for column in columns]
            writers[key].writerows(zip(*cells, strict=True))
    return list(files.values())


def _cells(column: Column, values: NDArray[Any]) -> list[float | int | str]:
    """A column for CSV: nothing for NaN, whole numbers without a point, no text that a spreadsheet
    executes.
    """
    cells: list[float | int | str] = values.tolist()
    if column.text:
        return [cell(text) for text in cells]
    if values.dtype.kind != "f":
        return cells
    return ["" if v != v else int(v) if column.whole else v for v in cells]


def to_parquet(
    path: Path, out: Path, selection: Selection = Selection(), progress: Progress = silent
) -> list[Path]:
    """One Parquet file per key into the folder `out`. Raises as to_csv."""
    found = _surveyed(path, selection, progress)
    files: dict[str, Path] = {}
    with ExitStack() as stack:
        groups: dict[str, _RowGroups] = {}
        for key, columns in found.columns.items():
            files[key] = out / f"{file_stem(key)}.parquet"
            groups[key] = stack.enter_context(
                _RowGroups(files[key], columns.names, {"key": key, "source": path.name})
            )
        for key, block in blocks(path, found, selection, _second_half(progress)):
            groups[key].add(block)
    return list(files.values())


class _RowGroups:
    """A Parquet file written some rows at a time."""

    def __init__(self, path: Path, columns: list[Column], metadata: dict[str, str]) -> None:
        types = [(column.name, pa.string() if column.text else pa.float64()) for column in columns]
        self._schema = pa.schema(types, metadata=metadata)
        self._writer = pq.ParquetWriter(path, self._schema, compression="zstd")
        self._blocks: list[pa.RecordBatch] = []
        self._rows = 0

    def __enter__(self) -> "_RowGroups":
        return self

    def __exit__(self, *_: object) -> None:
        self._flush()
        self._writer.close()

    def add(self, block: Block) -> None:
        """Some rows more."""
        arrays = [
            pa.array(
                block[field.name].astype(np.float64 if field.type == pa.float64() else object),
                type=field.type,
            )
            for field in self._schema
        ]
        self._blocks.append(pa.RecordBatch.from_arrays(arrays, schema=self._schema))
        self._rows += len(self._blocks[-1])
        if self._rows >= ROW_GROUP:
            self._flush()

    def _flush(self) -> None:
        if self._blocks:
            self._writer.write_table(pa.Table.from_batches(self._blocks), ROW_GROUP)
        self._blocks, self._rows = [], 0


def to_mat(
    path: Path, out: Path, selection: Selection = Selection(), progress: Progress = silent
) -> list[Path]:
    """One MATLAB 5 file: struct per key (dots and dashes of the name as underscores), field per
    column.
    """
    found = tables(path, selection, progress)
    if not found:
        raise ExportError(f"{path}: no message of the wanted topics and time")
    content: dict[str, Any] = {}
    for key, table in found.items():
        struct = {column.name[:31]: table.data[column.name] for column in table.columns}
        content[re.sub(r"[^a-z0-9]", "_", file_stem(key))[:31]] = struct
    target = (
        out / f"{path.parent.name if path.stem in ('recording', 'recovered') else path.stem}.mat"
    )
    savemat(target, content, do_compression=True, oned_as="column")
    return [target]


def to_mcap(
    path: Path, out: Path, selection: Selection = Selection(), progress: Progress = silent
) -> list[Path]:
    """The recording between two times as one MCAP file `cut.mcap`; raises ExportError when nothing
    is in between.
    """
    target = out / "cut.mcap"
    count = 0
    start = None
    with target.open("wb") as stream:
        log = McapLog(stream.fileno(), 128 * 1024)
        for row in straight(path):
            start = row.log_ns if start is None else start
            topic = parse(row.key).topic
            if (
                selection.takes(topic)
                and selection.start_s <= (row.log_ns - start) / 1e9 <= selection.end_s
            ):
                for kind, log_ns, publish_ns, payload in _single(topic, row):
                    count += 1
                    channel = log.open_channel(row.key, kind)
                    log.add(channel, log_ns, publish_ns, payload, count)
                    if count % 5000 == 0:
                        log.push()
                        progress(0.5, "cutting")
        log.finish()
        log.push()
    if not count:
        target.unlink()
        raise ExportError(f"{path}: no message of the wanted topics and time")
    progress(1.0, "cut")
    return [target]


def _single(topic: Topic, row: Recorded) -> Iterator[tuple[Topic, int, int, bytes]]:
    """Type, receive and publish time and bytes of a message in the copy: rate estimates one by one,
    each at its own time before the last of its batch, because other viewers draw numbers that stand
    alone.
    """
    if topic is not RATE:
        yield topic, row.log_ns, row.publish_ns, row.payload
        return
    try:
        batch = decode(topic, row.payload)
    except DecodeError:
        return
    last_ns = batch.header.utc_ns + round((rates.count(batch) - 1) * batch.period_s * 1e9)
    for one in rates.rows(batch):
        own_ns = one.header.utc_ns
        log_ns = row.log_ns - (last_ns - own_ns)
        yield RATE_ESTIMATE, log_ns, own_ns or log_ns, one.SerializeToString()


def to_kml(
    path: Path, out: Path, selection: Selection = Selection(), progress: Progress = silent
) -> list[Path]:
    """Tracks for Google Earth and the like."""
    return [write_kml(out / "track.kml", _tracks(path, selection, progress))]


def to_gpx(
    path: Path, out: Path, selection: Selection = Selection(), progress: Progress = silent
) -> list[Path]:
    """Tracks with times, for maps and GNSS tools."""
    return [write_gpx(out / "track.gpx", _tracks(path, selection, progress))]


Writer = Callable[[Path, Path, Selection, Progress], list[Path]]
FORMATS: dict[str, Writer] = {
    "csv": to_csv,
    "parquet": to_parquet,
    "mat": to_mat,
    "kml": to_kml,
    "gpx": to_gpx,
    "mcap": to_mcap,
}


def export(
    path: Path,
    form: str,
    out: Path,
    selection: Selection = Selection(),
    progress: Progress = silent,
):
    """Write a recording into the folder `out`, made when absent; the files, which come together.

    Raises ExportError for an unknown format and for a selection without data, OSError.
    """
    if form not in FORMATS:
        raise ExportError(f"format {form!r}: want one of {', '.join(FORMATS)}")
    with whole_files(out) as drafts:
        files = FORMATS[form](path, drafts, selection, progress)
    return [out / file.name for file in files]


def _surveyed(path: Path, selection: Selection, progress: Progress) -> Survey:
    found = survey(path, selection, lambda done, what: progress(done * 0.3, what))
    if not found.columns:
        raise ExportError(f"{path}: no message of the wanted topics and time")
    return found


def _second_half(progress: Progress) -> Progress:
    return lambda done, what: progress(0.3 + done * 0.7, what)


def _tracks(path: Path, selection: Selection, progress: Progress) -> dict[str, np.ndarray]:
    """Name -> (n, 4) utc s, latitude deg, longitude deg, height above mean sea level m or NaN."""
    wanted = (selection.topics or frozenset({GNSS.name, NAV.name})) - {LOG.name}
    found = tables(
        path, Selection(wanted | {GNSS.name}, selection.start_s, selection.end_s), progress
    )
    geoids = {
        parse(key).device: _geoid(table) for key, table in found.items() if parse(key).topic is GNSS
    }
    result = {}
    for key, table in found.items():
        where = parse(key)
        if "latitude_deg" not in table.data or where.topic.name not in wanted:
            continue
        track = table.vector("utc_s", "latitude_deg", "longitude_deg")
        placed = np.isfinite(track).all(axis=1) & np.any(track[:, 1:] != 0.0, axis=1)
        if placed.any():
            heights = _above_sea(table, geoids.get(where.device, np.zeros((0, 2))))
            result[file_stem(key)] = np.column_stack([track, heights])[placed]
    if not result:
        raise ExportError(
            f"{path}: it has neither fixes nor a navigation solution, so there is no track to draw"
        )
    return result


def _geoid(fixes: Table) -> np.ndarray:
    """(n, 2) utc s, height of the geoid above the ellipsoid m, where a receiver gave both."""
    undulation = fixes.data["height_m"] - fixes.data["height_msl_m"]
    sea = fixes.data["height_reference"] == pb.HEIGHT_REFERENCE_SEA_LEVEL
    known = np.isfinite(undulation) & ~sea
    return np.column_stack([fixes.data["utc_s"], undulation])[known]


def _above_sea(table: Table, geoid: np.ndarray) -> np.ndarray:
    """(n,) heights above mean sea level, m: the receiver's own, or the ellipsoid's less the geoid
    as the same device's fixes had it; NaN where neither is known.
    """
    data = table.data
    if "height_msl_m" in data:
        return data["height_msl_m"]
    if "height_m" not in data or "height_reference" not in data:
        return np.full(len(data["utc_s"]), np.nan)
    own = data["height_reference"] == pb.HEIGHT_REFERENCE_SEA_LEVEL
    undulation = (
        np.interp(data["utc_s"], geoid[:, 0], geoid[:, 1])
        if len(geoid)
        else np.full(len(data["utc_s"]), np.nan)
    )
    return np.where(own, data["height_m"], data["height_m"] - undulation)
