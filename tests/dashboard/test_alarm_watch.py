"""What is watched: faults of the bench and numbers, through the store that the page shows."""

import time

import pytest

from dashboard.alarms.book import Book
from dashboard.alarms.fields import parsed, sampled
from dashboard.alarms.machine import Now, State
from dashboard.alarms.settings import AlarmSettings, HealthSettings, LimitSettings
from dashboard.alarms.watch import Watch
from dashboard.data.alarms import alarms, bench_alarms
from dashboard.data.channels import channels
from dashboard.data.store import Store
from logs.figures.quantity import ExpressionError
from messages.contract import gyrofree_pb2 as pb
from messages.contract import topics as tp

UTC = 1_700_000_000 * 10**9
BLIND, VALID = pb.RateEstimate.SIGHT_BLIND, pb.RateEstimate.SIGHT_VALID
DEG = 0.017453292519943295


class Bench:
    """A store, a watch, and time that passes as the test likes."""

    def __init__(self, folder, *limits, **settings):
        self.store, self.book = Store(), Book()
        settings = {"on_delay_s": 0.0, "off_delay_s": 0.0, "disk_free_bytes": 0} | settings
        self.settings = AlarmSettings(state=folder / "alarms.json", **settings)
        self.watch = Watch(self.store, self.settings, folder, self.book)
        for limit in limits:
            self.watch.set_limit(LimitSettings(**{"name": "fast", "field": "omega_z"} | limit))
        self.s = self.data_s = 0.0

    def put(self, topic, message, estimator="", device="cube"):
        message.header.device, message.header.utc_ns = device, UTC + int(self.data_s * 1e9)
        self.store.put(topic, device, estimator, message)

    def link(self, connected=True, **fields):
        self.put(tp.LINK, pb.LinkStatus(connected=connected, **fields))

    def axes(self, state):
        self.put(tp.AXES, pb.AxisHealth(axes=[pb.AxisHealth.Axis(name="a21", state=state)]))

    def rate(self, *omega_z_dps, sight=VALID, step_s=0.05):
        """A sample each, a batch of one."""
        for value in omega_z_dps:
            self.data_s += step_s
            batch = pb.RateBatch(
                omega_ib_b_radps=[0.0, 0.0, value * DEG],
                sight=[sight] * 3,
                nis_dof=[0],
                nis=[0.0],
                still=[False],
                angle_z_rad=[0.0],
            )
            self.put(tp.RATE, batch, "products-ekf")
        self.look()

    def look(self, pass_s=0.2):
        self.s += pass_s
        self.watch.look(Now(self.s, UTC + int(self.s * 1e9)))

    def state(self, id="limit-fast", device="cube"):
        point = self.book.points.get((device, id))
        return None if point is None else point.state


@pytest.fixture
def bench(tmp_path):
    return lambda *limits, **settings: Bench(tmp_path, *limits, **settings)


def test_a_single_sample_beyond_a_limit_is_an_alarm_and_its_end_is_seen(bench):
    one = bench({"above": 100.0, "dead_band": 5.0})
    one.link()
    one.rate(10.0, 20.0)
    one.rate(30.0, 120.0, 30.0)  # between two looks: there and gone
    assert one.state() is State.RETURNED
    assert "120 °/s" in one.book.points["cube", "limit-fast"].cause.text
    one.rate(101.0, 98.0)
    assert one.state() is State.UNACKNOWLEDGED  # inside the dead band it is not over
    one.rate(94.0)
    assert one.state() is State.RETURNED and one.book.points["cube", "limit-fast"].times == 2


def test_a_rate_that_nobody_sees_is_neither_fine_nor_beyond(bench):
    one = bench({"above": 100.0})
    one.link()
    one.rate(10.0, sight=BLIND)
    one.rate(500.0, sight=BLIND)
    assert one.state() is None
    eye = one.watch.eyes["fast", "cube"]
    assert eye.answer.value == "unknown" and "not known" in eye.said
    one.rate(150.0)
    one.rate(1.0, sight=BLIND)
    point = one.book.points["cube", "limit-fast"]
    assert point.active and point.unknown  # what was there is not over
    one.rate(1.0)
    assert one.state() is State.RETURNED


def test_what_two_instruments_say_is_compared_where_both_have_spoken(bench):
    """The tachometer speaks every 70 ms, the filter every 50: no sample lies beside another."""
    one = bench({"field": "abs(omega_z - tachometer)", "above": 20.0, "on_delay_s": 0.5})
    one.link()
    tacho_s = 0.0
    for k in range(80):
        one.rate(100.0)
        while tacho_s < one.data_s:
            tacho_s += 0.07
            m = pb.TachoRate(omega_radps=(100.0 if k < 40 else 60.0) * DEG)
            m.header.device, m.header.utc_ns = "cube", UTC + int(tacho_s * 1e9)
            one.store.put(tp.TACHO, "cube", "", m)
        one.look()
        if k > 5:
            assert one.watch.eyes["fast", "cube"].answer.value != "unknown", k
        assert k >= 40 or one.state() is None
    assert one.state() is State.UNACKNOWLEDGED


def test_not_known_is_an_alarm_where_that_is_asked_for(bench):
    one = bench({"above": 100.0, "unknown": "alarm", "device": "cube"})
    one.link()
    one.rate(10.0)
    for _ in range(15):
        one.rate(10.0, sight=BLIND)
    assert one.state() is State.UNACKNOWLEDGED
    assert "not known" in one.book.points["cube", "limit-fast"].cause.title
    one.rate(10.0)
    assert one.state() is State.RETURNED


def test_delays_count_the_time_of_the_data(bench):
    one = bench({"above": 100.0, "on_delay_s": 1.0})
    one.link()
    one.rate(*[120.0] * 15)
    one.look(pass_s=60.0)  # time that passes without data is no time beyond the limit
    assert one.state() is None
    one.rate(*[120.0] * 10)
    assert one.state() is State.UNACKNOWLEDGED


def test_a_limit_in_another_unit_than_the_fields_says_so(bench):
    one = bench({"above": 2.0, "unit": "rad/s"})
    one.link()
    one.rate(150.0, 150.0)
    assert one.state() is None
    assert "°/s" in one.watch.eyes["fast", "cube"].said


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("link.latency_p99_s", 0.25),
        ("link.connected", 1.0),
        ("link.refused[crc]", 7.0),
        ("rate.products-ekf.omega_ib_b_radps[2]", 90.0 * DEG),
        ("rate.products-ekf.omega_z", 90.0),
        ("abs(omega_z) - 30", 60.0),
    ],
)
def test_any_number_of_any_topic_can_be_asked_for(bench, field, value):
    one = bench()
    one.link(latency_p99_s=0.25, refused={"crc": 7})
    one.rate(90.0, 90.0, 90.0)
    device = one.store.devices["cube"]
    text = "abs(omega_z) - 30 * omega_z / 90" if field.startswith("abs") else field
    found = sampled(device, parsed(text), -10.0, time.monotonic(), channels(device))
    assert not found.why and found.y[-1] == pytest.approx(value)


@pytest.mark.parametrize(
    ("field", "word"),
    [
        ("link.latency", "has no field"),
        ("link.message", "no number"),
        ("nowhere.x", "no topic"),
        ("nav.ekf.sigma", "several numbers"),
        ("link.latency_p99_s[0]", "one number"),
        ("__import__('os')", ""),
        ("omega_z.real", ""),
    ],
)
def test_a_field_that_is_none_is_refused_with_the_reason(field, word):
    with pytest.raises(ExpressionError) as said:
        parsed(field)
    assert word in str(said.value)


def test_faults_of_the_bench_are_alarms_of_their_level_and_silence_is_no_end(bench):
    one = bench(health=HealthSettings(axis="critical", blind="off"))
    one.link()
    one.axes(pb.AxisHealth.STATE_STUCK)
    one.look()
    point = one.book.points["cube", "axis-a21"]
    assert point.state is State.UNACKNOWLEDGED and point.cause.level == "critical"
    one.store.devices["cube"].latest["axes", ""].arrived -= 60.0  # its estimator fell silent
    one.look()
    point = one.book.points["cube", "axis-a21"]
    assert point.active and point.unknown
    one.axes(pb.AxisHealth.STATE_GOOD)
    one.look()
    assert one.state("axis-a21") is State.RETURNED
    one.rate(1.0, sight=BLIND)
    assert not any(id.startswith("blind") for _, id in one.book.points)


def test_a_procedure_that_nobody_records_a_clock_and_a_full_disk_are_alarms(bench):
    one = bench(disk_free_bytes=1 << 60)
    one.link(clock_offset_s=3.0)
    running = pb.ProcedureStatus(state=pb.ProcedureStatus.STATE_RUNNING, procedure="short")
    one.put(tp.PROCEDURE, running)
    one.look()
    assert one.state("recorder-procedure") is State.UNACKNOWLEDGED
    assert one.state("clock") is State.UNACKNOWLEDGED
    assert one.state("disk", "") is State.UNACKNOWLEDGED
    one.store.put(tp.STATUS, "recorder", "", pb.RecorderStatus(recording=True))
    one.link()
    one.look()
    assert one.state("recorder-procedure") is State.RETURNED
    assert one.state("clock") is State.RETURNED


def test_a_filter_that_is_too_sure_is_an_alarm(bench):
    one = bench()
    one.link()
    for _ in range(60):
        one.data_s += 0.1
        batch = pb.RateBatch(
            omega_ib_b_radps=[0.0] * 3,
            sight=[VALID] * 3,
            nis=[9.0],
            nis_dof=[3],
            still=[False],
            angle_z_rad=[0.0],
        )
        one.put(tp.RATE, batch, "products-ekf")
    one.look()
    point = one.book.points["cube", "inconsistent-products-ekf"]
    assert point.active and "3.0 times what it believes" in point.cause.text


def test_the_page_shows_what_the_service_says_and_hides_what_is_on_the_shelf(bench):
    one = bench()
    one.link()
    one.axes(pb.AxisHealth.STATE_STUCK)
    device = one.store.devices["cube"]
    assert [(a.id, a.state) for a in alarms(one.store, device)] == [("axis-a21", "")]

    def said(state, **fields):
        alarm = pb.Alarm(id="axis-a21", device="cube", kind="axis", state=state, level=2)
        alarm.active = True
        limit = pb.Alarm(id="limit-fast", device="cube", kind="limit", title="fast", level=3)
        limit.active, limit.state = True, pb.Alarm.STATE_UNACKNOWLEDGED
        disk = pb.Alarm(id="disk", kind="disk", title="disk low", level=3, active=True)
        disk.state = pb.Alarm.STATE_UNACKNOWLEDGED
        one.put(tp.ALARM, pb.AlarmStatus(alarms=[alarm, limit, disk]))
        return [(a.kind, a.level, a.state) for a in alarms(one.store, device)]

    first = ("limit", "critical", "unacknowledged")
    assert said(pb.Alarm.STATE_ACKNOWLEDGED) == [first, ("axis", "warning", "acknowledged")]
    assert said(pb.Alarm.STATE_SHELVED) == [first]
    assert [a.title for a in bench_alarms(one.store)] == ["disk low"]
    device.latest["alarm", ""].arrived -= 60.0  # without the service the page judges for itself
    assert [(a.id, a.state) for a in alarms(one.store, device)] == [("axis-a21", "")]
    assert bench_alarms(one.store) == []
