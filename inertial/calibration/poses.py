"""Standstills of a log as poses, and which pose a person should take next."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inertial.calibration.fit import CalibrationError, Fit, Prior, fit
from inertial.calibration.model import Poses
from inertial.constants import GRAVITY
from inertial.layouts.layout import Layout

Array = NDArray[np.float64]

FEWEST, MOST = 6, 24  # poses of a plan
SAME = np.cos(np.deg2rad(25.0))  # poses nearer than that count as one direction


@dataclass(frozen=True)
class Finder:
    """How standstills are found."""

    shortest_s: float = 1.5  # s
    guard_s: float = 0.25  # s cut from both ends, where the hand is
    window_s: float = 0.4  # s
    quiet: float = (
        1.6  # mean square scatter of a window over that of the quietest tenth of all windows
    )
    drift: float = 4.0  # sigma by which the two halves of a standstill may differ, besides `slack`
    slack: float = 0.03  # m/s^2


@dataclass(frozen=True)
class Standstill:
    """Samples [first, last) of a log."""

    first: int
    last: int


def find(
    f_axis: Array, period_s: float, finder: Finder = Finder()
) -> tuple[list[Standstill], Array]:
    """Standstills of axis readings (n, N), m/s^2, and the noise (N,) of one sample while still.

    Raises CalibrationError for a log in which nothing stands still.
    """
    n = max(4, round(finder.window_s / period_s))
    if len(f_axis) < 2 * n:
        raise CalibrationError(
            f"{len(f_axis)} samples, want at least {2 * n}: poses of {finder.shortest_s} s and more"
        )
    sums, squares = np.cumsum(f_axis, axis=0), np.cumsum(f_axis**2, axis=0)
    mean = (sums[n:] - sums[:-n]) / n
    variance = np.maximum((squares[n:] - squares[:-n]) / n - mean**2, 0.0) * n / (n - 1)
    scatter = variance.mean(axis=1)
    quiet_level = float(np.quantile(scatter, 0.1))
    # A log that never rests has no quiet tenth: noise of the parts in question is far below 0.3
    # m/s^2.
    quiet = scatter <= finder.quiet * max(min(quiet_level, 0.09), 1e-8)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], quiet.astype(np.int8), [0]]))).reshape(
        -1, 2
    )
    guard = round(finder.guard_s / period_s)
    found = []
    for first, last in edges:
        one = Standstill(int(first) + 1 + guard, int(last) + n - guard)
        if (one.last - one.first) * period_s >= finder.shortest_s and _steady(f_axis, one, finder):
            found.append(one)
    if not found:
        raise CalibrationError(
            f"no standstill of {finder.shortest_s:g} s in {len(f_axis) * period_s:.0f} s of log:"
            " set the body down and let go of it in each pose"
        )
    spread = np.array([f_axis[one.first : one.last].var(axis=0, ddof=1) for one in found])
    return found, np.sqrt(np.median(spread, axis=0))


def _steady(f_axis: Array, one: Standstill, finder: Finder) -> bool:
    middle = (one.first + one.last) // 2
    a, b = f_axis[one.first : middle], f_axis[middle : one.last]
    limit = finder.slack + finder.drift * a.std(axis=0) * np.sqrt(2.0 / len(a))
    return bool((np.abs(a.mean(axis=0) - b.mean(axis=0)) <= limit).all())


def collect(f_axis: Array, found: list[Standstill]) -> Poses:
    """Means of the standstills."""
    parts = [f_axis[one.first : one.last] for one in found]
    return Poses(
        mean=np.array([part.mean(axis=0) for part in parts]),
        samples=np.array([len(part) for part in parts]),
        scatter=np.array([float(np.sqrt(part.var(axis=0, ddof=1).mean())) for part in parts]),
    )


def joined(parts: list[Poses]) -> Poses | None:
    """Poses of several logs together; None without any."""
    if not parts:
        return None
    return Poses(
        np.vstack([p.mean for p in parts]),
        np.concatenate([p.samples for p in parts]),
        np.concatenate([p.scatter for p in parts]),
    )


def candidates() -> Array:
    """The 26 directions of a tumble, (26, 3), unit vectors up in b: faces, three edges, corners,
    the other edges.

    Six faces give biases and scales; a shear of all axes together reads like poses that lean, until
    three edges are in.
    """
    grid = np.array(np.meshgrid([1, 0, -1], [1, 0, -1], [1, 0, -1], indexing="ij")).reshape(3, -1).T
    grid = grid[np.any(grid != 0, axis=1)].astype(np.float64)
    kind = np.abs(grid).sum(axis=1)
    faces = grid[kind == 1]
    faces = faces[np.lexsort((faces.sum(axis=1) < 0, -np.abs(faces[:, 0]), -np.abs(faces[:, 2])))]
    edges = grid[kind == 2]
    first = (edges >= 0.0).all(axis=1)
    ordered = np.vstack([faces, edges[first], grid[kind == 3], edges[~first]])
    return ordered / np.linalg.norm(ordered, axis=1)[:, None]


def plan(poses: int) -> Array:
    """Directions up of so many poses (6 to 24), (poses, 3); raises CalibrationError outside."""
    if not FEWEST <= poses <= MOST:
        raise CalibrationError(
            f"{poses} poses, want {FEWEST} to {MOST}: 6 see biases and scales, 9 and more also"
            " directions"
        )
    return candidates()[:poses]


def describe(up_b: Array) -> str:
    """What a person does: "+x up", "edge between +x and -z up"."""
    names = [
        f"{'+' if value > 0 else '-'}{'xyz'[k]}" for k, value in enumerate(up_b) if abs(value) > 0.3
    ]
    if len(names) == 1:
        return f"{names[0]} face up"
    return f"{'edge' if len(names) == 2 else 'corner'} between {' and '.join(names)} up"


def next_pose(taken: Array) -> Array | None:
    """The first of the 24 planned directions that is not yet among taken (M, 3); None when all
    are.
    """
    for up_b in candidates()[:MOST]:
        if not len(taken) or float((np.asarray(taken) @ up_b).max()) < SAME:
            return up_b
    return None


def predicted(
    layout: Layout, up_b: Array, samples: int, noise: float, prior: Prior = Prior()
) -> Fit:
    """The fit that such poses would give with perfect axes: its sigmas are what a plan promises."""
    mean = GRAVITY * up_b @ layout.theta_b.T
    poses = Poses(mean, np.full(len(up_b), samples), np.full(len(up_b), noise))
    return fit(layout, poses, noise=noise, prior=prior)
