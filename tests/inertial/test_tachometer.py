"""The tachometer as an aid: off unless asked for, at its own time, named in all that it touched."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from estimator.pipeline import Pipeline
from estimator.settings import EstimatorSettings
from gyrofree.commands.main import app
from gyrofree.running import simulate_csv
from inertial.rate.beliefs import Beliefs, make
from inertial.rate.estimators import ESTIMATORS, LeastSquaresRate, ProductsRate
from inertial.simulation.profiles import TURNING
from inertial.simulation.table import TableTest
from logs.cube import run_cube
from logs.sheet import LogError
from messages.contract import gyrofree_pb2 as pb
from messages.contract.rates import rows
from messages.contract.topics import ACCEL, ESTIMATOR, RATE, TACHO

EVERY = 5  # samples between reports, 20 Hz


def run(estimator, table, seconds, signed=True, factor=1.0, aid=True):
    """Rates (n, 3) and states; a report is the mean rate since the one before, 10 ms late."""
    block = [table.block(k) for k in range(int(np.ceil(seconds / 10.0)))]
    t_s, readings, omega = (
        np.concatenate([getattr(b, k) for b in block]) for k in ("t_s", "readings", "omega_b")
    )
    states = []
    for k in range(round(seconds / 0.01)):
        states.append(estimator.step(k, t_s[k], readings[k]))
        if aid and k % EVERY == 0 and k > EVERY:
            rate = omega[k - 1 - EVERY : k - 1, 2].mean() * factor
            estimator.tacho(t_s[k - 1], rate if signed else abs(rate), 0.01, signed)
    return states, omega[: len(states)]


def rms_z(states, omega, since=0):
    said = np.array([s.omega_b[2] for s in states])
    return np.rad2deg(np.sqrt(np.mean((said - omega[:, 2])[since:] ** 2)))


def test_slow_turns_are_followed_with_the_aid_and_it_is_named():
    table = TableTest(1, profile="slow")
    alone, omega = run(ProductsRate(table.layout), table, 20.0, aid=False)
    aided, _ = run(ProductsRate(table.layout), table, 20.0)
    assert rms_z(aided, omega) < 1.2 < 1.4 < rms_z(alone, omega)
    assert alone[-1].aid == "" and aided[-1].aid == "tachometer" and "aided" in aided[-1].phase
    sizes, _ = run(ProductsRate(table.layout), table, 20.0, signed=False)
    assert rms_z(sizes, omega) < 2.0


def test_a_signed_report_decides_the_sign_of_a_start_while_turning():
    table = TableTest(8, profile=TURNING)
    states, omega = run(ProductsRate(table.layout), table, 3.0)
    assert rms_z(states, omega, since=70) < 3.0


def test_reports_that_contradict_or_come_too_late_change_nothing():
    table = TableTest(1)
    good, _ = run(ProductsRate(table.layout), table, 9.0, aid=False)
    lied, _ = run(ProductsRate(table.layout), table, 9.0, factor=-3.0)
    assert np.abs(good[-1].omega_b - lied[-1].omega_b).max() < np.deg2rad(1.0)
    estimator = ProductsRate(table.layout)
    for k in range(600):
        estimator.step(k, 0.01 * k, table.block(0).readings[k])
    for t_s in (0.1, 0.2, 0.3):
        estimator.tacho(t_s, 1.0, 0.01)
    assert estimator.step(600, 6.0, table.block(0).readings[600]).aid == ""
    with pytest.raises(ValueError, match="sigma > 0"):
        estimator.tacho(6.1, 1.0, 0.0)


def test_the_axis_of_the_tachometer_is_what_the_layout_says():
    table = TableTest(1)
    estimator = make(
        ESTIMATORS["products-ekf"], table.layout, None, Beliefs(tacho_axis_b=(0.0, 0.0, -2.0))
    )
    states, omega = run(estimator, table, 9.0, factor=-1.0)
    assert states[-1].aid == "tachometer" and rms_z(states, omega) < 0.6
    with pytest.raises(ValueError, match="not all zero"):
        estimator.tacho_axis((0.0, 0.0, 0.0))


def test_the_published_way_takes_no_aid():
    table = TableTest(1)
    assert run(LeastSquaresRate(table.layout), table, 6.0)[0][-1].aid == ""


def messages(table, n=160):
    """Batches of five samples, and a report of the tachometer after each."""
    block, utc = table.block(0), 1_767_323_045_000_000_000
    for k in range(n):
        rows = slice(k * 5, k * 5 + 5)
        at = pb.Header(
            device="cube", sequence=k + 1, device_us=k * 50_000, utc_ns=utc + k * 50_000_000
        )
        yield (
            ACCEL,
            pb.AccelBatch(
                header=at,
                first_index=k * 5,
                period_s=0.01,
                axes=12,
                f_mps2=block.readings[rows].ravel().tolist(),
            ),
        )
        said = pb.Header(device="cube", sequence=k + 1, device_us=k * 50_000 + 40_000, utc_ns=utc)
        rate = float(block.omega_b[rows, 2].mean())
        yield (
            TACHO,
            pb.TachoRate(header=said, omega_radps=rate, sigma_radps=0.01, direction_known=True),
        )


def published(**options):
    pipeline = Pipeline(EstimatorSettings(rate=["products-ekf"], **options), clock=lambda: 0)
    said = [o for topic, message in messages(TableTest(2)) for o in pipeline.on(topic, message)]
    return [one for o in said if o.topic is RATE for one in rows(o.message)], [
        o.message for o in said if o.topic is ESTIMATOR
    ]


def test_the_live_path_is_aided_only_when_configured_and_replays_the_same_bits():
    alone, _ = published()
    aided, status = published(tacho_aid=True)
    again, _ = published(tacho_aid=True)
    assert {m.aid for m in alone} == {""} and aided[-1].aid == "tachometer"
    assert "aided by the tachometer" in status[-1].state
    assert [m.SerializeToString() for m in aided] == [m.SerializeToString() for m in again]
    assert alone[-1].omega_ib_b_radps != aided[-1].omega_ib_b_radps


def test_the_earths_rate_is_reachable_from_the_configuration():
    (turning, _), (still, _) = published(latitude_deg=48.0), published()
    earth = np.array(turning[400].omega_ib_b_radps) - np.array(still[400].omega_ib_b_radps)
    assert np.linalg.norm(earth) == pytest.approx(7.292115e-5, rel=0.1)


def test_an_aided_run_of_a_log_is_named_and_not_scored_against_its_tachometer(tmp_path):
    log = tmp_path / "log.csv"
    simulate_csv.write(log, "cw-ccw", 3)
    aided = run_cube(log, estimators=["products-ekf"], tacho_aid=True)
    entry = aided["estimators"]["products-ekf+tacho"]
    assert aided["default"] == "products-ekf+tacho" and "products-ekf" not in aided["estimators"]
    assert entry["rate_rms_radps"][2] < np.deg2rad(1.5) and any(
        "aided" in note for note in aided["notes"]
    )
    rows = [line.split(",") for line in log.read_text().splitlines() if not line.startswith("#")]
    keep = [k for k, name in enumerate(rows[0]) if not name.startswith("true_")]
    log.write_text("\n".join(",".join(row[k] for k in keep) for row in rows) + "\n")
    said = CliRunner().invoke(
        app, ["run", str(log), "--estimators", "products-ekf", "--tacho-aid", "--json"]
    )
    result = json.loads(said.stdout)
    assert result["estimators"]["products-ekf+tacho"]["rate_rms_radps"] == [None] * 3
    assert any("not scored" in note for note in result["notes"])
    bare = [k for k, name in enumerate(rows[0]) if not name.startswith(("true_", "tacho"))]
    log.write_text("\n".join(",".join(row[k] for k in bare) for row in rows) + "\n")
    with pytest.raises(LogError, match="no column tacho_rad_s"):
        run_cube(log, tacho_aid=True)
