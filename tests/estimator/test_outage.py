"""An operator takes GNSS away: fixes are held back, said so, still score the filters, and a
recording knows it.
"""

import numpy as np
import pytest

from estimator.convert.navigation import horizon_message, innovation_message, nav_message
from estimator.devices.navigation import NavBoard
from estimator.pipeline import Pipeline
from estimator.settings import EstimatorSettings
from inertial.navigation.fuzzy import MEMBERSHIPS
from inertial.navigation.mute import Mute, Mutes
from inertial.navigation.navigation import NavigatorConfig
from inertial.navigation.solution import MUTED, Correction
from inertial.simulation.drive import simulate
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import GNSS, INNOVATION, MUTE, NAV
from sessions.recording import store
from sessions.recording.mcap_log import read
from sessions.recording.settings import RecorderSettings
from sessions.replay.playback import Playback
from sessions.replay.reproduce import ESTIMATES, reproduce
from sessions.replay.rerun import estimates_again
from tests.estimator.test_service import drive_messages

SETTINGS = EstimatorSettings(navigators=["huber-nhc"], rate=[], attitudes=[])


def test_muted_fixes_are_held_back_and_scored() -> None:
    drive = simulate(2, "B", 100.0)
    board = NavBoard("car", NavigatorConfig(), ["fpe-fuzzy"], 20.0)
    waiting, said, solutions = list(drive.fixes), [], []
    for k in range(0, len(drive.imu), 10):
        rows = drive.imu[k : k + 10]
        for output in board.feed(1, k, 0.01, rows[:, 0], rows[:, 1:4], rows[:, 4:7]):
            (said if isinstance(output.what, Correction) else solutions).append(output.what)
        if k == 6000:
            assert board.mute(10.0) == Mute(1, rows[-1, 0], rows[-1, 0] + 10.0)
        while waiting and waiting[0].t <= rows[-1, 0]:
            board.fix(waiting.pop(0))
    held = [c for c in said if c.fix.muted]
    assert 8 <= len(held) <= 11 and all(c.reason == MUTED and not c.accepted for c in held)
    message = innovation_message(pb.Header(), "fpe-fuzzy", held[-1])
    assert (
        len(message.error_to_reference) == 3
        and len(message.prediction_error) == 6
        and message.reason == MUTED
    )
    used = next(c for c in reversed(said) if c.accepted and c.horizon is not None)
    shown = horizon_message(used.horizon)
    assert 2 <= shown.n <= 10 and list(shown.membership_name) == list(MEMBERSHIPS)
    assert np.isclose(sum(shown.membership), 2.0)
    nav = nav_message(pb.Header(), pb.ImuBatch(), 1, "fpe-fuzzy", solutions[-1], board.muted(65.0))
    assert nav.gnss_muted and 2 <= nav.horizon.n <= 10
    with pytest.raises(ValueError, match="0 to 600"):
        board.mute(-1.0)


def test_the_latest_order_before_a_fix_decides() -> None:
    mutes = Mutes()
    long, end, again = Mute(1, 10.0, 40.0), Mute(1, 20.0, 20.0), Mute(1, 20.0, 25.0)
    for order in (end, long):  # also when they come in another order
        mutes.add(order)
    held = [t for t in (10.0, 10.5, 20.0, 20.5, 39.0) if mutes.held(1, t)]
    assert held == [10.5, 20.0]
    mutes.add(again)  # at the same sample, but after the one that ended the outage
    assert mutes.held(1, 24.0) and not mutes.held(1, 26.0)
    mutes.add(end)
    assert not mutes.held(1, 24.0) and not mutes.held(2, 15.0)


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """A real recording of a drive during which an operator muted GNSS for 8 s and ended it early.

    The outage's message reaches the recorder three fixes late: they are two processes.
    """
    pipeline, late, orders = Pipeline(SETTINGS), [], {30: 8.0, 35: 0.0}
    session = store.start(RecorderSettings(root=tmp_path_factory.mktemp("muted")))
    now, fixes = 0, 0
    for topic, message in drive_messages(42.0):
        now += 1
        session.add(now, topic.key("t", "car"), message.SerializeToString())
        outputs = pipeline.on(topic, message)
        if topic is GNSS:
            fixes += 1
            if fixes in orders:
                command = pb.EstimatorCommand(
                    action=pb.EstimatorCommand.ACTION_MUTE_GNSS, device="car", user="me"
                )
                command.seconds = orders.pop(fixes)
                reply, said = pipeline.order(command)
                assert reply.ok and [o.topic for o in said] == [MUTE]
                late += [(now + 150, o) for o in said]
        while late and late[0][0] <= now:
            session.add(now, MUTE.key("t", "car"), late.pop(0)[1].message.SerializeToString())
        for o in outputs:
            if o.topic in ESTIMATES:
                session.add(
                    now, o.topic.key("t", "car", o.estimator), o.message.SerializeToString()
                )
    assert not late and session.close()
    return session.folder / "recording.mcap"


def rows(path, topic):
    return [topic.type.FromString(row.payload) for row in read(path) if f"/{topic.name}" in row.key]


def test_a_recording_with_an_outage_gives_the_same_bits_again(recording) -> None:
    said = rows(recording, INNOVATION)
    held = [m for m in said if m.reason == MUTED]
    assert len(held) >= 4 and said[-1].accepted and any(m.gnss_muted for m in rows(recording, NAV))
    assert [m.user for m in rows(recording, MUTE)] == ["me", "me"]
    result = reproduce(recording, Pipeline(SETTINGS))
    assert result.identical and result.refused == 0
    assert sorted(result.keys) == ["t/car/innovation/huber-nhc", "t/car/nav/huber-nhc"]


def test_playing_and_running_again_obey_the_outage_too(recording) -> None:
    live = [
        m.SerializeToString(deterministic=True) for m in map(_bare, rows(recording, INNOVATION))
    ]
    again = [
        INNOVATION.type.FromString(payload)
        for _, key, payload in estimates_again(recording, Pipeline(SETTINGS))
        if "/innovation/" in key
    ]
    assert [m.SerializeToString(deterministic=True) for m in map(_bare, again)] == live
    played = []

    def put(address, device, m):
        if address.topic is INNOVATION:
            played.append(_copy(m))

    playback = Playback(recording, put, lambda: Pipeline(SETTINGS), speed=100.0)
    while playback._next is not None:  # as fast as it goes: the clock is not what is tested
        playback._advance(publish=True)
    assert [m.SerializeToString(deterministic=True) for m in map(_bare, played)] == live


def test_without_the_order_the_estimates_are_others(recording, tmp_path) -> None:
    session = store.start(RecorderSettings(root=tmp_path))
    for row in read(recording):
        if "/mute" not in row.key:
            session.add(row.log_ns, row.key, row.payload)
    assert session.close()
    result = reproduce(session.folder / "recording.mcap", Pipeline(SETTINGS))
    assert not result.identical and result.keys["t/car/innovation/huber-nhc"].different >= 4


def _copy(message):
    copy = type(message)()
    copy.CopyFrom(message)
    return copy


def _bare(message):
    message.header.sequence, message.header.device = 0, ""
    return message
