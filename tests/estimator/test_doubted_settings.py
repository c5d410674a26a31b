"""A wrong setting is said by the running estimator: gateway's tachometer, messages, status."""

import numpy as np
import pytest

from estimator.pipeline import Pipeline
from estimator.settings import EstimatorSettings
from gateway.samples.tacho import Tachometer
from inertial.layouts.catalogue import CUBE
from inertial.simulation.imperfect import STEPS, device, table_run
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import ACCEL, ESTIMATOR, TACHO

SECONDS = 20.0
TRULY = 360


def batches(readings, size=10):
    """Readings (n, 12), m/s^2, as the gateway sends them, at 100 Hz."""
    for number, first in enumerate(range(0, len(readings) - size + 1, size)):
        header = pb.Header(device="cube", sequence=number + 1, device_us=first * 10_000)
        flat = readings[first : first + size].ravel().tolist()
        yield pb.AccelBatch(header=header, first_index=first, period_s=0.01, axes=12, f_mps2=flat)


def said(settings, *, pulses=TRULY, scale=1.0, source=tuple(range(12))):
    """Messages of the newest status of each estimator, after a run on the table."""
    run = table_run(device(CUBE(0.05), 2), profile=STEPS, seconds=SECONDS)
    pipeline, tacho = Pipeline(settings), Tachometer(pulses)
    edges = pulses_of(run, TRULY)
    newest, at = {}, 0
    for batch in batches(run.readings[:, list(source)] * scale):
        for out in pipeline.on(ACCEL, batch):
            if out.topic is ESTIMATOR:
                newest[out.estimator] = out.message.message
        now_us = batch.header.device_us + 100_000
        while at < len(edges) and edges[at][0] <= now_us:
            tacho.add([edges[at][0]], True, edges[at][1])
            at += 1
        if (rate := tacho.rate(now_us)) is not None:
            header = pb.Header(device="cube", device_us=round(rate.device_us))
            message = pb.TachoRate(
                header=header,
                omega_radps=rate.omega_radps,
                sigma_radps=rate.sigma_radps,
                pulses=tacho.pulses,
                direction_known=True,
            )
            pipeline.on(TACHO, message)
    return newest


def pulses_of(run, per_rev):
    """Times (us) of the disc's edges and whether it turns backwards."""
    rate = run.omega_b[:, 2]
    angle = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * 0.01)])
    mark = np.floor(angle / (2.0 * np.pi) * per_rev).astype(int)
    edges = []
    for k in np.nonzero(np.diff(mark))[0]:
        n = abs(int(mark[k + 1] - mark[k]))
        for j in range(n):
            edges.append((float(run.t_s[k] + 0.01 * (j + 0.5) / n) * 1e6, bool(rate[k] < 0.0)))
    return edges


SETTINGS = EstimatorSettings(rate=["products-ekf", "least-squares"])


def test_right_settings_are_not_doubted():
    assert set(said(SETTINGS).values()) == {""}


@pytest.mark.parametrize(
    ("settings", "given", "words"),
    [
        (SETTINGS, {"pulses": 100}, ("3.6 at every rate", "360 would fit, 100 is set")),
        (SETTINGS, {"scale": 1 / 9.80665}, ("counts or g?", "9.81 times")),
        (
            EstimatorSettings(rate=["products-ekf"], layout={"half_side_m": 0.1}),
            {},
            ("half side", "50", "100 is set"),
        ),
        (SETTINGS, {"source": (0, 2, 1, *range(3, 12))}, ("a12 and a13 exchanged would fit",)),
    ],
    ids=["pulses", "scale", "half side", "axes"],
)
def test_a_wrong_setting_is_said_once(settings, given, words):
    messages = said(settings, **given)
    (message,) = [text for text in messages.values() if text]
    assert message.startswith("settings: ")
    for word in words:
        assert word in message
