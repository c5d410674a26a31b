"""What an estimator says does not depend on which others ran before it: bit for bit, in any order
and live beside each other.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from inertial.attitude.filters import ATTITUDES
from inertial.navigation.batch import run_filters
from inertial.navigation.filters import DEFAULT
from inertial.navigation.navigation import NAVIGATORS
from inertial.navigation.smoother import SMOOTHERS, smooth_drive
from inertial.rate.estimators import VARIANTS
from inertial.simulation.drive import SimulatedDrive, simulate
from inertial.simulation.table import TableTest

Array = NDArray[np.float64]

NAVIGATION = (DEFAULT, "kf", "kf-scale", "fpe-fuzzy", "mhe-robust", "kf-fading")


@cache
def holed() -> SimulatedDrive:
    """Two drives in one: 0.4 s of samples are missing, after which each filter starts anew."""
    drive = simulate(4, "B", 90.0)
    t = drive.imu[:, 0]
    return replace(drive, imu=drive.imu[(t < 60.0) | (t >= 60.4)])


def same(one: Array, other: Array) -> bool:
    return one.tobytes() == other.tobytes()


@cache
def alone(name: str) -> Any:
    return run_filters(holed().imu, holed().fixes, [name])[name]


@given(order=st.permutations(NAVIGATION), many=st.integers(2, 3))
@settings(deadline=None, max_examples=6)
def test_navigators_in_any_order(order: list[str], many: int) -> None:
    runs = run_filters(holed().imu, holed().fixes, order[:many])
    for name, run in runs.items():
        assert len(run.rows) > 30 and run.t[-1] > 80.0  # it began again behind the hole
        assert same(run.rows, alone(name).rows), name
        assert same(run.leg.P, alone(name).leg.P), name


def test_a_smoother_after_other_estimators() -> None:
    drive = holed()
    for name in SMOOTHERS:
        first = smooth_drive(drive.imu, drive.fixes, name)
        run_filters(drive.imu, drive.fixes, ["kf"])
        for other in SMOOTHERS:
            smooth_drive(drive.imu, drive.fixes, other)
        again = smooth_drive(drive.imu, drive.fixes, name)
        assert first is not None and again is not None and same(first.x, again.x)
        assert same(first.P, again.P)


def test_navigators_live_beside_each_other() -> None:
    drive = holed()

    def live(names: list[str]) -> dict[str, bytes]:
        navigators = {name: NAVIGATORS[name]() for name in names}
        said: dict[str, list[bytes]] = {name: [] for name in names}
        waiting = list(drive.fixes)
        for row in drive.imu:
            while waiting and waiting[0].arrival <= row[0]:
                fix = waiting.pop(0)
                for navigator in navigators.values():
                    navigator.fix(fix)
            for name, navigator in navigators.items():
                for correction in navigator.imu(row[0], row[1:4], row[4:7]):
                    said[name].append(np.asarray(correction.values).tobytes())
        return {name: b"".join(words) for name, words in said.items()}

    together = live([DEFAULT, "kf"])
    assert len(together[DEFAULT]) > 1000
    for name in ("kf", DEFAULT):
        assert live([name])[name] == together[name]


def beside(
    makers: dict[str, Callable[[], Any]], order: list[str], step: Callable[[Any, int], Any], n: int
) -> dict[str, list]:
    """Estimators fed with the same samples turn about, as live."""
    made = {name: makers[name]() for name in order}
    said: dict[str, list] = {name: [] for name in order}
    for k in range(n):
        for name in order:
            said[name].append(step(made[name], k))
    return said


@given(order=st.permutations(sorted(ATTITUDES)))
@settings(deadline=None, max_examples=6)
def test_attitude_filters_in_any_order_and_live(order: list[str]) -> None:
    draw = np.random.default_rng(7)
    f = np.array([0.0, 0.0, -9.81]) + draw.normal(0.0, 0.3, (300, 3))
    w = draw.normal(0.0, 0.2, (300, 3))
    makers = {name: (lambda make=ATTITUDES[name]: make(0.01)) for name in ATTITUDES}
    said = beside(makers, order, lambda one, k: one.step(f[k], w[k]).q_nb, len(f))
    for name in order:
        assert same(np.array(said[name]), np.array(makers[name]().batch(f, w))), name


@cache
def table() -> tuple[Any, Array, Array]:
    """The cube, times (n,) and readings (n, 12) of it on its table."""
    test = TableTest(5, profile="wobble")
    block = test.block(0)
    return test.layout, block.t_s[:800], block.readings[:800]


@cache
def rate_alone(name: str) -> tuple[bytes, bytes]:
    cube, t_s, readings = table()
    columns = VARIANTS[name](cube).feed(t_s, readings)
    return columns.omega_b.tobytes(), columns.P.tobytes()


@given(order=st.permutations(sorted(VARIANTS)), chunk=st.sampled_from((7, 64)))
@settings(deadline=None, max_examples=4)
def test_rate_estimators_in_any_order_and_live(order: list[str], chunk: int) -> None:
    cube, t_s, readings = table()
    starts = range(0, len(t_s), chunk)
    makers = {name: (lambda make=VARIANTS[name]: make(cube)) for name in VARIANTS}

    def feed(one: Any, k: int) -> tuple[Array, Array]:
        part = slice(starts[k], starts[k] + chunk)
        columns = one.feed(t_s[part], readings[part])
        return columns.omega_b, columns.P

    for name, said in beside(makers, order, feed, len(starts)).items():
        omega, P = (np.concatenate(parts) for parts in zip(*said, strict=True))
        assert (omega.tobytes(), P.tobytes()) == rate_alone(name), name


def test_the_hole_is_one() -> None:
    assert np.diff(holed().imu[:, 0]).max() == pytest.approx(0.4, abs=0.02)
