"""Alarms of services, places, clocks and certificates, the age of the picture, and REST of it."""

import datetime as dt
import math
import random
import time
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.front_door import open_door

from dashboard.alarms.book import Book
from dashboard.alarms.health import of_bench, of_device
from dashboard.alarms.machine import Now
from dashboard.alarms.own_place import OwnPlace
from dashboard.alarms.places import Certificates
from dashboard.alarms.settings import AlarmSettings, HealthSettings
from dashboard.alarms.watch import Watch
from dashboard.data.alarms import alarms, bench_alarms
from dashboard.data.lateness import behind, clock, lateness
from dashboard.data.places import people_said, places
from dashboard.data.store import Store
from dashboard.web.alarms.watched import watched
from messages.bus.beating import BEAT_S
from messages.bus.presence import AGAIN_S, LOOK_S, SETTLE_S
from messages.contract import gyrofree_pb2 as pb
from messages.contract import topics as tp
from messages.contract.topics import claim_key
from sites.authority import Authority, pem
from sites.enrolment import load_request, new_requests

DAY_S, NAN = 86_400.0, float("nan")
WALL_S = 1_700_000_000.0


class Bench:
    """A store of which a dashboard at the office watches."""

    def __init__(self) -> None:
        self.store, self.s = Store(), 0.0
        self.store.presence.own = "office-dashboard"
        self.store.presence.look(0.0)
        self.sequence = 0

    def beats(self, place: str, role: str, clock_s: float = 0.0, **fields: object) -> None:
        self.sequence += 100
        beat = pb.Beat(role=role, session=f"{place}-{role}", **fields)
        beat.header.device, beat.header.sequence = place, self.sequence
        beat.clock_ahead_s, beat.clock_bound_s = clock_s, 0.02
        self.store.presence.beat(place, f"{role}-1", beat)
        self.store.presence.look(self.s)

    def token(self, place: str, role: str, there: bool = True) -> None:
        self.store.presence.token(tp.alive_key("lab", place, f"{role}-1"), there)

    def passes(self, seconds: float) -> None:
        for _ in range(math.ceil(seconds / LOOK_S)):
            self.s += LOOK_S
            self.store.presence.look(self.s)

    def sample(self, ago_s: float = 0.0) -> None:
        m = pb.TachoRate(omega_radps=1.0)
        m.header.device, m.header.utc_ns = "cube", int((WALL_S - ago_s) * 1e9)
        self.store.put(tp.TACHO, "cube", "", m)

    def found(self, certificates: Certificates | None = None, **settings: object) -> dict:
        wanted = AlarmSettings(disk_free_bytes=0, **settings)
        with self.store.lock:
            return of_bench(self.store, wanted, Path("."), time.monotonic(), certificates).causes


@pytest.fixture
def bench() -> Bench:
    return Bench()


def everybody(bench: Bench, **office: object) -> None:
    for role in ("gateway", "router"):
        bench.beats("lab", role, devices=["cube"] if role == "gateway" else [])
        bench.token("lab", role)
    for role in ("dashboard", "router"):
        bench.beats("office", role, **office)
        bench.token("office", role)


def settle(bench: Bench, **office: object) -> None:
    """Everybody has been there for a while."""
    everybody(bench)
    bench.passes(SETTLE_S)
    for _ in range(2 * int(AGAIN_S) + 1):
        everybody(bench, **office)
        bench.passes(0.5)
    everybody(bench, **office)


# --- frozen: counted by beats and looks, not by a clock


class Machine:
    """Processes of the lab that beat by a machine's own time, and whoever watches them."""

    ROLES = ("router", "gateway", "estimator", "recorder", "alarms")

    def __init__(self, folder: Path, seed: int = 0) -> None:
        self.random = random.Random(seed)
        self.store, self.book = Store(), Book()
        self.store.presence.own = "lab-alarms"
        settings = AlarmSettings(state=folder / "alarms.json", disk_free_bytes=0)
        self.watch = Watch(self.store, settings, folder, self.book)
        self.beats = dict.fromkeys(self.ROLES, 0)
        self.due = {role: 0.1 * k for k, role in enumerate(self.ROLES)}
        self.s = self.machine_s = 0.0
        for role in self.ROLES:
            self.store.presence.token(tp.alive_key("lab", "lab", f"{role}-1"), True)

    def step(self, passed_s: float, speed: float = 1.0, frozen: str = "") -> set[str]:
        """So much time passes, of which the machine has a share; the alarms that are there."""
        self.s, self.machine_s = self.s + passed_s, self.machine_s + passed_s * speed
        for role in self.ROLES:
            while self.due[role] <= self.machine_s:
                self.due[role] += BEAT_S + self.random.uniform(0.0, 0.05)
                if role != frozen:
                    self.beats[role] += 1
                    beat = pb.Beat(role=role, session=f"lab-{role}")
                    beat.header.device, beat.header.sequence = "lab", self.beats[role]
                    self.store.presence.beat("lab", f"{role}-1", beat)
        self.store.presence.look(self.s)
        self.watch.look(Now(self.s, int(self.s * 1e9)))
        return {point.id for point in self.book.points.values() if point.active}


@pytest.mark.parametrize("role", ["gateway", "recorder"])
@pytest.mark.parametrize("phase", range(6))
def test_a_frozen_service_is_an_alarm_before_the_others_have_beaten_for_two_seconds(
    tmp_path, role, phase
):
    lab = Machine(tmp_path, phase)
    while lab.beats[role] < 30 or lab.s % 0.6 < 0.1 * phase:
        assert not lab.step(0.1)
    at = dict(lab.beats)
    while f"service-lab-{role}" not in lab.step(0.1, frozen=role):
        others = [lab.beats[one] - at[one] for one in lab.ROLES if one != role]
        assert max(others) < 2.0 / BEAT_S
    assert lab.beats[role] == at[role]


@pytest.mark.parametrize("seed", range(8))
def test_a_machine_without_time_is_not_taken_for_a_frozen_service(tmp_path, seed):
    """It has a tenth to all of its time, changing, for all of its processes alike."""
    lab, lottery = Machine(tmp_path, seed), random.Random(seed)
    while lab.s < 120.0:
        speed, end = 10.0 ** lottery.uniform(-1.0, 0.0), lab.s + lottery.uniform(0.3, 4.0)
        while lab.s < end:
            assert not lab.step(0.1, speed)


def test_one_that_just_began_is_given_more_time(tmp_path):
    lab = Machine(tmp_path)
    while lab.beats["recorder"] < 30:
        lab.step(0.1)
    lab.beats["recorder"] = 3
    lab.step(0.6)
    at_s = lab.s
    while "service-lab-recorder" not in lab.step(0.1, frozen="recorder"):
        pass
    assert 2.5 < lab.s - at_s < 3.5


def test_a_service_whose_work_stands_is_an_alarm_that_says_which_and_for_how_long(bench):
    settle(bench)
    hung = {"loop": "link cube", "doing": "decoding the journal", "turn_most_s": 3.0}
    bench.beats("lab", "gateway", turn_ago_s=2.9, **hung)
    assert not bench.found()
    bench.beats("lab", "gateway", turn_ago_s=3.4, **hung)
    bench.passes(LOOK_S)
    (found,) = bench.found().values()
    assert found.title == "gateway at lab hung"
    assert "link cube (decoding the journal), has stood for some seconds" in found.text
    (gateway,) = (
        one
        for place in places(bench.store.presence)
        for one in place["services"]
        if (place["name"], one["role"]) == ("lab", "gateway")
    )
    assert gateway["state_said"] == "hung, 4 s: link cube (decoding the journal)"
    bench.beats("lab", "gateway", turn_ago_s=0.0, **hung)
    bench.passes(LOOK_S)
    assert not bench.found()


def test_who_is_spoken_for_is_not_blamed_for_the_one_that_speaks(bench):
    settle(bench)
    bench.beats("lab", "up", told_by="router-1", loop="services", turn_most_s=3.0, turn_ago_s=9.0)
    bench.token("lab", "up")
    bench.passes(LOOK_S)
    assert bench.found()["service-lab-up"].title == "up at lab hung"
    bench.beats("lab", "up", told_by="router-1", loop="services", turn_most_s=3.0)
    for _ in range(8):  # the router says nothing, nor therefore of whoever started it
        bench.passes(0.5)
        for place, role in (("lab", "gateway"), ("office", "dashboard"), ("office", "router")):
            bench.beats(place, role)
    assert list(bench.found()) == ["service-lab-router"]


def test_a_frozen_service_and_one_that_is_gone_are_alarms_on_the_page_and_in_the_service(bench):
    settle(bench)
    assert not bench.found() and not bench_alarms(bench.store)
    for _ in range(7):  # the gateway says nothing any more
        bench.passes(0.5)
        for place, role in (("lab", "router"), ("office", "dashboard"), ("office", "router")):
            bench.beats(place, role)
    found = bench.found()
    assert list(found) == ["service-lab-gateway"]
    assert found["service-lab-gateway"].title == "gateway at lab frozen"
    assert [one.id for one in bench_alarms(bench.store)] == ["service-lab-gateway"]
    bench.token("lab", "gateway", there=False)
    bench.passes(0.5)
    assert bench.found()["service-lab-gateway"].title == "gateway at lab gone"
    assert not bench.found(health=HealthSettings(service="off"))


def test_a_place_of_which_nothing_is_heard_is_one_alarm_and_not_one_for_each_service(bench):
    everybody(bench)
    for _ in range(20):
        bench.passes(0.5)
        for role in ("dashboard", "router"):
            bench.beats("office", role)
    assert list(bench.found()) == ["place-lab"]


def test_who_is_silent_at_a_place_out_of_reach_is_not_blamed_for_it(bench):
    """The gateway, its estimators and the recorder are silent as the link is cut."""
    everybody(bench)
    bench.beats("lab", "recorder")
    bench.sample()
    store = bench.store
    for topic, estimator in ((tp.LINK, ""), (tp.ESTIMATOR, "products-ekf")):
        store.put(topic, "cube", estimator, topic.type(header=pb.Header(utc_ns=int(WALL_S * 1e9))))
    recording = pb.RecorderStatus(recording=True)
    store.put(tp.STATUS, "recorder", "", recording)
    for latest in (*store.devices["cube"].latest.values(), store.recorder):
        latest.arrived -= 30.0
    silent = {"link", "estimator-products-ekf"}
    assert {one.id for one in alarms(store, store.devices["cube"])} == silent
    assert "recorder" in {one.id for one in bench_alarms(store)}
    for _ in range(20):
        bench.passes(0.5)
        for role in ("dashboard", "router"):
            bench.beats("office", role)
    assert not alarms(store, store.devices["cube"])
    assert [one.id for one in bench_alarms(store)] == ["place-lab"]
    (lab,) = [one for one in places(store.presence) if one["name"] == "lab"]
    assert people_said(lab["people"], lab["state"]) == "who looks is not known"


def test_two_gateways_of_one_board_are_an_alarm_of_that_board(bench):
    everybody(bench)
    bench.passes(SETTLE_S)
    bench.sample()
    key = claim_key("lab", "gateway", "cube")
    bench.store.presence.claimants.heard(f"{key}/1-lab-gateway", True)
    device = bench.store.devices["cube"]
    assert not alarms(bench.store, device)
    bench.store.presence.claimants.heard(f"{key}/waiting-2-abc", True)
    with bench.store.lock:
        cause = of_device(bench.store, device, AlarmSettings(), time.monotonic()).causes
    assert cause["twin-cube"].level == "critical"
    assert "gateway at lab (publishes)" in cause["twin-cube"].text
    assert [one.id for one in alarms(bench.store, device)] == ["twin-cube"]


def test_a_clock_that_is_surely_off_or_cannot_be_compared_is_an_alarm(bench):
    settle(bench, clock_s=2.3)
    assert "+2.3 s" in bench.found()["clock-office"].text
    everybody(bench, clock_s=0.51)  # within its bound it may be less than the limit
    assert "clock-office" not in bench.found()
    everybody(bench, clock_s=NAN)
    assert "cannot be measured" in bench.found()["clock-office"].text


@pytest.mark.parametrize(
    ("left_s", "life_s", "is_alarm"),
    [
        (20 * DAY_S, 90 * DAY_S, False),
        (13 * DAY_S, 90 * DAY_S, True),
        (-5.0, 90 * DAY_S, True),
        (1000.0, 3600.0, False),  # of a short life a third is renewed, a sixth is late
        (500.0, 3600.0, True),
    ],
)
def test_a_certificate_near_its_end_that_a_process_shows(bench, left_s, life_s, is_alarm):
    ends = int((time.time() + left_s) * 1e9)
    fields = {"certificate_ends_utc_ns": ends, "certificate_life_s": life_s}
    settle(bench)
    bench.beats("lab", "gateway", **fields)
    found = bench.found(Certificates(None))
    assert ("certificate-lab-gateway" in found) == is_alarm


def test_a_certificate_of_this_place_that_no_process_shows(bench, tmp_path):
    authority = Authority.create(tmp_path, "lab")
    _, request = new_requests(("operator",))["operator"]
    life = dt.timedelta(hours=1)
    made = authority.issue(load_request(request), "operator", "lab", life=life)
    (tmp_path / "operator.pem").write_bytes(pem(made))
    (tmp_path / "broken.pem").write_text("no certificate")
    bench.passes(SETTLE_S)
    with bench.store.lock:
        look = Certificates(tmp_path)
        now = time.time()
        assert not list(look.near_end(bench.store, 14.0, now))
        (alarm,) = look.near_end(bench.store, 14.0, now + 3300)
        assert alarm.about == "own-operator" and "near its end" in alarm.title


# --- how old the picture is


def test_the_age_is_by_the_clocks_of_both_places(bench):
    """The office's clock is 0.4 s ahead, the lab's own 1 s behind the site's."""
    everybody(bench, clock_s=0.4)
    bench.beats("lab", "gateway", clock_s=-1.0, devices=["cube"])
    bench.sample(ago_s=2.3)
    device = bench.store.devices["cube"]
    late = lateness(bench.store, device, WALL_S)
    assert late.age_s == pytest.approx(2.3 - 0.4 - 1.0, abs=1e-6)
    assert late.bound_s == pytest.approx(0.04)
    later = lateness(bench.store, device, WALL_S + 1.5)
    assert later.late and later.shown and later.said == "2.4 s behind, clock +0.4 s"


def test_without_an_offset_no_age_is_said(bench):
    bench.sample()
    device = bench.store.devices["cube"]
    late = lateness(bench.store, device, WALL_S)
    assert not late.known and "not measured" not in late.said and late.said == "age not known"
    everybody(bench, clock_s=NAN)
    assert "this clock" in lateness(bench.store, device, WALL_S).details
    everybody(bench, clock_s=0.0)
    bench.beats("lab", "gateway", clock_s=NAN, devices=["cube"])
    late = lateness(bench.store, device, WALL_S)
    assert not late.known and late.shown and "its gateway's clock" in late.details


@given(age=st.floats(-5.0, 1e5), bound=st.floats(0.0, 100.0))
def test_no_digit_is_said_that_is_not_known(age, bound):
    said = behind(age, bound)
    number = float(said.removeprefix("at most ").removeprefix("under ").removesuffix(" s"))
    if said.startswith(("at most", "under")):
        assert number >= max(age, 0.0) + bound - 0.51
    else:
        digits = len(said.split(" ")[0].partition(".")[2])
        assert 10.0**-digits >= 0.4 * bound or bound > 1.0
        assert abs(number - age) <= 0.5 * 10.0**-digits + 1e-9
    assert "-" not in clock(-age, bound)


# --- a place without a service of alarms


def test_an_office_finds_its_own_disk_clock_certificates_and_a_place_out_of_reach(bench, tmp_path):
    settings = AlarmSettings(state=tmp_path / "alarms.json", disk_free_bytes=1 << 60)
    own = OwnPlace(bench.store.presence, settings, tmp_path, None)
    for _ in range(3):  # the lab's gateway is frozen, too, which is told there
        everybody(bench)
        bench.passes(SETTLE_S)
    ends = int((time.time() + DAY_S) * 1e9)
    office = {"certificate_ends_utc_ns": ends, "certificate_life_s": 90 * DAY_S, "clock_s": 2.3}

    def look() -> set[str]:
        for _ in range(8):
            for role in ("dashboard", "router"):
                bench.beats("office", role, **office)
            bench.passes(0.5)
            own.look(Now(bench.s, int(bench.s * 1e9)))
        return {one.id for one in own.faults()}

    everybody(bench)
    found = {"disk", "clock-office", "certificate-office-dashboard", "certificate-office-router"}
    assert look() == found | {"place-lab"}
    assert {one.level for one in own.faults()} >= {"critical", "warning", "watch"}
    bench.store.own_faults = own.faults()
    assert {one.id for one in bench_alarms(bench.store)} == found | {"place-lab"}
    on_page, _ = watched(bench.store)
    assert {one.id for one in on_page} == found | {"place-lab"}
    assert on_page[0].level == pb.Alarm.LEVEL_CRITICAL and all(one.raised_utc_ns for one in on_page)


# --- REST and the page


def test_the_page_and_rest_say_who_is_there(bench, tmp_path):
    settle(bench, viewers=[pb.Beat.Viewers(role="viewer", count=2)])
    bench.sample()
    link = pb.LinkStatus(connected=True)
    link.header.device = "cube"
    bench.store.put(tp.LINK, "cube", "", link)
    with open_door(tmp_path, scene=False, store=bench.store) as door, door.client("vera") as viewer:
        assert "Places" in viewer.get("/places").text
        assert door.front.lookers.by_role() == {"viewer": 1}
        now = viewer.get("/api/places").json()
        assert now["sees"] and [one["name"] for one in now["places"]] == ["office", "lab"]
        office, lab = now["places"]
        assert office["own"] and office["people_said"] == "4 viewers look"
        assert {one["role"]: one["state"] for one in lab["services"]} == {
            "gateway": "running",
            "router": "running",
        }
        assert now["boards"][0]["gateway"] == "lab" and now["boards"][0]["late"]["known"]
        (cube,) = viewer.get("/api/devices").json()
        assert cube["late"]["shown"] and "behind" in cube["late"]["said"]
    with open_door(tmp_path / "b", scene=False) as door, door.client("vera") as viewer:
        assert viewer.get("/api/places").status_code == 503
        with door.client() as nobody:
            assert nobody.get("/api/places").status_code == 401
