"""Who changes a site's files is killed between any two of its steps, or is not alone."""

import datetime as dt
import os
import shutil
import signal
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import serialization

from messages.bus.tls import key_of, values
from sites.authority import REGISTER, Authority
from sites.enrolment import JoinRequest, Registrar, keep, load_request, new_requests
from sites.invitation import Invitation, invite
from sites.joining import make_site
from sites.place import SiteError, load_place, save_list
from sites.removal import remove
from sites.service import own_certificates, renew

WEEK = dt.timedelta(days=7)
MADE = new_requests()


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site") / "home"
    make_site(folder, "lab")
    invite(folder, "here-already", "viewer", "tls/there:7447", WEEK)
    return folder


def killed_at(step: int, deed: Callable[[], object]) -> bool:
    """Do it in a process that kills itself before it puts its `step`th file in place; False when
    it came to its end before.
    """
    child = os.fork()
    if child == 0:
        left = [step]

        def hook(event: str, arguments: tuple) -> None:
            if event == "os.rename":
                left[0] -= 1
                if left[0] == 0:
                    os.kill(os.getpid(), signal.SIGKILL)

        sys.addaudithook(hook)
        try:
            deed()
        finally:
            os._exit(0)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == -signal.SIGKILL


def certificate_of_one(folder: Path) -> None:
    renew(folder, "gateway", Registrar(folder).renew_own)


def invitation_used(folder: Path) -> None:
    """Invite, and join with what was printed."""
    invitation, _ = invite(folder, "office", "viewer", "tls/there:7447", WEEK)
    join(folder, invitation)


def join(folder: Path, invitation: Invitation) -> None:
    requests = {role: request for role, (_, request) in MADE.items()}
    asked = JoinRequest(place="office", secret=invitation.secret, requests=requests)
    answer = Registrar(folder).join(asked.model_dump_json().encode())
    keys = {role: key for role, (key, _) in MADE.items()}
    keep(folder / "of-the-office", answer, keys, invitation.trusted.encode())


def whole(folder: Path) -> None:
    """Every process of the place can open its session."""
    for role in own_certificates(folder):
        values(folder, role)
        certificate = x509.load_pem_x509_certificate((folder / f"{role}.pem").read_bytes())
        key = serialization.load_pem_private_key(key_of(folder, role).read_bytes(), None)
        assert key.public_key() == certificate.public_key(), role


@pytest.mark.parametrize("deed", [certificate_of_one, invitation_used])
def test_killed_anywhere_it_can_be_done_again(
    deed: Callable[[Path], None], home: Path, tmp_path: Path
) -> None:
    for step in (*range(1, 6), *range(6, 40, 1 if deed is certificate_of_one else 4)):
        folder = tmp_path / f"home-{step}"
        shutil.copytree(home, folder)
        ended = not killed_at(step, lambda folder=folder: deed(folder))
        whole(folder)
        if ended:
            break
        if deed is invitation_used and "office" in {p.place for p in load_place(folder).peers}:
            remove(folder, "office")  # nobody knows what was printed
        deed(folder)
        whole(folder)
    assert 3 <= step < 40


def test_a_place_that_is_sent_away_is_gone_when_that_is_done_again(
    home: Path, tmp_path: Path
) -> None:
    for step in range(1, 40, 2):
        folder = tmp_path / f"home-{step}"
        shutil.copytree(home, folder)
        invitation_used(folder)
        ended = not killed_at(step, lambda folder=folder: remove(folder, "office"))
        if not ended:
            remove(folder, "office")
        now = dt.datetime.now(dt.UTC)
        standing = [e for e in Authority(folder).register() if e.stands(now)]
        assert not [e for e in standing if e.place == "office"]
        assert "office" not in {peer.place for peer in load_place(folder).peers}
        if ended:
            break
    assert 3 <= step < 40


def test_of_several_that_issue_and_revoke_at_once_nothing_is_lost(home: Path) -> None:
    authority = Authority(home)
    before = len(authority.register())

    def one(number: int) -> None:
        ((_, request),) = new_requests(("viewer",)).values()
        authority.issue(load_request(request), "viewer", "lab", name=f"m{number}")
        authority.revoke(f"viewer.m{number}")

    with ThreadPoolExecutor(4) as several:
        list(several.map(one, range(12)))
    register = authority.register()
    assert len(register) == before + 12
    mine = [e for e in register if e.role == "viewer"]
    assert len(mine) == 12 and all(e.revoked is not None for e in mine)


def test_a_name_that_another_place_has_is_not_given_with_its_rights(home: Path) -> None:
    """A machine of the lab and a place may be called the same, or come to be: `office-2`."""
    authority = Authority(home)

    def name_of(role: str, place: str, name: str = "") -> str:
        ((_, request),) = new_requests((role,)).values()
        made = authority.issue(load_request(request), role, place, name=name)
        return made.subject.rfc4514_string()

    assert name_of("operator", "lab", "alice") == "CN=operator.alice"
    assert name_of("operator", "alice") == "CN=operator.alice-2"
    assert name_of("router", "far") == "CN=router.far"
    authority.revoke("router.far")
    assert name_of("router", "far") == "CN=router.far-2"
    assert name_of("router", "far-2") == "CN=router.far-2-2"


def test_who_renews_again_and_again_is_refused_and_home_is_not(home: Path, tmp_path: Path) -> None:
    folder = tmp_path / "home"
    shutil.copytree(home, folder)
    registrar = Registrar(folder)
    with pytest.raises(SiteError, match="stand already"):
        for _ in range(21):
            renew(folder, "estimator", registrar.renew)
    register = Authority(folder).register()
    machines = [register[0].model_copy(update={"common_name": f"viewer.m{n}"}) for n in range(300)]
    save_list(folder / REGISTER, [*register, *machines])  # home's answer has them all
    renew(folder, "estimator", registrar.renew_own)
    whole(folder)
