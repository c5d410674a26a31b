"""Attitude filters in the live path: what comes out of batches, over gaps, and twice from the same
samples.
"""

import pickle

import numpy as np
import pytest

from estimator.devices.attitude import AttitudeBoard
from estimator.pipeline import Pipeline
from estimator.settings import EstimatorSettings
from inertial.attitude.filters import ATTITUDES
from inertial.rotation import to_matrix
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import ATTITUDE, IMU

G = 9.81
NAMES = list(ATTITUDES)


def tipped(n: int, angle: float) -> tuple[np.ndarray, np.ndarray]:
    """n samples of a board at rest, rolled by an angle."""
    f = np.tile([0.0, -G * np.sin(angle), -G * np.cos(angle)], (n, 1))
    return f, np.zeros((n, 3))


def batches(n: int, size: int = 10) -> list[pb.ImuBatch]:
    f, w = tipped(n, 0.3)
    out = []
    for k in range(0, n, size):
        header = pb.Header(device="board", sequence=k // size, epoch=1, device_us=k * 10_000)
        message = pb.ImuBatch(header=header, first_index=k, period_s=0.01)
        message.f_b_mps2.extend(f[k : k + size].ravel())
        message.omega_ib_b_radps.extend(w[k : k + size].ravel())
        out.append(message)
    return out


def test_imu_batches_become_attitudes_of_every_filter():
    pipeline = Pipeline(EstimatorSettings(navigators=[]))
    said = [o for batch in batches(200) for o in pipeline.on(IMU, batch) if o.topic is ATTITUDE]
    assert {o.estimator for o in said} == set(NAMES)
    assert len(said) == 100 * len(NAMES)  # 100 Hz in, 50 Hz out
    for output in said[-len(NAMES) :]:
        message = output.message
        up = to_matrix(np.array(message.q_nb))[2]
        np.testing.assert_allclose(up, [0.0, np.sin(0.3), np.cos(0.3)], atol=1e-3)
        assert not message.heading_known
        assert message.header.device == "board"
        assert message.header.device_us == message.for_index * 10_000


def test_same_samples_same_bytes():
    def once():
        pipeline = Pipeline(EstimatorSettings(navigators=[]))
        outputs = [o for batch in batches(300) for o in pipeline.on(IMU, batch)]
        return [
            o.message.SerializeToString(deterministic=True) for o in outputs if o.topic is ATTITUDE
        ]

    assert once() == once() != []


@pytest.mark.parametrize("samples", [0, 3, 150])
@pytest.mark.parametrize("name", NAMES)
def test_a_filter_goes_on_from_its_saved_state_to_the_bit(name, samples):
    draw = np.random.default_rng(5)
    f, w = draw.normal(size=(400, 3)) + [0.0, 0.0, -G], draw.normal(size=(400, 3)) * 0.3
    whole = ATTITUDES[name](0.01)
    for k in range(samples):
        whole.step(f[k], w[k])
    restored = pickle.loads(pickle.dumps(whole))
    for k in range(samples, 400):
        one, other = whole.step(f[k], w[k]), restored.step(f[k], w[k])
        np.testing.assert_array_equal(one.q_nb, other.q_nb)
        np.testing.assert_array_equal(one.bias_omega_b, other.bias_omega_b)
        assert one.resting == other.resting


def test_a_short_gap_is_bridged_and_a_long_one_starts_anew(caplog):
    board = AttitudeBoard("board", NAMES, 100.0)
    f, _ = tipped(100, 0.0)
    turning = np.tile([1.0, 0.0, 0.0], (100, 1))  # 1 rad/s of roll that the accelerometer denies
    board.feed(1, 0, 0.01, f, np.zeros((100, 3)))
    before = board.filters["tilt-vector"]
    board.feed(1, 100, 0.01, f[:10], turning[:10])
    said = board.feed(
        1, 120, 0.01, f[:1], turning[:1]
    )  # ten lost: 0.1 rad in all, but for the accelerometer's pull
    assert board.filters["tilt-vector"] is before
    tilt = {o.estimator: np.arccos(to_matrix(o.state.q_nb)[2, 2]) for o in said}
    assert 0.19 < tilt["tilt-vector"] < 0.21
    board.feed(1, 200, 0.01, f[:1], turning[:1])
    assert board.filters["tilt-vector"] is not before
    assert "0.79 s without samples" in caplog.text


def test_a_reboot_or_another_rate_starts_anew():
    board = AttitudeBoard("board", NAMES, 100.0)
    f, w = tipped(10, 0.0)
    board.feed(1, 0, 0.01, f, w)
    first = board.filters["vqf"]
    board.feed(1, 10, 0.01, f, w)
    assert board.filters["vqf"] is first
    board.feed(1, 20, 0.005, f, w)
    second = board.filters["vqf"]
    assert second is not first
    board.feed(2, 0, 0.005, f, w)
    assert board.filters["vqf"] is not second
