"""A calibration file on the live path: readings are corrected before the estimators, and every
estimate names it.
"""

import pickle

import numpy as np
import pytest

from estimator.choice import UnknownEstimator
from estimator.pipeline import Pipeline
from estimator.settings import EstimatorSettings
from inertial.calibration.card import make_card, write_card
from inertial.calibration.fit import fit
from inertial.calibration.poses import collect, find, plan
from inertial.layouts.catalogue import find as find_layout
from inertial.simulation.imperfect import device, table_run, tumble
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import ACCEL, CALIBRATION, RATE, TACHO

CUBE = find_layout("cube", 0.05)
DATE = "2026-01-02T03:04:05Z"


def batches(readings, name="cube", size=10):
    """Readings (n, 12) in m/s^2 as the gateway sends them, at 100 Hz."""
    for number, first in enumerate(range(0, len(readings) - size + 1, size)):
        utc = 1_767_323_045_000_000_000 + first * 10_000_000
        header = pb.Header(device=name, sequence=number + 1, device_us=first * 10_000, utc_ns=utc)
        flat = readings[first : first + size].ravel().tolist()
        yield pb.AccelBatch(header=header, first_index=first, period_s=0.01, axes=12, f_mps2=flat)


@pytest.fixture(scope="module")
def bench():
    """An imperfect cube and the card that fourteen poses give."""
    one = device(CUBE, 11)
    readings = tumble(one, plan(14))
    found, noise = find(readings, 0.01)
    solved = fit(CUBE, collect(readings, found), noise=noise)
    return one, make_card(solved, CUBE, CUBE.axis_names, device="cube", date=DATE, poses=len(found))


def estimates(pipeline, readings):
    return [
        out.message
        for batch in batches(readings)
        for out in pipeline.on(ACCEL, batch)
        if out.topic is RATE
    ]


def test_every_estimate_names_its_card_and_uses_it(bench, tmp_path):
    one, card = bench
    path = tmp_path / "cube.toml"
    write_card(card, path)
    run = table_run(one, profile="still", seconds=1.5)
    plain = estimates(Pipeline(EstimatorSettings(rate=["products-ekf"])), run.readings)
    used = estimates(
        Pipeline(EstimatorSettings(rate=["products-ekf"], calibrations={"cube": path})),
        run.readings,
    )
    assert {message.calibration for message in plain} == {""}
    assert {message.calibration for message in used} == {card.id}
    # at rest, before the estimator has found any bias of its own, angular acceleration is what the
    # axes are off by
    before, after = (
        np.linalg.norm(np.mean([m.alpha_b_radps2 for m in said[:15]], axis=0))
        for said in (plain, used)
    )
    assert after < 0.35 < 1.0 < before


def test_a_wrong_card_is_refused_at_the_start_or_at_the_first_batch(bench, tmp_path):
    with pytest.raises(UnknownEstimator, match=r"calibration: .*absent"):
        Pipeline(EstimatorSettings(calibration=tmp_path / "absent.toml"))
    path = tmp_path / "cube.toml"
    write_card(bench[1], path)
    pipeline = Pipeline(EstimatorSettings(calibration=path, layout={"kind": "edges-12"}))
    with pytest.raises(ValueError, match="is for layout cube"):
        pipeline.on(ACCEL, next(batches(np.zeros((10, 12)))))


def order(pipeline, action, card=""):
    command = pb.EstimatorCommand(
        action=getattr(pb.EstimatorCommand, f"ACTION_{action}"), device="cube", card=card
    )
    return pipeline.order(command)


def test_guided_by_orders_saved_and_used(bench, tmp_path):
    """Start, nine poses, fit, save: the status tells each step, the card is in the folder and in
    every estimate.
    """
    one, _ = bench
    pipeline = Pipeline(EstimatorSettings(rate=["products-ekf"], cards=tmp_path / "cards"))
    reply, out = order(pipeline, "CALIBRATE_START")
    assert not reply.ok and "no accelerometer samples yet" in reply.message and not out
    readings = tumble(one, plan(9))
    messages = list(batches(np.vstack([readings, readings[-300:]])))
    pipeline.on(ACCEL, messages[0])
    reply, out = order(pipeline, "CALIBRATE_FIT")
    assert not reply.ok and "start one first" in reply.message
    reply, out = order(pipeline, "CALIBRATE_START")
    assert (
        reply.ok
        and out[0].message.next_up_b == [0.0, 0.0, 1.0]
        and "+z face up" in out[0].message.instruction
    )
    states, last = set(), None
    for message in messages[1 : len(readings) // 10]:
        for one_out in pipeline.on(ACCEL, message):
            if one_out.topic is CALIBRATION:
                last = one_out.message
                states.add(last.state)
    assert {pb.CalibrationStatus.STATE_WAITING, pb.CalibrationStatus.STATE_TAKING} <= states
    assert len(last.poses) == 9 and last.good_enough and max(last.bias_sigma_mps2) < 0.01
    pipeline.on(TACHO, pb.TachoRate(header=messages[-1].header, omega_radps=0.0))
    reply, out = order(pipeline, "CALIBRATE_FIT")
    assert (
        reply.ok
        and "9 poses" in reply.message
        and out[0].message.state == pb.CalibrationStatus.STATE_FITTED
    )
    reply, out = order(pipeline, "CALIBRATE_SAVE")
    card = out[0].message.card
    assert (
        reply.ok
        and out[0].message.state == pb.CalibrationStatus.STATE_SAVED
        and card in reply.message
    )
    assert (tmp_path / "cards" / f"{card}.toml").is_file()
    used = [o.message for m in messages[-20:] for o in pipeline.on(ACCEL, m) if o.topic is RATE]
    assert {message.calibration for message in used} == {card}
    assert order(pipeline, "USE_CARD")[0].ok
    assert not order(pipeline, "USE_CARD", "../x")[0].ok
    assert not order(pipeline, "USE_CARD", "cube-20200101-00000000")[0].ok
    assert order(pipeline, "USE_CARD", card)[0].ok and order(pipeline, "CALIBRATE_CANCEL")[0].ok
    assert not pipeline.order(pb.EstimatorCommand(device="cube"))[0].ok


def test_a_saved_state_goes_on_with_a_calibration(bench, tmp_path):
    pipeline = Pipeline(EstimatorSettings(rate=["products-ekf"], cards=tmp_path))
    messages = list(batches(tumble(bench[0], plan(6)[:2])))
    pipeline.on(ACCEL, messages[0])
    order(pipeline, "CALIBRATE_START")
    for message in messages[1:60]:
        pipeline.on(ACCEL, message)
    pipeline = pickle.loads(pickle.dumps(pipeline))
    said = [
        o.message for m in messages[60:] for o in pipeline.on(ACCEL, m) if o.topic is CALIBRATION
    ]
    assert len(said[-1].poses) == 2
