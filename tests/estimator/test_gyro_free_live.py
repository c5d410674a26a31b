"""A cube with a receiver navigates live: an arm that turns fast, through the pipeline's messages,
twice the same.
"""

import pickle

import numpy as np
import pytest
from support.gyro_free_rig import (
    COS,
    LATITUDE,
    LONGITUDE,
    METRES,
    SETTINGS,
    heading_error,
    messages,
)

from estimator.choice import UnknownEstimator
from estimator.pipeline import Pipeline
from estimator.settings import EstimatorSettings
from inertial.simulation.arm import ARM, arm_test, centre
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import GNSS, INNOVATION, NAV


def test_the_arm_and_its_centre_belong_together():
    test, h = arm_test(1), 1e-4
    for t in (20.0, 33.3, 60.0):
        (before, _), (after, _), (_, v) = centre(test, t - h), centre(test, t + h), centre(test, t)
        np.testing.assert_allclose((after - before) / (2 * h), v, atol=1e-4)
        angle = float(test.profile.motion(np.array([t]))[0][0])
        ahead = np.array([np.cos(angle), -np.sin(angle), 0.0])  # x_b in n: the way it goes
        assert v @ ahead == pytest.approx(np.linalg.norm(v))
    assert ARM.seconds == pytest.approx(96.0)


def said_by(pipeline, sent):
    return [o for topic, message in sent for o in pipeline.on(topic, message)]


def test_a_cube_on_an_arm_navigates_without_gyros():
    """One fix in two is held back and met within the receiver's own noise; sigma is honest; the
    heading stays.
    """
    test, sent = messages(40.0)
    said = said_by(Pipeline(EstimatorSettings(**SETTINGS)), sent)
    nav = [o.message for o in said if o.topic is NAV]
    assert {m.estimator for m in nav} == {"gyro-free-huber"}
    assert nav[-1].mode == pb.NavSolution.MODE_NAVIGATING
    errors, sigma = [], []
    for m in (m for m in nav if m.header.device_us > 25e6):
        t = m.header.device_us * 1e-6
        p, v = centre(test, t)
        at = (m.latitude_deg - LATITUDE) * METRES, (m.longitude_deg - LONGITUDE) * METRES * COS
        errors.append([*(at - p[:2]), *(m.v_n_mps - v)[:2], heading_error(test, t, m.q_nb)])
        sigma.append(m.sigma[6])
    rms = np.sqrt(np.mean(np.square(errors), axis=0))
    assert np.hypot(rms[0], rms[1]) < 0.6  # m
    assert np.hypot(rms[2], rms[3]) < 1.2  # m/s, of 3.7 to 6.8 m/s
    assert rms[4] < np.radians(20.0)
    assert 0.3 < rms[0] / np.mean(sigma) < 3.0
    unseen = [
        o.message for o in said if o.topic is INNOVATION and len(o.message.error_to_reference)
    ]
    assert len(unseen) > 20


def test_the_same_messages_give_the_same_bytes_also_after_a_crash():
    _, sent = messages(30.0)

    def told(outputs):
        wanted = [o for o in outputs if o.topic in (NAV, INNOVATION)]
        return [o.message.SerializeToString(deterministic=True) for o in wanted]

    whole = told(said_by(Pipeline(EstimatorSettings(**SETTINGS)), sent))
    pipeline = Pipeline(EstimatorSettings(**SETTINGS))
    first = told(said_by(pipeline, sent[:230]))
    again = told(said_by(pickle.loads(pickle.dumps(pipeline)), sent[230:]))
    assert whole == first + again and len(whole) > 300


def test_fixes_can_be_muted():
    _, sent = messages(10.0)
    pipeline = Pipeline(EstimatorSettings(**SETTINGS))
    order = pb.EstimatorCommand(
        action=pb.EstimatorCommand.ACTION_MUTE_GNSS, device="cube", seconds=5.0
    )
    assert not pipeline.order(order)[0].ok
    said_by(pipeline, sent[:30])
    assert pipeline.order(order)[0].ok
    nav = [o.message for o in said_by(pipeline, sent[30:60]) if o.topic is NAV]
    assert nav and all(m.gnss_muted for m in nav)


def test_without_the_setting_or_without_fixes_nothing_navigates():
    _, sent = messages(10.0)
    for settings, dropped in ((SETTINGS | {"gyro_free_navigation": []}, None), (SETTINGS, GNSS)):
        pipeline = Pipeline(EstimatorSettings(**settings))
        said = [
            o
            for topic, message in sent[:60]
            if topic is not dropped
            for o in pipeline.on(topic, message)
        ]
        assert said and not [o for o in said if o.topic is NAV]
    with pytest.raises(UnknownEstimator, match="gyro_free_rate: no estimator 'products-rls'"):
        Pipeline(EstimatorSettings(**SETTINGS | {"gyro_free_rate": "products-rls"}))
