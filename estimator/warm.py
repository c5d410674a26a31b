"""Fill the compile cache: `python -m estimator.warm`. The first sample of a live stream must not
wait for a compiler.

numba notices a change of the file a compiled function is in, not of a file that one calls into. So
a cache older than any source of this folder is thrown away first.
"""

import itertools
import logging
import time
from pathlib import Path

import numpy as np

import inertial
from inertial.attitude.filters import ATTITUDES
from inertial.navigation.alignment_motion import MotionSettings, MotionWindow
from inertial.rate.estimators import ESTIMATORS
from inertial.rate.health import HealthMonitor
from inertial.simulation.faults import AxisFault, Faults
from inertial.simulation.table import TableTest

log = logging.getLogger(__name__)

RATE_SAMPLES = (
    800  # at 100 Hz: the standstill of the published test and the start of the first turn
)
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
    return any(word in source for word in ("@njit", "@intrinsic", "rate.compiling import"))


def warm() -> None:
    """Compile, or load from the cache, every function of the live path by running it on made-up
    motion.
    """
    logging.disable(logging.INFO)  # the made-up motion is no news
    try:
        _warm_rates()
        _warm_health()
        _warm_attitudes()
        _warm_alignment()
    finally:
        logging.disable(logging.NOTSET)


def _warm_rates() -> None:
    test = TableTest()
    for make in ESTIMATORS.values():
        estimator = make(test.layout)
        for index, sample in enumerate(itertools.islice(test, RATE_SAMPLES)):
            estimator.step(index, sample.t_s, sample.counts * test.sensor.count)


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


def _warm_health() -> None:
    """Samples of a standstill, then with an axis off, so that the hypotheses compile too."""
    test = TableTest()
    monitor = HealthMonitor(test.layout)
    spoilt = Faults([AxisFault(3, "biased", 4.0)]).into(test.block(0))
    for t, readings in zip(spoilt.t_s, spoilt.readings, strict=True):
        monitor.step(float(t), readings)
    if not monitor.mask:
        raise RuntimeError(
            "the made-up fault was not found: warm.py does not fit health.py any more"
        )


def main() -> None:
    """Entry point."""
    logging.basicConfig(level=logging.WARNING, format="%(levelname)s %(name)s: %(message)s")
    dropped = drop_stale()
    started = time.perf_counter()
    warm()
    print(
        f"compile cache ready in {time.perf_counter() - started:.1f} s ({dropped} stale files"
        " dropped)"
    )


if __name__ == "__main__":
    main()
