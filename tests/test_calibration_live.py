"""A calibration card on the live path: readings are corrected before the estimators, and every estimate names it."""

import numpy as np
import pytest

from estimator.calibration.card import make_card, write_card
from estimator.calibration.fit import fit
from estimator.calibration.poses import collect, find, plan
from estimator.layouts.catalogue import find as find_layout
from estimator.service import Pipeline, UnknownEstimator
from estimator.settings import EstimatorSettings
from estimator.simulation.imperfect import device, table_run, tumble
from messages import gyrofree_pb2 as pb
from messages.topics import ACCEL, RATE

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
    return [out.message for batch in batches(readings) for out in pipeline.on(ACCEL, batch) if out.topic is RATE]


def test_every_estimate_names_its_card_and_uses_it(bench, tmp_path):
    one, card = bench
    path = tmp_path / "cube.toml"
    write_card(card, path)
    run = table_run(one, profile="still", seconds=1.5)
    plain = estimates(Pipeline(EstimatorSettings(rate=["products-ekf"])), run.readings)
    used = estimates(Pipeline(EstimatorSettings(rate=["products-ekf"], calibrations={"cube": path})), run.readings)
    assert {message.calibration for message in plain} == {""}
    assert {message.calibration for message in used} == {card.id}
    # at rest, before the estimator has found any bias of its own, angular acceleration is what the axes are off by
    before, after = (np.linalg.norm(np.mean([m.alpha_b_radps2 for m in said[:15]], axis=0)) for said in (plain, used))
    assert after < 0.35 < 1.0 < before


def test_a_wrong_card_is_refused_at_the_start_or_at_the_first_batch(bench, tmp_path):
    with pytest.raises(UnknownEstimator, match=r"calibration: .*absent"):
        Pipeline(EstimatorSettings(calibration=tmp_path / "absent.toml"))
    path = tmp_path / "cube.toml"
    write_card(bench[1], path)
    pipeline = Pipeline(EstimatorSettings(calibration=path, layout={"kind": "edges-12"}))
    with pytest.raises(ValueError, match="is for layout cube"):
        pipeline.on(ACCEL, next(batches(np.zeros((10, 12)))))
