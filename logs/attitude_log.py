"""Attitude trials on disk: the documented CSV, and the MATLAB files of the BROAD benchmark."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.io import loadmat
from scipy.spatial.transform import Rotation

from inertial.plausible import doubt_of_gravity, doubt_of_rate
from inertial.timing import Timing, TimingError, sample_timing
from logs.quantities import read_si, refuse, said_of, timing_of
from logs.sheet import LogError, open_sheet

Array = NDArray[np.float64]

SAMPLES = ("t_s", "fx_mps2", "fy_mps2", "fz_mps2", "wx_radps", "wy_radps", "wz_radps")
QUANTITIES = tuple(name.rpartition("_")[0] for name in SAMPLES)
TRUTH = ("true_qw", "true_qx", "true_qy", "true_qz")
SCORED = "scored"  # optional CSV column: 0 where a row is not to be scored
MAT = ("imu_acc", "imu_gyr", "opt_quat", "movement", "sampling_rate")


@dataclass(frozen=True)
class Trial:
    """One log: uniform samples and the reference attitude."""

    name: str
    t: Array  # (n,) s
    f_b: Array  # (n, 3) m/s^2
    omega_b: Array  # (n, 3) rad/s
    up_b: Array  # (n, 3) unit vector up by the reference; nan where there is none
    scored: NDArray[np.bool_]  # (n,)
    timing: Timing
    notes: tuple[str, ...] = ()  # for people: what is doubtful, missing or was left out

    @property
    def period(self) -> float:
        """s between samples."""
        return self.timing.period_s


def read_trials(log: Path, units_as_named: bool = False) -> list[Trial]:
    """A .csv or .mat, or every one of a folder. Raises LogError with the file and what it lacks."""
    if log.is_dir():
        files = sorted(f for f in log.iterdir() if f.suffix in (".csv", ".mat"))
        if not files:
            raise LogError(f"{log}: no .csv or .mat files in this folder")
        return [_read(file, units_as_named) for file in files]
    return [_read(log, units_as_named)]


def _read(file: Path, units_as_named: bool) -> Trial:
    if not file.is_file():
        raise LogError(f"{file}: no such file")
    if file.suffix == ".mat":
        return _read_mat(file)
    if file.suffix == ".csv":
        return _read_csv(file, units_as_named)
    raise LogError(f"{file}: want .csv (columns {', '.join(SAMPLES + TRUTH)}) or BROAD's .mat")


def _read_mat(file: Path) -> Trial:
    try:
        content = loadmat(file)
    except OSError:
        raise
    except Exception as error:  # a damaged file makes it raise almost anything
        raise LogError(f"{file}: not a MATLAB 5 file: {error}") from None
    missing = [name for name in MAT if name not in content]
    if missing:
        raise LogError(f"{file}: no variable {missing[0]!r}; BROAD's files have {', '.join(MAT)}")
    q = np.asarray(content["opt_quat"], dtype=np.float64)
    t = np.arange(len(q)) / float(content["sampling_rate"].ravel()[0])
    moving = content["movement"].ravel() > 0
    f, w = content["imu_acc"], content["imu_gyr"]
    return _trial(file, _even(file, t), t, f, w, q, moving, [])


def _even(file: Path, t: Array) -> Timing:
    try:
        return sample_timing(t)
    except TimingError as error:
        raise LogError(f"{file}: {error}") from None


def _read_csv(file: Path, units_as_named: bool) -> Trial:
    sheet = open_sheet(file)
    table = read_si(sheet, [*QUANTITIES, *TRUTH], [SCORED], TRUTH)
    timing = timing_of(sheet, table)
    f, w = (np.column_stack([table[name] for name in QUANTITIES[a:b]]) for a, b in ((1, 4), (4, 7)))
    q = np.column_stack([table[name] for name in TRUTH])
    notes = refuse(file, [doubt_of_gravity(f), doubt_of_rate(table["t"], f, w)], units_as_named)
    notes += said_of(file, timing, table.cut_off)
    scored = table[SCORED] > 0 if SCORED in table else np.ones(len(q), dtype=bool)
    return _trial(file, timing, table["t"], f, w, q, scored, notes)


def _trial(
    file: Path,
    timing: Timing,
    t: Array,
    f: Array,
    w: Array,
    q: Array,
    scored: NDArray[np.bool_],
    notes: list[str],
) -> Trial:
    f, w = (np.ascontiguousarray(a, dtype=np.float64) for a in (f, w))
    if f.shape != (len(t), 3) or w.shape != f.shape or q.shape != (len(t), 4):
        raise LogError(
            f"{file}: {len(q)} references, specific force {f.shape}, rate {w.shape}; want as many"
            " rows of each"
        )
    if not (np.isfinite(f).all() and np.isfinite(w).all()):
        row = int(np.flatnonzero(~np.isfinite(np.hstack([f, w])).all(axis=1))[0])
        raise LogError(f"{file}: row {row + 1}: a sample that is not a number")
    known = np.isfinite(q).all(axis=1) & (np.linalg.norm(np.nan_to_num(q), axis=1) > 0.5)
    if not (known & scored).any():
        raise LogError(f"{file}: no row has a reference attitude to score against")
    up = np.full((len(q), 3), np.nan)
    up[known] = _up(Rotation.from_quat(q[known][:, [1, 2, 3, 0]]), f[known])
    return Trial(
        file.stem, np.asarray(t, dtype=np.float64), f, w, up, known & scored, timing, tuple(notes)
    )


def _up(attitude: Rotation, f_b: Array) -> Array:
    """Up in b. A reference to north-east-down has its z down, one to east-north-up has it up: the
    mean specific force, which points up whatever the frame is called, decides.
    """
    sign = np.sign(attitude.apply(f_b).mean(axis=0)[2])
    return attitude.inv().apply([0.0, 0.0, sign if sign else 1.0])
