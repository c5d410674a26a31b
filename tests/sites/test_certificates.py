"""Certificates, invitations, register: what is damaged, old, revoked or foreign is refused."""

import datetime as dt
import json
import stat
import string
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from messages.bus.tls import TRUSTED
from sites.authority import KEY, REGISTER, Authority, pem
from sites.enrolment import AWAY, JoinRequest, Registrar, keep, new_requests, renewal
from sites.invitation import HEAD, Invitation, invite, read_invitation
from sites.joining import make_site
from sites.place import SiteError, load_place
from sites.removal import remove
from sites.service import look, own_certificates

WEEK = dt.timedelta(days=7)


@pytest.fixture
def home(tmp_path: Path) -> Path:
    """A site's home."""
    make_site(tmp_path / "home", "lab")
    return tmp_path / "home"


def question(invitation: Invitation, requests: dict[str, str] | None = None, **other: str) -> bytes:
    """What a place asks that joins."""
    requests = requests or {role: request for role, (_, request) in new_requests().items()}
    asked = {"place": invitation.place, "secret": invitation.secret} | other
    return JoinRequest(**asked, requests=requests).model_dump_json().encode()


def test_secrets_are_for_the_owner_alone(home: Path) -> None:
    secret = [*home.glob("*.key"), home / KEY, home / REGISTER]
    assert len(secret) > 8
    assert all(stat.S_IMODE(path.stat().st_mode) == 0o600 for path in secret)


@pytest.mark.parametrize("address", ["office.example.org", "192.0.2.7", "[2001:db8::1]"])
def test_the_certificate_of_an_invitation_is_good_for_the_address_that_home_calls(
    home: Path, address: str
) -> None:
    """Home's router asks whoever answers there for it before the place has any of its own."""
    invitation, here = invite(home, "office", "viewer", f"tls/{address}:7447", WEEK)
    certificate = x509.load_pem_x509_certificate(invitation.certificate.encode())
    extension = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName)
    assert address.strip("[]") in {str(name.value) for name in extension.value}
    assert here.peers[-1].hosts == (address.strip("[]"),)


def test_a_place_joins_once_and_the_same_question_gets_an_answer_again(
    home: Path, tmp_path: Path
) -> None:
    invitation, _ = invite(home, "office", "viewer", "tls/office:7447", WEEK)
    made = new_requests()
    asked = question(invitation, {role: request for role, (_, request) in made.items()})
    registrar = Registrar(home)
    registrar.join(asked)  # the answer is lost
    answer = registrar.join(asked)
    with pytest.raises(SiteError, match="used already"):
        registrar.join(question(invitation))
    keys = {role: key for role, (key, _) in made.items()}
    keep(tmp_path / "office", answer, keys, invitation.trusted.encode())
    place = load_place(tmp_path / "office")
    assert (place.site, place.place, place.home, place.seat) == ("lab", "office", "lab", "viewer")
    with pytest.raises(SiteError, match="certificates are issued at the site's home"):
        Authority(tmp_path / "office")


def test_another_secret_an_old_invitation_and_a_removed_place_are_refused(home: Path) -> None:
    invitation, _ = invite(home, "office", "viewer", "tls/office:7447", WEEK)
    with pytest.raises(SiteError, match="no invitation of this secret"):
        Registrar(home).join(question(invitation, secret="x" * 43))
    with pytest.raises(SiteError, match="no invitation of this secret"):
        Registrar(home).join(question(invitation, place="another"))
    remove(home, "office")
    with pytest.raises(SiteError, match="no invitation"):
        Registrar(home).join(question(invitation))
    old, _ = invite(home, "office2", "viewer", "tls/office:7447", dt.timedelta(seconds=-1))
    with pytest.raises(SiteError, match="has ended"):
        Registrar(home).join(question(old))
    with pytest.raises(SiteError, match="ended"):
        read_invitation(old.line())


def test_a_clock_that_is_behind_is_said_before_home_is_waited_for_in_vain(
    home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sites.authority.BACKDATED", -dt.timedelta(days=1))  # home is a day ahead
    invitation, _ = invite(home, "office", "viewer", "tls/office:7447", WEEK)
    with pytest.raises(SiteError, match="clock says .*: set it right first"):
        read_invitation(invitation.line())


@pytest.fixture(scope="module")
def line(tmp_path_factory: pytest.TempPathFactory) -> str:
    """An invitation."""
    folder = tmp_path_factory.mktemp("site") / "home"
    make_site(folder, "lab")
    return invite(folder, "office", "viewer", "tls/office:7447", WEEK)[0].line()


@given(data=st.data())
@settings(max_examples=150)
def test_a_damaged_invitation_is_said_to_be_one(line: str, data: st.DataObject) -> None:
    at = data.draw(st.integers(0, len(line) - 1))
    inserted = data.draw(st.text(string.ascii_letters + string.digits + "-_=. é", max_size=3))
    taken = data.draw(st.integers(0, len(line) - at))
    spoilt = line[:at] + inserted + line[at + taken :]
    try:
        assert read_invitation(spoilt) == read_invitation(line)
    except SiteError as error:
        assert "invitation" in str(error)


@given(content=st.binary(max_size=300) | st.text().map(str.encode) | st.just(b"[" * 50_000))
@settings(max_examples=100, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_whatever_is_asked_there_is_an_answer(home: Path, content: bytes) -> None:
    for answer in (Registrar(home).join, Registrar(home).renew):
        with pytest.raises(SiteError):
            answer(content)


def test_renewal_needs_the_old_key_and_a_certificate_that_stands(home: Path) -> None:
    registrar = Registrar(home)
    _, asked = renewal(home, "gateway")
    registrar.renew(asked)
    forged = json.loads(asked) | {"certificate": (home / "recorder.pem").read_text()}
    with pytest.raises(SiteError, match="not of this site, or not the asker's"):
        registrar.renew(json.dumps(forged).encode())
    Authority(home).revoke("gateway.lab")
    with pytest.raises(SiteError, match="was revoked"):
        registrar.renew(asked)


def test_a_name_that_was_revoked_is_never_given_again(home: Path) -> None:
    authority = Authority(home)
    assert authority.revoke("gateway.lab") == 1
    with pytest.raises(SiteError, match="no certificate 'gateway.nowhere'"):
        authority.revoke("gateway.nowhere")
    request = x509.load_pem_x509_csr(new_requests(("gateway",))["gateway"][1].encode())
    new = authority.issue(request, "gateway", "lab")
    names = new.subject.get_attributes_for_oid(NameOID.COMMON_NAME)
    assert [name.value for name in names] == ["gateway.lab-2"]


def test_what_is_old_is_renewed_and_what_is_young_stays(home: Path) -> None:
    place, authority = load_place(home), Authority(home)
    key, text = new_requests(("gateway",))["gateway"]
    request = x509.load_pem_x509_csr(text.encode())
    short = authority.issue(request, "gateway", "lab", life=dt.timedelta(seconds=-500))
    (home / "gateway.pem").write_bytes(pem(short))
    (home / "gateway.key").write_bytes(key)
    young = (home / "recorder.pem").read_bytes()
    assert not look(home, place, Registrar(home).renew)  # over the bus: it could not ask
    assert (home / "recorder.pem").read_bytes() == young
    long = authority.issue(request, "gateway", "lab", life=dt.timedelta(seconds=100))
    (home / "gateway.pem").write_bytes(pem(long))
    assert look(home, place, Registrar(home).renew)
    renewed = x509.load_pem_x509_certificate((home / "gateway.pem").read_bytes())
    assert renewed.not_valid_after_utc - dt.datetime.now(dt.UTC) > dt.timedelta(days=60)
    assert (home / "recorder.pem").read_bytes() == young


def test_home_renews_what_ended_while_it_was_off_and_nothing_that_was_revoked(home: Path) -> None:
    place, authority = load_place(home), Authority(home)
    key, text = new_requests(("gateway",))["gateway"]
    request, life = x509.load_pem_x509_csr(text.encode()), dt.timedelta(seconds=-500)
    (home / "gateway.pem").write_bytes(pem(authority.issue(request, "gateway", "lab", life=life)))
    (home / "gateway.key").write_bytes(key)
    assert not look(home, place, Registrar(home).renew)  # as who is elsewhere might ask
    assert look(home, place, Registrar(home).renew_own)
    assert own_certificates(home)["gateway"] > dt.datetime.now(dt.UTC)
    authority.revoke("gateway.lab")
    with pytest.raises(SiteError, match="was revoked"):
        Registrar(home).renew_own(renewal(home, "gateway")[1])


@pytest.mark.parametrize(("role", "place"), [("king", "lab"), ("gateway", "Lab/../x")])
def test_no_certificate_for_roles_and_places_that_are_none(
    home: Path, role: str, place: str
) -> None:
    request = x509.load_pem_x509_csr(new_requests(("gateway",))["gateway"][1].encode())
    with pytest.raises(SiteError, match="no role|want a-z"):
        Authority(home).issue(request, role, place)


def test_a_request_with_another_kind_of_key_is_refused(home: Path) -> None:
    key = ec.generate_private_key(ec.SECP384R1())
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "x")])
    builder = x509.CertificateSigningRequestBuilder().subject_name(name)
    with pytest.raises(SiteError, match="P-256"):
        Authority(home).issue(builder.sign(key, hashes.SHA256()), "gateway", "lab")


@pytest.mark.parametrize("path", [REGISTER, KEY, TRUSTED, "place.json"])
def test_damaged_files_are_named(home: Path, path: str) -> None:
    (home / path).write_bytes(b"\x00not this")
    with pytest.raises(SiteError, match=Path(path).name):
        invite(home, "office", "viewer", "tls/office:7447", WEEK)


def test_home_asks_for_all_of_a_place(home: Path) -> None:
    invitation, _ = invite(home, "office", "viewer", "tls/office:7447", WEEK)
    some = {role: request for role, (_, request) in new_requests(AWAY[:2]).items()}
    with pytest.raises(SiteError, match="want requests for"):
        Registrar(home).join(question(invitation, some))
    assert invitation.line().startswith(HEAD)
