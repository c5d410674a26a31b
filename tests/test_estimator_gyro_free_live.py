"""A cube with a receiver navigates live: an arm that turns fast, through the pipeline's messages, twice the same."""

import pickle

import numpy as np
import pytest

from estimator.service import Pipeline, UnknownEstimator
from estimator.settings import EstimatorSettings
from estimator.simulation.arm import ARM, arm_test, centre
from messages import gyrofree_pb2 as pb
from messages.topics import ACCEL, GNSS, INNOVATION, NAV

LATITUDE, LONGITUDE, HEIGHT = 37.759, 45.978, 1468.0
METRES = 111_195.0  # per degree of latitude, of a sphere: 0.2 % of 3 m do not matter
COS = np.cos(np.radians(LATITUDE))
SETTINGS = {
    "rate": ["products-free"], "gyro_free_rate": "products-free", "gyro_free_navigation": ["huber"],
    "use_every_fix": 2,
}  # fmt: skip


def messages(seconds, half_side=0.05, seed=3, batch=10):
    """Batches of the arm's cube and a fix every 0.5 s, in the order of the bus."""
    test, draw, out = arm_test(seed, half_side=half_side), np.random.default_rng(seed), []
    for number in range(int(np.ceil(seconds / 10.0))):
        block = test.block(number)
        for k in range(0, 1000, batch):
            t = float(block.t_s[k])
            header = pb.Header(device="cube", sequence=len(out), epoch=1, device_us=round(t * 1e6),
                               utc_ns=round((1e9 + t) * 1e9))  # fmt: skip
            flat = block.readings[k : k + batch].ravel().tolist()
            out.append((ACCEL, pb.AccelBatch(header=header, first_index=block.index + k, period_s=0.01, axes=12,
                                             f_mps2=flat)))  # fmt: skip
            if k % 50 == 40:  # at the end of this batch
                out.append((GNSS, fix(test, t + 0.1, len(out), draw)))
    return test, out


def fix(test, t, sequence, draw):
    p, v = centre(test, t)
    p, v = p + draw.normal(size=3) * 0.3, v + draw.normal(size=3) * 0.1
    header = pb.Header(device="cube", sequence=sequence // 6, epoch=1, device_us=round(t * 1e6))
    return pb.GnssFix(
        header=header, latitude_deg=LATITUDE + p[0] / METRES, height_m=HEIGHT - p[2],
        longitude_deg=LONGITUDE + p[1] / (METRES * COS), quality=2, device_time_s=t,
        position_sigma_ned_m=[0.3] * 3, v_n_mps=v, velocity_sigma_ned_mps=[0.1] * 3,
    )  # fmt: skip


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
    """One fix in two is held back and met within the receiver's own noise; sigma is honest; the heading stays."""
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
    unseen = [o.message for o in said if o.topic is INNOVATION and len(o.message.error_to_reference)]
    assert len(unseen) > 20


def heading_error(test, t, q_nb):
    angle = float(test.profile.motion(np.array([t]))[0][0])
    w, x, y, z = q_nb
    yaw = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return (yaw + angle + np.pi) % (2 * np.pi) - np.pi  # z_b is up: a positive angle is a turn to the left


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
    order = pb.EstimatorCommand(action=pb.EstimatorCommand.ACTION_MUTE_GNSS, device="cube", seconds=5.0)
    assert not pipeline.order(order)[0].ok
    said_by(pipeline, sent[:30])
    assert pipeline.order(order)[0].ok
    nav = [o.message for o in said_by(pipeline, sent[30:60]) if o.topic is NAV]
    assert nav and all(m.gnss_muted for m in nav)


def test_without_the_setting_or_without_fixes_nothing_navigates():
    _, sent = messages(10.0)
    for settings, dropped in ((SETTINGS | {"gyro_free_navigation": []}, None), (SETTINGS, GNSS)):
        pipeline = Pipeline(EstimatorSettings(**settings))
        said = [o for topic, message in sent[:60] if topic is not dropped for o in pipeline.on(topic, message)]
        assert said and not [o for o in said if o.topic is NAV]
    with pytest.raises(UnknownEstimator, match="gyro_free_rate: no estimator 'products-rls'"):
        Pipeline(EstimatorSettings(**SETTINGS | {"gyro_free_rate": "products-rls"}))
