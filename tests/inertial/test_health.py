"""Axis health: faults are named in time, the right axis by the right name, and good axes are left
alone.
"""

import pickle

import numpy as np
import pytest
from scipy.linalg import null_space
from support import parity_twin as twin

from estimator.devices.rate import RateBoard
from estimator.pipeline import Pipeline
from estimator.settings import EstimatorSettings
from inertial import core
from inertial.core import native
from inertial.layouts.catalogue import CUBE, LAYOUTS, find
from inertial.layouts.layout import products
from inertial.rate import axis_samples, parity
from inertial.rate.axis_belief import projection
from inertial.rate.estimators import VARIANTS
from inertial.rate.health import AxisState, HealthMonitor
from inertial.simulation.faults import FaultError, Faults, parse, when
from inertial.simulation.table import IDEAL, TableTest
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import AXES

NAMES = CUBE(0.05).axis_names


def watch(fault: str = "", profile: str = "published", seed: int = 1, until_s: float = 30.0):
    """The monitor after a run, and every change of an axis: (s, axis, state, excluded)."""
    table = TableTest(seed, profile=profile)
    faults = Faults([parse(text, NAMES) for text in fault.split()])
    monitor = HealthMonitor(table.layout)
    changes, before = [], [(AxisState.GOOD, False)] * 12
    for number in range(int(np.ceil(until_s / 10.0))):
        block = faults.into(table.block(number))
        for t, readings in zip(block.t_s, block.readings, strict=True):
            if t >= until_s:
                break
            monitor.step(float(t), readings)
            now = [(f.state, f.excluded) for f in monitor.faults]
            if now != before:
                changes += [(float(t), NAMES[i], *now[i]) for i in range(12) if now[i] != before[i]]
                before = now
    return monitor, changes


def named(changes):
    """First exclusion of every axis: name -> (s, state)."""
    found = {}
    for t, axis, state, excluded in changes:
        if excluded and axis not in found:
            found[axis] = (t, state)
    return found


# --- the filter


def constants(layout, draw=None):
    """Of a layout; with `draw` everything that may be known of its axes is something."""
    n = layout.axes
    numbers = np.zeros((4, n)) if draw is None else np.abs(draw.normal(size=(4, n))) * 0.1
    return parity.Constants(layout.J.copy(), layout.Q.copy(), *numbers)


def test_the_model_is_the_acceleration_field():
    cube, draw = CUBE(0.05), np.random.default_rng(2)
    x = np.concatenate([draw.normal(size=9) * 3.0, [0.7]])

    def read(x):
        return native.health.observe(x, np.zeros((10, 10)), constants(cube), 4)

    reading, H, spread = read(x)
    expected = cube.J @ x[3:9] + cube.Q @ products(x[:3])
    expected[4] += 0.7
    np.testing.assert_allclose(reading, expected, atol=1e-12)
    assert not spread.any()
    for k in range(10):
        step = np.zeros(10)
        step[k] = 1e-6
        np.testing.assert_allclose(
            H[:, k], (read(x + step)[0] - read(x - step)[0]) / 2e-6, atol=1e-6
        )


def test_prediction_has_its_jacobian():
    draw = np.random.default_rng(4)
    x, A = draw.normal(size=10), draw.normal(size=(10, 10))
    P, dt = A @ A.T, 0.04
    F = np.empty((10, 10))
    for k in range(10):
        step = np.zeros(10)
        step[k] = 1e-6
        high, low = (native.health.predict(x + s, P, dt, 0.0, 0.0)[0] for s in (step, -step))
        F[:, k] = (high - low) / 2e-6
    walked = native.health.predict(x, P, dt, 0.0, 0.0)[1]
    exact = F @ P @ F.T  # to first order in the turn of one block
    assert np.linalg.norm(walked - exact) < 0.02 * np.linalg.norm(exact)


def believe(draw):
    """A state and a covariance that a filter may have."""
    x, A = draw.normal(size=10) * 2.0, draw.normal(size=(10, 10))
    return x, A @ A.T + np.eye(10)


@pytest.mark.parametrize("name", ["cube", "chen-6", "nine", "array-24"])
def test_the_core_equals_its_twin(name):
    layout, draw = find(name, 0.05), np.random.default_rng(8)
    n, c = layout.axes, constants(layout, draw)
    used, learned = np.ones(n, bool), draw.random(n) > 0.4
    used[n - 1] = n <= 6
    tuning = parity.Tuning(200.0, 4.0, 0.012, 0.03)
    x, P = believe(draw)
    for mine, theirs in zip(
        native.health.observe(x, P, c, 2), twin.observe(x, P, c.J, c.Q, 2), strict=True
    ):
        np.testing.assert_allclose(mine, theirs, rtol=1e-10, atol=1e-10)
    block = draw.normal(size=n) * 5.0
    args = (x, P, block, 0.04, used, learned, c, tuning)
    for mine, theirs in zip(parity.step(*args), twin.step(*args), strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=1e-7, atol=1e-7)
    blocks, dt = draw.normal(size=(7, n)) * 5.0, np.full(7, 0.04)
    for kind in parity.Kind:
        pair = kind in (parity.SWAP, parity.SWAP_CHANGES)
        about = (kind, 1, 3 if pair else -1, 2)
        mine = parity.replay(x, P, blocks, dt, used, about, c, tuning)
        theirs = twin.replay(x, P, blocks, dt, used, *about, c, tuning)
        for a, b in zip(mine, theirs, strict=True):
            np.testing.assert_allclose(a, b, rtol=1e-6, atol=1e-6)


def test_counters_equal_their_twin():
    draw, n = np.random.default_rng(3), 12
    f = np.round(draw.normal(size=(400, n)) * 0.1, 3)
    f[50, 3], f[90, 3], f[120:180, 5], f[200:230, 7] = 4.0, -4.0, 0.125, 16.0
    noise, limit, free = np.full(n, 0.1), np.full(n, 16.0), projection(CUBE(0.05).J)
    found = []
    for maker in (axis_samples, twin):
        near, marks = np.zeros((axis_samples.KEPT, n)), np.zeros(axis_samples.MARKS, np.int64)
        count, row, seen = axis_samples.counters(n), 0, []
        while row < len(f):
            row = maker.gather(f, row, 4, near, marks, noise, limit, free, count)
            marks[axis_samples.FILLED] = 0
            ratio = maker.measured_noise(near, marks, free)
            rounded = maker.resolution(near, 1e-4 * noise), maker.resolution(near, noise)
            seen.append((row, near.copy(), marks.copy(), count.copy(), ratio, rounded))
            near[axis_samples.SUM] = 0.0
        found.append(seen)
    for mine, theirs in zip(*found, strict=True):
        for a, b in zip(mine, theirs, strict=True):
            np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-12)
    assert found[0][-1][5] == (pytest.approx(1e-3), 0.0)
    assert found[0][-1][4] == 1.0 or found[0][-1][4] > 1.25
    assert found[0][-1][3][axis_samples.SPIKES].max() >= 0 and len(found[0]) == 100


def test_the_first_state_is_that_of_the_motion():
    cube = CUBE(0.05)
    motion = np.array([30.0, -20.0, 10.0, 1.0, 2.0, -9.0])
    for omega in ([6.0, -3.0, 2.0], [0.0, 0.0, 0.0]):
        f = cube.J @ motion + cube.Q @ products(np.array(omega))
        x, P = parity.start(constants(cube), f, np.ones(12, bool), 0.01, True)
        assert min(np.abs(x[:3] - omega).max(), np.abs(x[:3] + omega).max()) < 1e-6
        np.testing.assert_allclose(x[3:9], motion, atol=1e-6 if any(omega) else 1e-9)
        assert P[0, 0] == (pytest.approx(0.01, rel=0.1) if any(omega) else 1.0)


def test_both_builds_of_the_monitor_give_the_same_bits():
    builds = list(core.builds().values())
    layout, draw = CUBE(0.05), np.random.default_rng(8)
    c, used = constants(layout, draw), np.ones(12, bool)
    x, P = believe(draw)
    blocks = draw.normal(size=(7, 12)) * 5.0
    said = [
        build.health.replay(
            x, P, blocks, np.full(7, 0.04), used, (5, 1, 3, 2), c, (200.0, 4.0, 0.012, 0.03)
        )
        for build in builds
    ]
    for a, b in zip(*said, strict=True):
        assert np.asarray(a).tobytes() == np.asarray(b).tobytes()


def test_a_monitor_goes_on_after_a_pickle_as_before_it():
    faults = Faults([parse("a22:biased=1.5@4", NAMES)])
    table = TableTest(1, profile="wobble")
    block = faults.into(table.block(0))
    whole, cut = HealthMonitor(table.layout), HealthMonitor(table.layout)
    said = []
    for k in range(0, 1000, 10):
        cut = pickle.loads(pickle.dumps(cut))
        part = (block.t_s[k : k + 10], block.readings[k : k + 10])
        said.append((whole.feed(*part), cut.feed(*part)))
    assert all(a == b for a, b in said) and whole.mask == 1 << NAMES.index("a22")
    np.testing.assert_array_equal(whole.newest.residual, cut.newest.residual)


def test_a_residual_is_the_reading_minus_what_the_others_say():
    cube, draw = CUBE(0.05), np.random.default_rng(6)
    x, P = np.zeros(10), np.diag([0.1] * 3 + [50.0] * 3 + [9.0] * 3 + [0.0])
    f, c = draw.normal(size=12), constants(cube)._replace(white=np.full(12, 1e-3))
    used = np.ones(12, bool)
    tuning = parity.Tuning(0.0, 0.0, 0.0, 0.0)
    _, _, nis, _, residual, sigma = parity.step(x, P, f, 0.0, used, ~used, c, tuning)
    assert nis > 0.0
    without = np.arange(12) != 7
    _, P = native.health.predict(x, P, 0.0, 0.0, 0.0)
    reading, H, spread = native.health.observe(x, P, c, -1)
    C = H @ P @ H.T + spread + np.diag(c.white)
    nu = f - reading
    gain = C[7, without] @ np.linalg.inv(C[np.ix_(without, without)])
    assert residual[7] == pytest.approx(nu[7] - gain @ nu[without], rel=1e-6)
    assert sigma[7] ** 2 == pytest.approx(C[7, 7] - gain @ C[without, 7], rel=1e-6)


def test_at_rest_every_axis_of_the_cube_has_a_parity_direction_of_its_own():
    V = null_space(CUBE(0.05).theta_b.T).T
    unit = V / np.linalg.norm(V, axis=0)
    assert np.abs(unit.T @ unit - np.eye(12)).max() < 0.5


# --- faults


@pytest.mark.parametrize("profile", ["published", "wobble", "fast"])
@pytest.mark.parametrize(
    ("fault", "axes", "state"),
    [
        ("a21:stuck@12", {"a21"}, AxisState.STUCK),
        ("a32:saturated@12", {"a32"}, AxisState.SATURATED),
        ("a13:swapped=a21@12", {"a13", "a21"}, AxisState.SWAPPED),
        ("a43:flipped@12", {"a43"}, AxisState.FLIPPED),
        ("a11:spiking@12", {"a11"}, AxisState.SPIKING),
        ("a22:biased=1.5@12", {"a22"}, AxisState.BIASED),
    ],
)
def test_a_fault_is_named_within_two_seconds_and_no_other_axis_with_it(profile, fault, axes, state):
    monitor, changes = watch(fault, profile, until_s=14.0)
    found = named(changes)
    assert set(found) == axes, changes
    for t, said in found.values():
        assert said == state and 12.0 <= t <= 14.0
    assert monitor.mask == sum(1 << NAMES.index(axis) for axis in axes)


def test_a_wrong_sign_from_the_start_is_found_when_the_table_turns():
    found = named(watch("a12:flipped@0", until_s=9.0)[1])
    assert list(found) == ["a12"] and found["a12"][1] == AxisState.FLIPPED and found["a12"][0] < 8.0


def test_an_axis_returns_when_it_is_good_again_and_not_before():
    monitor, changes = watch("a21:biased@12-17", until_s=22.0)
    gone = next(t for t, _, _, out in changes if out)
    back = next(
        t for t, _, state, out in changes if t > gone and state == AxisState.GOOD and not out
    )
    assert gone < 14.0 and 19.0 <= back < 21.0  # two seconds of good readings
    assert monitor.mask == 0 and monitor.counts.returned == 1


def test_relapses_wait_longer():
    _, changes = watch("a21:saturated@6-6.5 a21:saturated@11-11.5", until_s=18.0)
    returns = [t for t, _, state, _ in changes if state == AxisState.GOOD]
    assert len(returns) == 2 and returns[1] - 11.5 > 1.7 * (returns[0] - 6.5)


def test_two_axes_at_once():
    found = named(watch("a21:stuck@8 a33:biased=2@10", until_s=13.0)[1])
    assert (
        found["a21"][1] == AxisState.STUCK
        and found["a33"][1] == AxisState.BIASED
        and len(found) == 2
    )


@pytest.mark.parametrize(
    ("profile", "seed"), [("published", 3), ("wobble", 5), ("fast", 7), ("still", 9)]
)
def test_good_axes_are_left_alone(profile, seed):
    monitor, changes = watch(profile=profile, seed=seed)
    assert not changes and monitor.counts.named == monitor.counts.restarts == 0


def test_a_source_without_noise_is_not_stuck():
    table = TableTest(1, profile="still", sensor=IDEAL)
    monitor = HealthMonitor(table.layout)
    for t, readings in zip(table.block(0).t_s[:300], table.block(0).readings, strict=False):
        monitor.step(float(t), readings)
    assert monitor.mask == 0


def test_gaps_do_not_accuse_an_axis():
    table, block = TableTest(2), TableTest(2).block(0)
    monitor = HealthMonitor(table.layout)
    for row in range(1000):
        if 600 <= row < 640 or 800 <= row < 950:
            continue
        if row in (640, 950):
            monitor.skip(40 if row == 640 else 150)
        monitor.step(float(block.t_s[row]), block.readings[row])
    assert monitor.mask == 0 and monitor.counts.named == 0


def test_the_same_samples_give_the_same_verdicts():
    a, b = (watch("a21:biased@8", until_s=10.0) for _ in range(2))
    assert a[1] == b[1]
    np.testing.assert_array_equal(a[0].newest.residual, b[0].newest.residual)


@pytest.mark.parametrize("name", ["chen-6", "nine", "edges-12", "stars-12"])
def test_other_layouts_are_watched_as_far_as_they_can_be(name):
    table = TableTest(1, profile="still", layout=LAYOUTS[name](0.05))
    monitor, block = HealthMonitor(table.layout), table.block(0)
    readings = block.readings.copy()
    for t, row in zip(block.t_s, readings, strict=True):
        monitor.step(float(t), row)
    assert monitor.mask == 0
    held = readings[-1].copy()
    for k in range(100):
        row = readings[k].copy()
        row[2] = held[2]
        monitor.step(10.0 + 0.01 * k, row)
    assert monitor.mask == (0 if name == "chen-6" else 4)  # six axes: none can be spared
    assert monitor.faults[2].state == AxisState.STUCK


# --- the way to the estimators


class Told:
    """An estimator that remembers what it was told."""

    def __init__(self, layout) -> None:
        self.masks, self._real = [], VARIANTS["least-squares"](layout)

    def feed(self, t_s, f_axis):
        return self._real.feed(t_s, f_axis)

    def skip(self, n) -> None: ...

    def withhold(self, on):
        pass

    def doubt(self, on):
        pass

    def exclude(self, mask: int) -> None:
        self.masks.append(mask)


def test_estimators_are_told_which_axes_to_leave_out(monkeypatch):
    table = TableTest(1)
    faults = Faults([parse("a21:saturated@6-6.5", NAMES)])
    monkeypatch.setitem(VARIANTS, "told", Told)
    board = RateBoard("cube", table.layout, ["told"], 200.0)
    for number in range(2):
        block = faults.into(table.block(number))
        for k in range(0, 1000, 10):
            rows = slice(k, k + 10)
            board.feed(0, block.index + k, 0.01, block.t_s[rows], block.readings[rows])
    assert board._estimators["told"].masks == [1 << NAMES.index("a21"), 0]


def test_an_axis_the_board_calls_stale_is_not_used():
    table, block = TableTest(1), TableTest(1).block(0)
    board = RateBoard("cube", table.layout, [], 200.0)
    board.feed(0, 0, 0.01, block.t_s[:200], block.readings[:200])
    board.feed(0, 200, 0.01, block.t_s[200:220], block.readings[200:220], stale=1 << 5)
    assert board.health.mask == 1 << 5 and board.health.faults[5].state == AxisState.STALE


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a21", "want AXIS:KIND@SECONDS"),
        ("a91:stuck@3", "no axis 'a91', want one of a11"),
        ("a21:broken@3", "kind 'broken', want one of stuck"),
        ("a21:stuck@9-3", "ends at 3 s, want later than 9 s"),
        ("a21:swapped@9", "no axis None"),
        ("a21:stuck=4@9", "stuck takes no value"),
    ],
)
def test_faults_that_cannot_be_are_refused(text, message):
    with pytest.raises(FaultError, match=message):
        parse(text, NAMES)


def test_axis_health_is_published_four_times_a_second():
    pipeline = Pipeline(EstimatorSettings(rate=["least-squares"]))
    block = Faults([parse("a21:saturated@1", NAMES)]).into(TableTest(1).block(0))
    said = []
    for k in range(0, 300, 10):
        header = pb.Header(device="cube", device_us=k * 10_000, utc_ns=10**18 + k * 10**7)
        rows = block.readings[k : k + 10]
        batch = pb.AccelBatch(
            header=header, first_index=k, period_s=0.01, axes=12, f_mps2=rows.ravel()
        )
        said += [o.message for o in pipeline.on_accel(batch) if o.topic is AXES]
    assert 11 <= len(said) <= 13
    last = said[-1].axes[3]
    assert last.name == "a21" and last.excluded and last.state == pb.AxisHealth.STATE_SATURATED
    assert 1.0 <= (last.since_utc_ns - 10**18) * 1e-9 < 1.2
    assert list(last.position_b_m) == [-0.05, 0.05, 0.05] and not any(
        a.excluded for a in said[2].axes
    )


def test_a_fault_says_when_it_comes_or_that_it_never_does():
    assert when(parse("a21:stuck@12", NAMES), 30.0).startswith("comes 12 s after")
    assert when(parse("a21:stuck@30", NAMES), 30.0).startswith("never comes")
