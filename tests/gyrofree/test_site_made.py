"""`gyrofree site init` and `join` where there is something already, or where they were cut off."""

import datetime as dt
import json
from pathlib import Path

import pytest
from support.stack import free_port
from typer.testing import CliRunner

from gyrofree.commands.main import app
from gyrofree.config import load
from sites.authority import Authority
from sites.enrolment import is_whole
from sites.invitation import invite
from sites.joining import issue_here, make_site
from sites.place import Place, save_place
from sites.roles import SERVICES


def run(*words: str):
    return CliRunner().invoke(app, ["site", *words])


def test_the_doctor_knows_a_free_port_of_a_site() -> None:
    assert run("init", "lab", "--port", str(free_port())).exit_code == 0
    found = json.loads(CliRunner().invoke(app, ["doctor", "--json"]).stdout)
    assert [one["state"] for one in found if one["check"] == "bus port"] == ["ok"]


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_an_installation_is_not_taken_from_its_site_by_the_way(here: Path) -> None:
    assert run("init", "lab", "--port", "17000").exit_code == 0
    before = Path("gyrofree.toml").read_text()
    again = run("init", "other", "--folder", "elsewhere")
    assert again.exit_code == 2 and "of a site already" in again.output
    line = invite(here / "var/site", "office", "viewer", "tls/x:1", dt.timedelta(days=1))[0].line()
    joined = run("join", line, "--folder", "elsewhere")
    assert joined.exit_code == 2 and "of a site already" in joined.output
    assert Path("gyrofree.toml").read_text() == before and not Path("elsewhere").exists()


def test_what_was_cut_off_before_the_configuration_is_ended(here: Path) -> None:
    make_site(Path("var/site"), "lab")
    assert run("init", "lab").exit_code == 0
    assert load(Path("gyrofree.toml")).bus.prefix == "lab"
    twice = run("init", "lab")
    assert twice.exit_code == 2 and "place of lab already" in twice.output
    # the same at an office
    invited = invite(Path("var/site"), "office", "viewer", "tls/x:1", dt.timedelta(days=1))[0]
    folder = here / "office"
    place = Place(site="lab", place="office", home="lab", seat="viewer")
    issue_here(folder, Authority(Path("var/site")), place, ("dashboard",))
    save_place(folder, place)
    made = run("join", invited.line(), "--folder", "office", "--config", "office.toml")
    bus = load(Path("office.toml")).bus
    assert made.exit_code == 0 and bus.tls == Path("office")
    # what comes from outside does not stand in one queue with its own processes
    assert bus.router == "tls/127.0.0.1:7448" and bus.listen == [bus.router, "tls/0.0.0.0:7447"]


def test_a_certificate_that_is_damaged_or_gone_is_made_anew_at_home(here: Path) -> None:
    assert run("init", "lab").exit_code == 0
    folder = Path("var/site")
    (folder / "estimator.pem").write_text("junk")
    (folder / "gateway.key").write_bytes((folder / "router.key").read_bytes())
    (folder / "recorder.pem").unlink()
    shown = run("show")
    assert shown.exit_code == 2 and "certs renew estimator" in shown.output
    for words in (["estimator"], ["recorder"], []):
        assert CliRunner().invoke(app, ["certs", "renew", *words]).exit_code == 0
    assert all(is_whole(folder, role) for role in SERVICES)
