"""Many sessions through the estimators again: one row per session, device and estimator, as one
Parquet table.

The work of one session is a function of its folder and the settings, so it runs in this process, in
a pool of processes, or on an engine for distribution that exists already: a Dask scheduler, given
its address. The pipeline and the scorer come from the caller as picklable callables; this room
knows no service.
"""

import os
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from inertial.whole_file import whole

Row = dict[str, Any]
Work = Callable[[Path], list[Row]]  # an MCAP file -> its rows

COLUMNS = pa.schema(
    [
        ("session", pa.string()),
        ("device", pa.string()),
        ("boot", pa.int64()),
        ("estimator", pa.string()),
        ("start_utc_s", pa.float64()),
        ("seconds", pa.float64()),
        ("samples", pa.int64()),
        ("rate_rms_x_radps", pa.float64()),
        ("rate_rms_y_radps", pa.float64()),
        ("rate_rms_z_radps", pa.float64()),
        ("angle_error_rad", pa.float64()),
        ("scale_factor", pa.float64()),
        ("nis_per_dof", pa.float64()),
        ("accel_bias_x_mps2", pa.float64()),
        ("accel_bias_y_mps2", pa.float64()),
        ("accel_bias_z_mps2", pa.float64()),
        ("lost_samples", pa.int64()),
        ("seconds_of_work", pa.float64()),
        ("problem", pa.string()),
    ]
)


class SchedulerError(RuntimeError):
    """The distributed engine is not installed or does not answer; the text says what to do."""


def run_all(
    paths: Iterable[Path], work: Work, jobs: int = 0, scheduler: str = ""
) -> Iterator[list[Row]]:
    """Rows of every file, as they become ready. A file that fails gives one row with its `problem`.

    jobs: processes, 0 for one per core, 1 for this process. scheduler: address of a Dask scheduler,
    whose workers must see the same files under the same paths. Raises SchedulerError.
    """
    files = list(paths)
    if scheduler:
        yield from _distributed(files, work, scheduler)
    elif jobs == 1 or len(files) < 2:
        yield from (_guarded(work, path) for path in files)
    else:
        with ProcessPoolExecutor(jobs or os.cpu_count()) as pool:
            for future in as_completed([pool.submit(_guarded, work, path) for path in files]):
                yield future.result()


def _distributed(files: list[Path], work: Work, scheduler: str) -> Iterator[list[Row]]:
    try:
        from distributed import Client
        from distributed import as_completed as completed
    except ImportError:
        raise SchedulerError(
            "--scheduler needs Dask: pip install -r requirements/scale.txt"
        ) from None
    try:
        client = Client(scheduler, timeout=10)
    except (OSError, ValueError, TimeoutError) as error:
        raise SchedulerError(
            f"scheduler {scheduler}: {error}; start one with: dask scheduler"
        ) from None
    with client:
        for future in completed(
            [client.submit(_guarded, work, path, pure=False) for path in files]
        ):
            yield future.result()


def _guarded(work: Work, path: Path) -> list[Row]:
    """One bad session must not end the others."""
    begin = time.perf_counter()
    try:
        rows = work(path)
    except Exception as error:  # a row says what happened; the run goes on
        rows = [{"session": path.parent.name, "problem": f"{type(error).__name__}: {error}"}]
    took = time.perf_counter() - begin
    return [row | {"seconds_of_work": took} for row in rows]


def write_table(out: Path, rows: list[Row]) -> None:
    """One Parquet file, sorted, replaced in one step; raises OSError."""
    rows = sorted(
        rows,
        key=lambda row: (row.get("session", ""), row.get("device", ""), row.get("estimator", "")),
    )
    out.parent.mkdir(parents=True, exist_ok=True)
    with whole(out) as draft:
        pq.write_table(pa.Table.from_pylist(rows, schema=COLUMNS), draft, compression="zstd")
