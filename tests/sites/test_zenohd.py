"""Zenoh's own router in place of ours: the same configuration, tried on the real program where it
is found ($ZENOHD, or on the PATH).
"""

import contextlib
import datetime as dt
import json
import os
import shutil
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import zenoh
from support.far_link import Line, NoNamespaces
from support.far_site import Watcher, far_site, until
from support.stack import free_port
from typer.testing import CliRunner

from gyrofree.commands.main import app
from messages.bus.faults import BusUnavailable
from messages.bus.session import BusSettings, open_client
from messages.bus.zenohd import Zenohd, difference, zenohd_configuration
from sites import check
from sites.access import rules_of
from sites.enrolment import known_here
from sites.joining import make_site
from sites.place import load_place
from sites.service import own_certificates

BOARD = "cube"
CUT_S, PATIENCE_S = 30.0, 180.0


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site") / "home"
    make_site(folder, "lab", ("viewer", "simulator"))
    return folder


@pytest.fixture
def program() -> Path:
    found = os.environ.get("ZENOHD") or shutil.which("zenohd")
    if found is None:
        pytest.skip("no zenohd: `cargo install zenohd`, and have it on the PATH or in $ZENOHD")
    return Path(found)


def rules(home: Path) -> dict:
    place, now = load_place(home), dt.datetime.now(dt.UTC)
    standing = [each for each in known_here(home, place) if each.stands(now)]
    return rules_of(place, standing, {"gateway.lab": [BOARD]})


def settings(home: Path | None, program: Path | None = None) -> BusSettings:
    address = f"{'tls' if home else 'tcp'}/127.0.0.1:{free_port()}"
    bus = BusSettings(prefix="lab", router=address, listen=[address], tls=home, zenohd=program)
    return bus.acting_as("router")


@contextlib.contextmanager
def routed(bus: BusSettings, access: dict | None) -> Iterator[Zenohd]:
    with Zenohd(bus, access, (), threading.Event()) as running:
        yield running


def test_zenoh_itself_takes_the_configuration_and_it_is_that_of_our_router(home: Path) -> None:
    bus = settings(home)
    text = zenohd_configuration(bus, rules(home), ("tls/10.0.0.1:7447",))
    config = zenoh.Config.from_json5(text)
    told = {key: json.loads(config.get_json(key)) for key in ("mode", "listen/endpoints")}
    assert told == {"mode": "router", "listen/endpoints": bus.listen}
    assert json.loads(config.get_json("connect/endpoints")) == ["tls/10.0.0.1:7447"]
    assert json.loads(config.get_json("transport/link/tls/enable_mtls")) is True
    access = json.loads(config.get_json("access_control"))
    assert access["default_permission"] == "deny" and len(access["rules"]) > 30
    shut = json.loads(config.get_json("adminspace/permissions"))
    assert shut == {"read": False, "write": False}
    assert not json.loads(config.get_json("scouting/multicast/enabled"))
    assert "PRIVATE KEY" not in text


def test_the_command_writes_it_with_and_without_a_site(home: Path, tmp_path: Path) -> None:
    runner, file = CliRunner(), tmp_path / "zenohd.json5"
    config = tmp_path / "gyrofree.toml"
    config.write_text(f'[bus]\nprefix = "lab"\ntls = "{home}"\n')
    words = ["site", "zenohd-config", "--config", str(config)]
    done = runner.invoke(app, [*words, "--out", str(file)])
    assert done.exit_code == 0, done.output
    zenoh.Config.from_file(str(file))
    printed = json.loads(runner.invoke(app, words).stdout)
    assert printed == json.loads(file.read_text())
    told = json.loads(runner.invoke(app, [*words, "--json"]).stdout)
    assert told["configuration"] == printed
    config.write_text("")
    plain = json.loads(runner.invoke(app, words).stdout)
    assert "access_control" not in plain and plain["listen"]["endpoints"]
    config.write_text(f'[bus]\nprefix = "lab"\ntls = "{tmp_path}"\n')
    assert runner.invoke(app, words).exit_code == 2


@pytest.mark.zenohd
def test_the_real_program_holds_the_whole_table_of_rights(home: Path, program: Path) -> None:
    assert difference(program) == ""
    place, bus = load_place(home), settings(home, program)
    tried = check.deeds(place, BOARD)
    roles = [role for role in own_certificates(home) if role not in ("router", "join")]
    heard: set[str] = set()
    with routed(bus, rules(home)), contextlib.ExitStack() as stack:
        opened = lambda role: stack.enter_context(  # noqa: E731
            open_client(bus.acting_as(role), timeout_s=10.0)
        )
        ear = opened("viewer")  # a session hears itself, whatever the router thinks
        ear.declare_subscriber("lab/**", lambda sample: heard.add(sample.payload.to_string()))
        ear.liveliness().declare_subscriber(
            "lab/**", lambda sample: heard.add(f"token {sample.key_expr}")
        )
        for answering in (opened("recorder"), opened("gateway")):
            for deed in (deed for deed in tried if deed.kind == "order"):
                answering.declare_queryable(deed.key, check._note(heard))
        sessions = {role: opened(role) for role in roles}
        time.sleep(check.WAIT_S)
        kept = [check._try(sessions[role], role, tried) for role in roles]
        time.sleep(check.WAIT_S)
        del kept
    wrong = [
        f"{role}: {deed.text}"
        for role in roles
        for number, deed in enumerate(tried)
        if (check._mark(role, number, deed) in heard) != (role in deed.may)
    ]
    assert not wrong and len(heard) > 15


@pytest.mark.zenohd
def test_its_administration_is_shut(home: Path, program: Path) -> None:
    for bus, access, role in (
        (settings(home, program), rules(home), "dashboard"),
        (settings(None, program), None, "operator"),
    ):
        with routed(bus, access), open_client(bus.acting_as(role), timeout_s=10.0) as client:
            told = [r for r in client.get("@/**", timeout=2.0) if r.ok is not None]
            assert [r for r in told if "router" in str(r.ok.key_expr)] == []
            client.put("@/local/router/config/mode", '"peer"')
            assert list(client.info.routers_zid())


@pytest.mark.zenohd
def test_two_places_linked_by_it_survive_a_long_cut(program: Path, tmp_path: Path) -> None:
    try:
        with far_site(tmp_path, Line(), services=(("router",),), zenohd=program) as site:
            watcher = Watcher(site)
            until(lambda: watcher.newest > time.time() - 2.0, PATIENCE_S, "a picture")
            site.link.cut()
            time.sleep(CUT_S)  # TCP's own pauses have grown by then
            site.link.mend()
            mended = time.time()
            until(lambda: watcher.newest > mended, PATIENCE_S, "the picture after a cut")
            time.sleep(2.0)  # a gap that is noticed is asked for
            assert watcher.lines[-1]["lost"] == 0
            for log in (site.lab / "up.log", site.office / "router.log"):
                assert f"{program} routes" in log.read_text()
    except NoNamespaces as error:
        pytest.skip(f"no network namespaces here: {error}")


def test_a_program_that_is_none_or_ends_is_said(tmp_path: Path) -> None:
    false = tmp_path / "zenohd"
    false.write_text("#!/bin/sh\necho of another make\nexit 7\n")
    false.chmod(0o755)
    with pytest.raises(BusUnavailable, match="ended with code 7"):
        with routed(settings(None, false), None):
            pass
    with pytest.raises(OSError):
        with routed(settings(None, tmp_path / "none"), None):
            pass
