"""The guided calibration as a person meets it: poses in any order, motion in between, the table,
the card.
"""

import numpy as np
import pytest

from inertial.calibration import guided as guide
from inertial.calibration.fit import CalibrationError
from inertial.calibration.poses import plan
from inertial.layouts.catalogue import find
from inertial.simulation.imperfect import MOUNTINGS, device, table_run, tumble

CUBE = find("cube", 0.05)


def fed(session, readings, start=0.0, batch=10, watch=None):
    """Feed readings in batches of ten samples at 100 Hz; returns the time after them."""
    for first in range(0, len(readings), batch):
        part = readings[first : first + batch]
        session.feed(start + (first + np.arange(len(part))) * 0.01, part)
        if watch is not None:
            watch(session)
    return start + len(readings) * 0.01


def turned(session, run, start):
    """A run on the table with a report of the tachometer every 50 ms, as the gateway gives it."""
    for first in range(0, len(run.t_s), 5):
        part = slice(first, first + 5)
        session.feed(start + run.t_s[part], run.readings[part])
        session.tacho(float(start + run.t_s[part][-1]), float(run.tacho[part].mean()))
    return start + run.t_s[-1] + 0.01


def test_poses_are_taken_one_by_one_until_it_is_good_enough():
    one, session = device(CUBE, 5), guide.GuidedCalibration(CUBE)
    seen, wanted = set(), []

    def watch(s):
        seen.add(s.state)
        if len(s.poses) < 10 and (not wanted or wanted[-1][0] != len(s.poses)):
            wanted.append((len(s.poses), s.next_up))

    fed(session, tumble(one, plan(10)), watch=watch)
    assert len(session.poses) == 10
    assert seen == {guide.WAITING, guide.TAKING}
    for (_, asked), up in zip(
        wanted, plan(10), strict=True
    ):  # it asked for what the plan says, in its order
        assert float(asked @ up) > 0.999
    assert session.good_enough and "good enough" in session.instruction
    assert session.fit.bias_sigma.max() < 0.01
    card = session.card("bench", "2026-01-02T03:04:05Z")
    assert (
        session.state == guide.FITTED and card.poses == 10 and card.id.startswith("bench-20260102-")
    )
    np.testing.assert_allclose(card.bias, one.bias, atol=0.006)


def test_a_pose_that_moves_is_not_taken_and_a_known_one_not_twice():
    one, session = device(CUBE, 5), guide.GuidedCalibration(CUBE)
    readings = tumble(one, plan(6)[:1], rest_s=2.5)
    t = fed(session, readings)
    assert session.state == guide.TAKING and 0.3 < session.progress < 1.0
    t = fed(session, tumble(one, plan(6)[1:2], rest_s=4.0), t)
    assert len(session.poses) == 1 and session.poses[0][0] @ plan(6)[1] > 0.99
    fed(session, tumble(one, plan(6)[1:2], rest_s=4.0), t)
    assert len(session.poses) == 1 and "already" in session.message
    with pytest.raises(CalibrationError, match="1 poses taken"):
        session.solve()


def test_runs_on_the_table_find_the_positions():
    one, session = device(CUBE, 8), guide.GuidedCalibration(CUBE)
    t = fed(session, tumble(one, plan(9)))
    for k, mounting in enumerate(MOUNTINGS):
        t = turned(session, table_run(one, mounting, seed=80 + k), t + 1.0)
        still = np.tile(CUBE.theta_b @ (mounting.T @ [0.0, 0.0, 9.80665]), (250, 1))
        for first in range(0, 250, 5):
            session.feed(t + 0.01 * (first + np.arange(5)), still[first : first + 5])
            session.tacho(t + 0.01 * (first + 4), 0.0)
        t += 2.5
    assert session.steps == 3, session.message
    card = session.card("bench", "2026-01-02T03:04:05Z")
    assert card.steps == 3 and card.observed.all()
    before = np.abs(CUBE.r_b - one.true.r_b).max()
    assert np.abs(card.position_b - one.true.r_b).max() < 0.5 * before


def test_the_same_samples_give_the_same_card_and_a_gap_spoils_only_the_pose():
    readings = tumble(device(CUBE, 6), plan(9))
    cards = []
    for batch in (10, 7):
        session = guide.GuidedCalibration(CUBE)
        fed(session, readings, batch=batch)
        cards.append(session.card("a", "2026-01-02T03:04:05Z"))
    assert cards[0].id == cards[1].id and (cards[0].bias == cards[1].bias).all()
    session = guide.GuidedCalibration(CUBE)
    fed(session, readings[:300])
    assert session.state == guide.TAKING
    session.gap()
    assert session.state == guide.WAITING and "lost" in session.message
