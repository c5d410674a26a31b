"""Playback: whatever a person does with it, the estimates are those of the recording, and the order
that of time.
"""

import threading
import time

import pytest
from support.table_session import table_recording
from support.waiting import until

from estimator.pipeline import Pipeline
from estimator.settings import EstimatorSettings
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import ACCEL, RATE
from sessions.recording.mcap_log import read
from sessions.replay.playback import BEFORE_S, Playback
from sessions.replay.reproduce import ESTIMATES

PATIENCE = 60.0  # s; generous, the tests wait for states
KIND = pb.ReplayCommand


def pipeline() -> Pipeline:
    return Pipeline(EstimatorSettings(navigators=[]))


class Player:
    """A playback on a thread of its own; what it publishes is kept as bytes under the recording's
    names.
    """

    def __init__(self, make=pipeline, **options) -> None:
        self.sent: list[
            tuple[str, str, int, bytes]
        ] = []  # topic, estimator, for_index or first_index, bytes
        self.playback = Playback(table_recording(), self._put, make, **options)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self.playback.run, args=(self._stop, None, True))

    def _put(self, address, device, message) -> None:
        assert device.endswith("-replay")
        copy = type(message)()
        copy.CopyFrom(message)
        if "header" in copy.DESCRIPTOR.fields_by_name:
            copy.header.device = "cube"
            if address.topic in ESTIMATES:
                copy.header.ClearField("sequence")
        index = getattr(copy, "for_index", getattr(copy, "first_index", 0))
        self.sent.append(
            (
                address.topic.name,
                address.estimator,
                index,
                copy.SerializeToString(deterministic=True),
            )
        )

    def __enter__(self) -> "Player":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join(PATIENCE)
        assert not self._thread.is_alive()

    def order(self, action, value: float = 0.0, until_s: float = 0.0) -> pb.ReplayStatus:
        answers = []
        self.playback.order(
            pb.ReplayCommand(action=action, value=value, until=until_s), answers.append
        )
        return until(lambda: answers and answers[0], "the answer")

    def at(self, seconds: float) -> None:
        until(
            lambda: self.playback.position_s >= seconds and self.playback._target is None,
            f"{seconds:g} s",
        )


@pytest.fixture(scope="module")
def recorded() -> dict[tuple[str, str, int], bytes]:
    """The recorded rate estimates by estimator and index."""
    found = {}
    for row in read(table_recording()):
        if "/rate/" in row.key:
            message = RATE.type.FromString(row.payload)
            message.header.ClearField("sequence")
            found[RATE.name, message.estimator, message.for_index] = message.SerializeToString(
                deterministic=True
            )
    return found


def test_estimates_are_bit_for_bit_those_of_the_recording_wherever_one_jumps(recorded):
    with Player(speed=100.0, paused=True) as player:
        length = player.playback.source.length_s
        player.order(KIND.ACTION_SEEK, length - 1.0)  # forward, over everything
        player.at(length - 1.0)
        player.order(KIND.ACTION_SEEK, 22.0)  # back, behind a kept state
        until(lambda: abs(player.playback.position_s - 22.0) < 0.1, "22 s")
        player.order(KIND.ACTION_SEEK, 3.0)
        until(lambda: abs(player.playback.position_s - 3.0) < 0.1, "3 s")
        player.order(KIND.ACTION_RESUME)
        until(lambda: player.playback.paused, "the end")
        assert player.playback.status().message == "the end of the recording"
    estimates = [(*row[:3], row[3]) for row in player.sent if row[0] == "rate"]
    assert len(estimates) > len(recorded) * 0.9
    for *name, payload in estimates:
        assert payload == recorded[tuple(name)], name
    last_run = [row for row in player.sent if row[0] == "accel"][-10:]
    assert [row[2] for row in last_run] == sorted(row[2] for row in last_run)


def test_pause_step_speed_and_loop():
    with Player(make=None, paused=True) as player:
        assert player.order(KIND.ACTION_STATUS).paused and not player.sent
        for count in (1, 3):
            before = sum(row[0] == ACCEL.name for row in player.sent)
            player.order(KIND.ACTION_STEP, count)
            wanted = before + count
            until(lambda n=wanted: sum(r[0] == ACCEL.name for r in player.sent) == n, "the steps")
        time.sleep(0.1)
        assert sum(row[0] == ACCEL.name for row in player.sent) == 4
        refused = player.order(KIND.ACTION_SPEED, 1000.0)
        assert "want 0.1 to 100" in refused.message and refused.speed == 1.0
        assert "want a stretch within" in player.order(KIND.ACTION_LOOP, 5.0, 1e6).message
        assert player.order(KIND.ACTION_SPEED, 100.0).speed == 100.0
        status = player.order(KIND.ACTION_LOOP, 2.0, 4.0)
        assert (status.loop_from_s, status.loop_until_s) == (2.0, 4.0)
        player.order(KIND.ACTION_SEEK, 2.0)
        player.order(KIND.ACTION_RESUME)
        passes = []

        def turned() -> bool:
            passes.append(player.playback.position_s)
            return sum(b < a for a, b in zip(passes, passes[1:], strict=False)) >= 3

        until(turned, "three rounds of the loop")
        assert max(passes) < 4.5
        player.order(KIND.ACTION_END)
        player._thread.join(PATIENCE)


def test_a_step_back_undoes_a_step_and_the_next_one_goes_on():
    """Batches of any size: where one stands after a step back is where the last batch but one
    was.
    """
    with Player(paused=True) as player:
        stood = []
        for count in range(1, 6):
            player.order(KIND.ACTION_STEP, 1)
            until(lambda: sum(row[0] == ACCEL.name for row in player.sent) >= count, "the step")  # noqa: B023
            stood.append(player.playback.position_s)
        for at in reversed(stood[1:-1]):
            player.order(KIND.ACTION_STEP, -1)
            until(
                lambda s=at: player.playback.position_s == s and player.playback._target is None,
                f"{at:g} s",
            )
        player.order(KIND.ACTION_STEP, 1)
        until(lambda: player.playback.position_s == stood[2], "the step on")
        player.order(KIND.ACTION_STEP, -5)
        until(lambda: player.playback.position_s <= stood[0], "the beginning")


def test_real_time_is_kept_and_a_link_to_a_moment_begins_there():
    with Player(make=None, at_s=12.0, speed=2.0) as player:
        player.at(12.0)
        begun, position = time.monotonic(), player.playback.position_s
        player.at(position + 1.0)
        assert time.monotonic() - begun >= 0.4
    times = [row[2] for row in player.sent if row[0] == ACCEL.name]
    assert times == sorted(times) and times[0] <= (12.0 - BEFORE_S + 0.2) * 100


def test_old_estimates_beside_new_ones_of_other_estimators():
    with Player(
        make=lambda: Pipeline(EstimatorSettings(rate=["least-squares"], navigators=[])),
        show_recorded=True,
        speed=100.0,
    ) as player:
        player.at(3.0)
    names = {row[1] for row in player.sent if row[0] == "rate"}
    assert (
        "least-squares" in names
        and "products-ekf-recorded" in names
        and "products-ekf" not in names
    )
