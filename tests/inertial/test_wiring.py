"""Guided axis detection: a board of any wiring is turned by hand, found, saved and used; its
attitude is then right.
"""

import itertools
import pickle

import numpy as np
import pytest

from estimator.choice import UnknownEstimator
from estimator.pipeline import Pipeline
from estimator.settings import EstimatorSettings
from inertial.attitude.axis_map import AXES, MapError, read_map
from inertial.rotation import to_matrix
from inertial.simulation.hand import GUIDED, AnalogueWiring, guided, misread
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import ADC, ATTITUDE, IMU, WIRING

STATUS = pb.WiringStatus
BATCH = 10


def header(k, name="board"):
    utc = 1_767_323_045_000_000_000 + k * 10_000_000
    return pb.Header(
        device=name, sequence=k // BATCH + 1, epoch=1, device_us=k * 10_000, utc_ns=utc
    )


def imu_batches(force, rate, first=0):
    for k in range(0, len(force), BATCH):
        yield (
            IMU,
            pb.ImuBatch(
                header=header(first + k),
                first_index=first + k,
                period_s=0.01,
                f_b_mps2=force[k : k + BATCH].ravel().tolist(),
                omega_ib_b_radps=rate[k : k + BATCH].ravel().tolist(),
            ),
        )


def adc_batches(counts, wiring, first=0):
    for k in range(0, len(counts), BATCH):
        yield (
            ADC,
            pb.AdcBatch(
                header=header(first + k),
                first_index=first + k,
                period_s=0.01,
                channels=wiring.channels,
                counts=counts[k : k + BATCH].ravel().tolist(),
                volt_per_count=wiring.vref / (2**wiring.bits - 1),
                channel_mask=2**wiring.channels - 1,
                zero_g_v=wiring.zero_g,
                zero_rate_v=wiring.zero_rate,
                accel_v_per_mps2=wiring.per_g / 9.80665,
                gyro_v_per_radps=np.degrees(wiring.per_dps),
            ),
        )


def order(pipeline, action, card=""):
    command = pb.EstimatorCommand(
        action=getattr(pb.EstimatorCommand, f"ACTION_{action}"), device="board", card=card
    )
    return pipeline.order(command)


def fed(pipeline, batches):
    return [o for topic, message in batches for o in pipeline.on(topic, message)]


def detect(pipeline, batches):
    """Start at the first batch and feed the rest; the statuses on the way."""
    batches = list(batches)
    fed(pipeline, batches[:1])
    reply, _ = order(pipeline, "WIRING_START")
    assert reply.ok, reply.message
    return [o.message for o in fed(pipeline, batches[1:]) if o.topic is WIRING]


def tilt_errors(outputs, truth, first=0):
    """Angle between the vertical of each estimate and the true one, rad."""
    out = []
    for o in outputs:
        if o.topic is ATTITUDE:
            up = to_matrix(np.array(o.message.q_nb))[2]
            out.append(
                np.arccos(np.clip(up @ to_matrix(truth[o.message.for_index - first])[2], -1.0, 1.0))
            )
    return np.array(out)


def settings(tmp_path, **more):
    return EstimatorSettings(navigators=[], attitudes=["vqf"], axes=tmp_path / "axes", **more)


def test_an_imu_with_swapped_and_flipped_axes_is_found_and_put_right(tmp_path):
    force, rate, truth = guided(3)
    wrong = misread(force, (1, 2, 0), (-1, 1, -1)), misread(rate, (2, 0, 1), (1, -1, 1))
    pipeline = Pipeline(settings(tmp_path))
    said = detect(pipeline, imu_batches(*wrong))
    last = said[-1]
    assert last.state == STATUS.STATE_FOUND and last.complete and last.progress == 1.0
    found = {entry.name: (entry.axis, entry.inverted) for entry in last.inputs}
    assert found == {
        "force x": ("force y", True),
        "force y": ("force z", False),
        "force z": ("force x", True),
        "rate x": ("rate z", False),
        "rate y": ("rate x", True),
        "rate z": ("rate y", False),
    }
    assert [turn.about for turn in last.turns] == ["y", "x", "z"]
    for turn in last.turns:
        assert turn.by_rate_rad == pytest.approx(np.pi / 2, abs=0.3)
    assert {m.pose for m in said} == {
        STATUS.POSE_LEVEL,
        STATUS.POSE_NOSE_UP,
        STATUS.POSE_RIGHT_DOWN,
        STATUS.POSE_TURNED_RIGHT,
    }
    reply, out = order(pipeline, "WIRING_SAVE")
    assert reply.ok and out[0].message.state == STATUS.STATE_SAVED, reply.message
    saved = out[0].message.map
    # the board is picked up again, elsewhere: the filters get b
    force, rate, truth = guided(8, ("level", "right down", "level", "nose up"))
    wrong = misread(force, (1, 2, 0), (-1, 1, -1)), misread(rate, (2, 0, 1), (1, -1, 1))
    errors = tilt_errors(fed(pipeline, imu_batches(*wrong, first=10_000)), truth, 10_000)
    assert len(errors) > 800 and np.sqrt(np.mean(errors**2)) < np.radians(1.5)
    plain = tilt_errors(fed(Pipeline(settings(tmp_path)), imu_batches(*wrong)), truth)
    assert np.sqrt(np.mean(plain**2)) > np.radians(45.0)
    # and after a restart by the settings
    path = tmp_path / "axes" / f"{saved}.toml"
    again = Pipeline(settings(tmp_path, axis_maps={"board": path}))
    assert tilt_errors(fed(again, imu_batches(*wrong)), truth) == pytest.approx(errors, abs=0.05)


@pytest.mark.parametrize("seed", range(4))
def test_an_analogue_board_of_any_wiring_is_found_and_put_right(tmp_path, seed):
    """Also with inputs that nothing is attached to; the gateway's own idea of the wiring does not
    matter.
    """
    draw = np.random.default_rng(seed)
    channels = 5 + seed % 3
    wiring = AnalogueWiring(
        tuple(draw.permutation(channels)[:5].tolist()),
        tuple(draw.choice([-1, 1], 5).tolist()),
        channels,
    )
    force, rate, _ = guided(seed, GUIDED[:5])
    pipeline = Pipeline(settings(tmp_path))
    last = detect(pipeline, adc_batches(wiring.counts(force, rate), wiring))[-1]
    assert last.complete, last.instruction
    axes = dict(
        zip(("force x", "force y", "force z", "rate y", "rate x"), wiring.inputs, strict=True)
    )
    assert {entry.axis: int(entry.name.split()[1]) for entry in last.inputs if entry.axis} == axes
    reply, out = order(pipeline, "WIRING_SAVE")
    assert reply.ok, reply.message
    force, rate, truth = guided(seed + 20, ("level", "right down", "level", "nose up"))
    rate[:, 2] = 0.0
    said = fed(pipeline, adc_batches(wiring.counts(force, rate), wiring, first=10_000))
    errors = tilt_errors(said, truth, 10_000)
    assert len(errors) > 800 and np.sqrt(np.mean(errors**2)) < np.radians(2.0)
    # what the gateway makes of the counts by a wrong wiring is left out now
    assert not [
        o for o in fed(pipeline, imu_batches(force, rate, first=30_000)) if o.topic is ATTITUDE
    ]
    assert order(pipeline, "USE_MAP")[0].ok
    assert [o for o in fed(pipeline, imu_batches(force, rate, first=40_000)) if o.topic is ATTITUDE]
    toml = read_map(tmp_path / "axes" / f"{out[0].message.map}.toml").gateway_toml()
    for name, channel, sign in zip(
        ("accel_x", "accel_y", "accel_z", "gyro_xz", "gyro_yz"),
        wiring.inputs,
        wiring.signs,
        strict=True,
    ):
        assert f"{name} = {{ channel = {channel}, invert = {str(sign < 0).lower()} }}" in toml


def test_a_movement_that_tells_nothing_is_asked_for_again(tmp_path):
    poses = ("level", "nose up", "level", "nose up", "level", "right down", "level", "turned right")
    force, rate, _ = guided(5, poses)
    said = detect(Pipeline(settings(tmp_path)), imu_batches(force, rate))
    assert any("same input" in m.message or "want three" in m.message for m in said)
    assert said[-1].state != STATUS.STATE_FOUND  # both turns are asked for again
    still, rest, _ = guided(5, ("level", "level", "level"))
    last = detect(Pipeline(settings(tmp_path)), imu_batches(still, rest))[-1]
    assert (
        last.pose == STATUS.POSE_NOSE_UP
        and last.state == STATUS.STATE_WAITING
        and not last.complete
    )


def test_a_flat_turn_that_tilts_and_a_turn_about_two_edges_are_refused(tmp_path):
    force, rate, _ = guided(6, (*GUIDED[:5], "nose up", "level", "turned right"))
    said = detect(Pipeline(settings(tmp_path)), imu_batches(force, rate))
    assert any("it tilted" in m.message for m in said) and said[-1].state == STATUS.STATE_FOUND


def test_an_input_that_never_rests_is_left_out_and_a_board_that_moves_is_waited_for(tmp_path):
    wiring = AnalogueWiring((6, 1, 0, 2, 3), channels=7)
    force, rate, _ = guided(
        4, ("right down", "level", "nose up", *GUIDED[:5]), rest_s=1.5, move_s=1.5
    )
    still, rest, _ = guided(4, ("level",), rest_s=6.0)
    counts = wiring.counts(np.vstack([still, force]), np.vstack([rest, rate]))
    counts[:, 4] += np.random.default_rng(1).integers(
        -300, 300, len(counts)
    )  # hum on an open input
    said = detect(Pipeline(settings(tmp_path)), adc_batches(counts, wiring))
    assert [entry.name for entry in said[-1].inputs if entry.unused] == ["input 4"]
    assert any("input 4: never quiet" in m.message for m in said)
    moving = detect(
        Pipeline(settings(tmp_path)),
        adc_batches(wiring.counts(force[150:450], rate[150:450]), wiring),
    )
    assert not any(entry.unused for m in moving for entry in m.inputs)


def test_lost_samples_spoil_only_the_movement_under_way(tmp_path):
    force, rate, _ = guided(
        7, ("level", "nose up", "level", "nose up", "level", "right down", "level", "turned right")
    )
    batches = list(imu_batches(force, rate))
    lost = [b for k, b in enumerate(batches) if not 50 <= k < 54]  # in the middle of the first turn
    said = detect(Pipeline(settings(tmp_path)), lost)
    assert (
        any("samples were lost" in m.message for m in said) and said[-1].state == STATUS.STATE_FOUND
    )


def test_orders_out_of_turn_are_refused_with_what_to_do(tmp_path):
    pipeline = Pipeline(settings(tmp_path))
    assert "connect the board first" in order(pipeline, "WIRING_START")[0].message
    assert "start one first" in order(pipeline, "WIRING_SAVE")[0].message
    force, rate, _ = guided(1, ("level",))
    fed(pipeline, imu_batches(force, rate))
    assert order(pipeline, "WIRING_START")[0].ok
    assert "not every axis is found yet" in order(pipeline, "WIRING_SAVE")[0].message
    assert (
        not order(pipeline, "USE_MAP", "../x")[0].ok
        and not order(pipeline, "USE_MAP", "board-axes-1")[0].ok
    )
    assert order(pipeline, "WIRING_CANCEL")[0].ok
    with pytest.raises(UnknownEstimator, match="axis_maps: .*absent"):
        Pipeline(settings(tmp_path, axis_maps={"board": tmp_path / "absent.toml"}))


def test_a_crash_in_the_middle_changes_nothing(tmp_path):
    force, rate, _ = guided(9)
    batches = list(imu_batches(force, rate))
    whole, pipeline = Pipeline(settings(tmp_path)), Pipeline(settings(tmp_path))
    straight = detect(whole, batches)
    first = detect(pipeline, batches[:90])
    second = [
        o.message
        for o in fed(pickle.loads(pickle.dumps(pipeline)), batches[90:])
        if o.topic is WIRING
    ]
    assert [m.SerializeToString() for m in first + second] == [
        m.SerializeToString() for m in straight
    ]


def test_maps_are_refused_when_they_are_none(tmp_path):
    path = tmp_path / "map.toml"
    for text in (
        "version = 1",
        "version = 7",
        "=",
        'version = 1\nid = ""\ndevice = ""\ndate = ""\nsource = "imu"\ninputs = ["a"]\naxes = []',
    ):
        path.write_text(text)
        with pytest.raises(MapError, match=r"map\.toml"):
            read_map(path)
    assert len(AXES) == 6 and len(list(itertools.permutations(AXES, 2))) == 30
