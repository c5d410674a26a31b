"""A table without a drive and a cube that is turned over, with all that `gyrofree demo --by-hand`
starts: a person is asked, is late, overshoots, slips; the test holds. Then six poses and a saved
calibration.
"""

import time

import pytest

from gyrofree.config import load
from messages.bus import orders
from messages.bus.session import open_client, subscribe
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import CALIBRATION, PROCEDURE, RATE
from tests.support.stack import RunningDemo

M, C, ACTION = pb.ProcedureStatus, pb.CalibrationStatus, pb.EstimatorCommand
TURN = """
title = "By hand"
repeats = 20
settle_s = 0.3
[[steps]]
kind = "still"
seconds = 1.0
[[steps]]
kind = "rate"
rate_dps = 90
dwell_s = 4.0
tolerance_dps = 6
[steps.limits.rate_error_dps]
min = -5
max = 5
[[steps]]
kind = "still"
seconds = 1.0
"""


class Ear:
    """Hears everything of a few topics; the newest first."""

    def __init__(self, session, prefix: str) -> None:
        self.said: dict[str, list] = {}
        self._kept = [
            subscribe(session, topic, prefix, lambda _, m, n=topic.name: self._hear(n, m))
            for topic in (PROCEDURE, CALIBRATION, RATE)
        ]

    def _hear(self, name: str, message) -> None:
        self.said.setdefault(name, []).append(message)

    def until(self, topic, wanted, seconds: float):
        end, seen = time.monotonic() + seconds, 0
        while time.monotonic() < end:
            heard = self.said.get(topic.name, [])
            for m in heard[seen:]:
                seen += 1
                if wanted(m):
                    return m
            time.sleep(0.05)
        raise AssertionError(f"not heard; last: {(self.said.get(topic.name) or [None])[-1]}")


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    with RunningDemo(tmp_path_factory.mktemp("by-hand"), "--by-hand") as demo:
        settings = load(demo.config)
        settings.procedures.folder.mkdir(parents=True)
        (settings.procedures.folder / "turn.toml").write_text(TURN)
        with open_client(settings.bus, timeout_s=20) as session:
            yield demo, settings, session, Ear(session, settings.bus.prefix)


def test_a_person_is_asked_slips_and_the_test_holds(bench):
    _, settings, session, ear = bench
    ear.until(PROCEDURE, lambda m: "turn" in m.offered, 60.0)
    start = pb.ProcedureCommand(
        action=pb.ProcedureCommand.ACTION_START,
        device="cube",
        procedure="turn",
        user="anna",
        own_session=True,
    )
    nobody = pb.ProcedureCommand()
    nobody.CopyFrom(start)
    nobody.user = ""
    give = (session, settings.bus.prefix, orders.PROCEDURES)
    assert "who runs the test" in orders.give(*give, nobody, "cube").message
    assert orders.give(*give, start, "cube").ok
    m = ear.until(PROCEDURE, lambda m: m.state >= M.STATE_DONE, 120.0)
    assert m.state == M.STATE_DONE and not m.table and m.operator == "anna", m.message
    step = m.steps[1]
    # The slip; a machine that is too busy to keep up may spoil another attempt.
    assert step.spoilt >= 1 and step.attempts == step.spoilt + 1
    said = [one.instruction for one in ear.said[PROCEDURE.name]]
    assert any(text.startswith("Turn the table counter-clockwise at 90 °/s") for text in said)
    assert any(text.startswith("Keep turning like this") for text in said)
    why = [one.message for one in ear.said[PROCEDURE.name] if one.step == 1]
    assert any("it turns at" in text and "wanted +90.0 ± 6" in text for text in why)
    assert step.until_us - step.from_us == 4_000_000 and "tachometer" in m.reference


def test_six_poses_end_in_a_calibration_that_the_estimators_use(bench):
    _, settings, session, ear = bench
    give = (session, settings.bus.prefix, orders.ESTIMATOR)

    def order(action: int) -> None:
        command = ACTION(action=action, device="cube", user="anna")
        reply = orders.give(*give, command, "cube")
        assert reply.ok, reply.message

    order(ACTION.ACTION_CALIBRATE_START)
    m = ear.until(CALIBRATION, lambda m: len(m.poses) >= 6 and m.good_enough, 180.0)
    ups = {tuple(round(v) for v in pose.up_b) for pose in m.poses}
    assert len(ups) >= 6, "the cube was turned over"
    order(ACTION.ACTION_CALIBRATE_FIT)
    fitted = ear.until(CALIBRATION, lambda m: m.state == C.STATE_FITTED, 60.0)
    assert 0.0 < fitted.residual_mps2 < 0.05 and max(fitted.bias_sigma_mps2) < 0.05
    order(ACTION.ACTION_CALIBRATE_SAVE)
    card = ear.until(CALIBRATION, lambda m: m.state == C.STATE_SAVED, 60.0).card
    used = ear.until(RATE, lambda m: m.calibration == card, 60.0)
    assert card and used.header.device == "cube"
    assert any(card in path.read_text() for path in settings.estimator.cards.rglob("*.toml"))
