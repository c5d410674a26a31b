"""Real Zenoh over real TLS: who may say what, who is not heard at all, and two places as one."""

import datetime as dt
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest
import zenoh
from support.stack import free_port
from support.waiting import until

from messages.bus import orders
from messages.bus.beating import Beating, tell_time
from messages.bus.faults import BusUnavailable, IdentityError
from messages.bus.presence import Presence, Watching, viewers
from messages.bus.session import BusSettings, open_client, open_router, subscribe
from messages.bus.tls import TRUSTED
from messages.contract import gyrofree_pb2 as pb
from messages.contract import topics as tp
from sites.access import rules_of
from sites.authority import Authority, pem
from sites.check import try_all
from sites.enrolment import Registrar, known_here, load_request, new_requests
from sites.handing_out import hand_out
from sites.invitation import invite
from sites.joining import join, make_site
from sites.place import SiteError, load_place, write
from sites.removal import remove
from sites.service import declare, own_certificates

BOARD = "cube"
FLOOD = 10_000


@contextmanager
def router(folder: Path, address: str, mesh: tuple[str, ...] = ()) -> Iterator[zenoh.Session]:
    """A place's router with its rules, as `gyrofree router` has them."""
    place, now = load_place(folder), dt.datetime.now(dt.UTC)
    standing = [each for each in known_here(folder, place) if each.stands(now)]
    rules = rules_of(place, standing, {f"gateway.{place.place}": [BOARD]})
    with open_router(bus(folder, address, "router"), rules, mesh) as session:
        yield session


def bus(folder: Path | None, address: str, role: str) -> BusSettings:
    settings = BusSettings(prefix="lab", router=address, listen=[address], tls=folder)
    return settings.acting_as(role)


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site") / "home"
    make_site(folder, "lab", ("viewer", "simulator"))
    return folder


def test_each_certificate_may_do_what_its_role_needs_and_nothing_else(home: Path) -> None:
    place, roles = load_place(home), list(own_certificates(home))
    now = dt.datetime.now(dt.UTC)
    standing = [each for each in known_here(home, place) if each.stands(now)]
    rules = rules_of(place, standing, {"gateway.lab": [BOARD]})
    found = try_all(home, place, rules, roles, BOARD)
    assert not [verdict.text for verdict in found if not verdict.good]
    assert not [v.text for v in found if v.role == "viewer" and v.allowed]
    assert sum(verdict.allowed for verdict in found) > 15
    # with a rule left out, the check finds it and says what to do
    ids = [s["id"] for s in rules["subjects"] if "gateway.lab" in s["cert_common_names"]]
    rules["policies"] = [p for p in rules["policies"] if p["subjects"] != ids]
    spoilt = try_all(home, place, rules, ["gateway"], BOARD)
    assert any("dropped without a word" in verdict.text for verdict in spoilt)


def watched(session: zenoh.Session) -> Presence:
    """Who is there, as this session hears it."""
    presence = Presence("lab")
    Watching(session, "lab", presence)

    def heard(key: str, beat: pb.Beat) -> None:
        presence.beat(key.split("/")[1], key.split("/")[3], beat)
        presence.look(time.monotonic())

    subscribe(session, tp.BEAT, "lab", heard)
    return presence


def forged_beat(place: str) -> bytes:
    """As a process of that place would say it."""
    return pb.Beat(header=pb.Header(device=place), role="dashboard").SerializeToString()


def foreign(tmp_path: Path) -> Path:
    """A gateway of another authority with the same names."""
    make_site(tmp_path / "foreign", "lab")
    return tmp_path / "foreign"


def test_without_a_certificate_of_the_site_nothing_is_accepted(home: Path, tmp_path: Path) -> None:
    address = f"tls/127.0.0.1:{free_port()}"
    other = foreign(tmp_path)
    (other / TRUSTED).write_bytes((home / TRUSTED).read_bytes())  # it trusts ours; we do not
    heard: list[zenoh.Sample] = []
    with router(home, address) as session:
        session.declare_subscriber("**", heard.append)
        strangers = [
            bus(None, address.replace("tls/", "tcp/"), "gateway"),
            bus(other, address, "gateway"),
        ]
        for stranger in strangers:
            with pytest.raises(BusUnavailable):
                open_client(stranger, timeout_s=3.0)
        # a certificate that gives no right is let in, and is not heard either
        with open_client(bus(home, address, "viewer"), timeout_s=10.0) as viewer:
            for number in range(FLOOD):
                viewer.put(f"lab/{BOARD}/accel", f"{number}")
            with open_client(bus(home, address, "gateway"), timeout_s=10.0) as gateway:
                gateway.put(f"lab/{BOARD}/accel", b"mine")
                until(lambda: bool(heard), "the gateway is heard", 10.0)
        assert [sample.payload.to_bytes() for sample in heard] == [b"mine"]


def test_a_missing_certificate_and_one_that_ended_are_said(home: Path, tmp_path: Path) -> None:
    with pytest.raises(IdentityError, match=r"ca\.pem is not there.*certs list"):
        open_router(bus(tmp_path, "tls/127.0.0.1:1", "router"))
    authority = Authority(home)
    key, request = new_requests(("gateway",))["gateway"]
    life = dt.timedelta(seconds=-100)
    ended = authority.issue(load_request(request), "gateway", "lab", name="old", life=life)
    for name, content in (("gateway.pem", pem(ended)), ("gateway.key", key)):
        write(tmp_path / name, content)
    write(tmp_path / TRUSTED, (home / TRUSTED).read_bytes())
    address = f"tls/127.0.0.1:{free_port()}"
    with router(home, address), pytest.raises(BusUnavailable, match="its certificate ended"):
        open_client(bus(tmp_path, address, "gateway"), timeout_s=2.0)


def test_an_office_joins_hears_everything_may_order_nothing_and_can_be_sent_away(
    tmp_path: Path,
) -> None:
    home, office = tmp_path / "home", tmp_path / "office"
    make_site(home, "lab")
    at_home, at_office = (f"tls/127.0.0.1:{free_port()}" for _ in range(2))
    invitation, _ = invite(home, "office", "viewer", at_office, dt.timedelta(days=1))
    joined: list[object] = []
    said: list[str] = []

    def office_joins() -> None:
        joined.append(join(office, invitation, at_office, threading.Event(), said.append))

    waiting = threading.Thread(target=office_joins, daemon=True)
    waiting.start()
    with ExitStack() as running:
        running.enter_context(router(home, at_home, (at_office,)))
        server = running.enter_context(open_client(bus(home, at_home, "authority"), timeout_s=10))
        declared = declare(server, load_place(home), Registrar(home))
        waiting.join(60.0)
        assert joined and (office / "place.json").exists()
        assert not (office / "joining").exists()
        for one in declared:
            one.undeclare()
    heard: list[str] = []
    with ExitStack() as running:
        running.enter_context(router(home, at_home, (at_office,)))
        running.enter_context(router(office, at_office))
        gateway = running.enter_context(open_client(bus(home, at_home, "gateway"), timeout_s=10))
        page = running.enter_context(open_client(bus(office, at_office, "dashboard"), timeout_s=10))
        page.declare_subscriber("lab/**", lambda sample: heard.append(str(sample.key_expr)))
        taken: list[zenoh.Query] = []
        gateway.declare_queryable(orders.BOARD.key("lab", BOARD), taken.append)
        key, state = tp.ACCEL.key("lab", BOARD), {"sent": 0}

        def arrives() -> bool:
            gateway.put(key, b"sample")
            state["sent"] += 1
            return key in heard

        until(arrives, "the office hears the lab's board", 30.0)
        page.put(key, b"forged")
        with pytest.raises(orders.OrderError):
            orders.give(page, "lab", orders.BOARD, pb.BoardCommand(), BOARD, 2.0)
        assert not taken
        # who is there is known at both places, and how far their clocks are from one another
        near, server = (
            running.enter_context(open_client(bus(home, at_home, role), timeout_s=10))
            for role in ("dashboard", "authority")
        )
        presence, clock = watched(near), tell_time(server, "lab")
        people = running.enter_context(
            Beating(page, bus(office, at_office, "dashboard"), viewers=lambda: {"viewer": 3})
        )
        until(lambda: "office" in presence.places(), "home sees the office", 30.0)
        until(lambda: viewers(presence.all()) == {"viewer": 3}, "home sees its people", 30.0)
        until(lambda: people.clock_ahead()[1] < 1.0, "the office's clock is compared", 30.0)
        assert abs(people.clock_ahead()[0]) <= people.clock_ahead()[1]
        page.put(tp.BEAT.key("lab", "lab", "dashboard-1"), forged_beat("lab"))
        page.put(tp.BEAT.key("lab", "office", "dashboard-2"), forged_beat("office"))
        page.put(tp.BEAT.key("lab", "lab", "up-1"), forged_beat("lab"))
        page.put(tp.BEAT.key("lab", "office", "up-2"), forged_beat("office"))  # of who started it
        until(lambda: ("office", "dashboard-2") in presence.processes, "its own name is let in")
        until(lambda: ("office", "up-2") in presence.processes, "so is its supervisor's")
        assert ("lab", "dashboard-1") not in presence.processes
        assert ("lab", "up-1") not in presence.processes
        clock.undeclare()
    assert remove(home, "office") >= 4
    heard.clear()
    with ExitStack() as running:
        running.enter_context(router(home, at_home, (at_office,)))
        running.enter_context(router(office, at_office))
        gateway = running.enter_context(open_client(bus(home, at_home, "gateway"), timeout_s=10))
        page = running.enter_context(open_client(bus(office, at_office, "dashboard"), timeout_s=10))
        near = running.enter_context(open_client(bus(home, at_home, "dashboard"), timeout_s=10))
        page.declare_subscriber("lab/**", lambda sample: heard.append(str(sample.key_expr)))
        mine: list[str] = []
        near.declare_subscriber("lab/**", lambda sample: mine.append(str(sample.key_expr)))

        def known_at_home() -> bool:
            gateway.put(key, b"sample")
            return len(mine) > 50

        until(known_at_home, "home hears its own board", 30.0)
        assert not heard


def test_a_gateway_of_another_machine_has_its_own_boards_alone(home: Path, tmp_path: Path) -> None:
    life, authority = dt.timedelta(days=1), Authority(home)
    with pytest.raises(SiteError, match="names its boards"):
        hand_out(authority, home, "gateway", "bench2", (), life, tmp_path / "b")
    hand_out(authority, home, "gateway", "bench2", ("cube2",), life, tmp_path / "b")
    with pytest.raises(SiteError, match="was issued already"):
        hand_out(authority, home, "gateway", "bench2", ("cube3",), life, tmp_path / "c")
    address = f"tls/127.0.0.1:{free_port()}"
    heard: list[str] = []
    with (
        router(home, address) as session,
        open_client(bus(tmp_path / "b", address, "gateway"), timeout_s=10.0) as gateway,
    ):
        session.declare_subscriber("lab/**", lambda sample: heard.append(str(sample.key_expr)))
        gateway.put(tp.ACCEL.key("lab", BOARD), b"of another")
        gateway.put(tp.ACCEL.key("lab", "cube2"), b"its own")
        until(lambda: bool(heard), "its own board is heard", 10.0)
        assert heard == [tp.ACCEL.key("lab", "cube2")]
