"""Fill the compile cache: `python -m estimator.warm`. The first sample of a live stream must not
wait for a compiler.

numba notices a change of the file a compiled function is in, not of a file that one calls into. So
a cache older than any source of this folder is thrown away first.
"""

import logging
import time
from pathlib import Path

import numpy as np

import inertial
from inertial.attitude.filters import ATTITUDES
from inertial.navigation.alignment_motion import MotionSettings, MotionWindow
from inertial.navigation.batch import run_filters
from inertial.navigation.fix import RTK_FIXED, Fix
from inertial.navigation.navigation import NAVIGATORS, Mode
from inertial.navigation.smoother import smooth_drive

log = logging.getLogger(__name__)

HERE = Path(inertial.__file__).resolve().parent


def drop_stale(folder: Path = HERE) -> int:
    """Remove compiled functions that are older than a source of the folder; returns how many files
    went.
    """
    newest = max(
        s.stat().st_mtime for s in folder.rglob("*.py") if _compiles(s.read_text(encoding="utf-8"))
    )
    everything = list(folder.rglob("__pycache__/*.nb[ic]"))
    if all(f.stat().st_mtime >= newest for f in everything):
        return 0
    for file in everything:
        file.unlink(missing_ok=True)
    return len(everything)


def _compiles(source: str) -> bool:
    return any(word in source for word in ("@njit", "@intrinsic"))


def warm() -> None:
    """Compile, or load from the cache, every function of the live path by running it on made-up
    motion.
    """
    logging.disable(logging.INFO)  # the made-up motion is no news
    try:
        _warm_navigators()
        _warm_attitudes()
        _warm_alignment()
    finally:
        logging.disable(logging.NOTSET)


def _warm_alignment() -> None:
    window = MotionWindow(MotionSettings())
    for k in range(700):
        window.imu(0.01 * k, np.array([0.0, 0.0, -9.8]), np.zeros(3))
        if k % 100 == 50:
            window.fix(0.01 * k, np.array([10.0, 0.0, 0.0]), np.full(3, 0.1))
    if window.solve() is None:
        raise RuntimeError(
            "the made-up start in motion was not solved: warm.py does not fit alignment_motion.py"
        )


def _warm_attitudes() -> None:
    for make in ATTITUDES.values():
        attitude = make(0.01)
        for _ in range(2):
            attitude.step(np.array([0.0, 0.0, -9.8]), np.zeros(3))


def _warm_navigators() -> None:
    for name in (
        "kf",
        "huber-nhc",
        "fpe-fuzzy",
        "mhe-robust",
    ):  # the compiled code is the same for all others
        navigator = NAVIGATORS[name]()
        f, w = np.array([0.0, 0.0, -9.8]), np.zeros(3)
        for k in range(1200):
            t = 0.01 * k
            if k in (1110, 1150, 1190):
                navigator.fix(_fix(t - 0.05))
            navigator.imu(t, f, w)
            navigator.solution()
        if navigator.mode != Mode.NAVIGATING:
            raise RuntimeError(
                "the made-up drive did not reach navigation: warm.py does not fit alignment.py any"
                " more"
            )


def _warm_offline() -> None:
    """The runs over whole drives: not needed live, so only this module's command makes them
    ready.
    """
    n = 1200
    imu = np.column_stack(
        [0.01 * np.arange(n), np.tile([0.0, 0.0, -9.8], (n, 1)), np.zeros((n, 3))]
    )
    fixes = [_fix(t) for t in (11.05, 11.45, 11.85)]
    run = run_filters(imu, fixes, ["kf"])["kf"]
    if not len(run.t) or smooth_drive(imu, fixes) is None:
        raise RuntimeError(
            "the made-up drive did not reach navigation: warm.py does not fit alignment.py any more"
        )


def _fix(t: float) -> Fix:
    sigma = np.full(3, 0.02)
    return Fix(
        t, t, 0.7, 0.1, 100.0 + t, RTK_FIXED, sigma, np.array([5.0, 0.0, 0.0]), np.full(3, 0.05)
    )


def main() -> None:
    """Entry point."""
    logging.basicConfig(level=logging.WARNING, format="%(levelname)s %(name)s: %(message)s")
    dropped = drop_stale()
    started = time.perf_counter()
    warm()
    _warm_offline()
    print(
        f"compile cache ready in {time.perf_counter() - started:.1f} s ({dropped} stale files"
        " dropped)"
    )


if __name__ == "__main__":
    main()
