"""An operator takes GNSS away: the fixes are held back, said so, and still score the filters."""

import numpy as np
import pytest

from estimator.convert import horizon_message, innovation_message, nav_message
from estimator.ins.board import NavBoard
from estimator.ins.fuzzy import MEMBERSHIPS
from estimator.ins.navigation import NavigatorConfig
from estimator.ins.solution import MUTED, Correction
from estimator.simulation.drive import simulate
from messages import gyrofree_pb2 as pb


def test_muted_fixes_are_held_back_and_scored() -> None:
    drive = simulate(2, "B", 100.0)
    board = NavBoard("car", NavigatorConfig(), ["fpe-fuzzy"], 20.0)
    waiting, said, solutions = list(drive.fixes), [], []
    for k in range(0, len(drive.imu), 10):
        rows = drive.imu[k : k + 10]
        for output in board.feed(1, k, 0.01, rows[:, 0], rows[:, 1:4], rows[:, 4:7]):
            (said if isinstance(output.what, Correction) else solutions).append(output.what)
        if k == 6000:
            assert "muted for 10 s" in board.mute(10.0)
        while waiting and waiting[0].t <= rows[-1, 0]:
            board.fix(waiting.pop(0))
    held = [c for c in said if c.fix.muted]
    assert 8 <= len(held) <= 11 and all(c.reason == MUTED and not c.accepted for c in held)
    message = innovation_message(pb.Header(), "fpe-fuzzy", held[-1])
    assert len(message.error_to_reference) == 3 and len(message.prediction_error) == 6 and message.reason == MUTED
    used = next(c for c in reversed(said) if c.accepted and c.horizon is not None)
    shown = horizon_message(used.horizon)
    assert 2 <= shown.n <= 10 and list(shown.membership_name) == list(MEMBERSHIPS)
    assert np.isclose(sum(shown.membership), 2.0)
    nav = nav_message(pb.Header(), pb.ImuBatch(), 1, "fpe-fuzzy", solutions[-1], board.muted(65.0))
    assert nav.gnss_muted and 2 <= nav.horizon.n <= 10
    assert "used again" in board.mute(0.0) and not board.muted(65.0)
    with pytest.raises(ValueError, match="0 to 600"):
        board.mute(-1.0)
