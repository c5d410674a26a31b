"""Joining a site and renewing certificates: what is asked over the bus, and what home answers.

Home calls the place that joins, so that no port of home has to be open; over that link the new
place asks once, with the secret of its invitation, for certificates of the keys that it has made.
Asking again with the same secret and the same keys gives the same rights: an answer may be lost.
Renewal is asked with a signature by the key of the certificate that is to be renewed.
"""

import base64
import datetime as dt
import hmac
import json
import logging
from pathlib import Path
from typing import TypeVar

from cryptography import x509
from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from inertial.one_at_a_time import alone
from messages.bus.tls import TRUSTED, key_of
from sites.authority import Authority, Issued, new_key, pem, private_pem, request_for
from sites.invitation import hashed, load_book, save_book
from sites.place import (
    Peer,
    Place,
    SiteError,
    load_list,
    load_place,
    save_list,
    save_place,
    write,
    write_identity,
)

AWAY = ("router", "dashboard", "operator", "authority")  # certificates of a place that watches
KNOWN = "known.json"  # what home said of the certificates that count in a place
LARGEST = 64_000  # bytes of a question
LARGEST_ANSWER = 8 << 20  # of what home gives: a site of many machines has many names
MOST_STANDING = 20  # certificates of one name that are renewed over the bus
M = TypeVar("M", bound=BaseModel)
Text = Field(max_length=8_000)

log = logging.getLogger(__name__)
CALLING = ("router", "authority")  # at home, those who connect to other places


class JoinRequest(BaseModel):
    """What a place that joins says."""

    model_config = ConfigDict(extra="forbid")

    place: str = Field(max_length=32)
    secret: str = Field(max_length=200)
    requests: dict[str, str] = Field(max_length=len(AWAY))  # by role, PEM


class RenewRequest(BaseModel):
    """What the holder of a certificate says who wants one for longer."""

    model_config = ConfigDict(extra="forbid")

    certificate: str = Text  # PEM, the old one
    request: str = Text  # PEM, for the new key
    signature: str = Text  # base64, of `request` by the old key


class Answer(BaseModel):
    """What home gives."""

    model_config = ConfigDict(extra="forbid")

    certificates: dict[str, str]
    known: list[Issued]
    place: Place | None = None


class Registrar:
    """Home's end. Each method raises SiteError with a reason that may be told."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def join(self, question: bytes) -> bytes:
        """Certificates for a place that shows the secret of an invitation."""
        asked = _read(JoinRequest, question)
        with alone(self._folder):
            return self._join(asked)

    def _join(self, asked: JoinRequest) -> bytes:
        here, book = load_place(self._folder), load_book(self._folder)
        entry = next((each for each in book if each.place == asked.place), None)
        given = hashed(asked.secret.encode())
        if entry is None or not hmac.compare_digest(given, entry.secret_sha256):
            raise SiteError(f"there is no invitation of this secret for {asked.place!r}")
        if entry.ends < dt.datetime.now(dt.UTC):
            raise SiteError("the invitation has ended: have another one printed")
        which = hashed(json.dumps(asked.requests, sort_keys=True).encode())
        if entry.used not in ("", which):
            raise SiteError("the invitation was used already, by other keys: have another one")
        if set(asked.requests) != set(AWAY):
            raise SiteError(f"want requests for {', '.join(AWAY)}")
        authority = Authority(self._folder)
        requests = {role: load_request(text) for role, text in asked.requests.items()}
        peer = next(each for each in here.peers if each.place == entry.place)
        names = [e.common_name for e in authority.register() if e.place == entry.place]
        _not_too_often(authority, names, dt.datetime.now(dt.UTC))
        # noted before anything is issued: killed here, the same keys may ask again, others not
        used = entry.model_copy(update={"used": which})
        save_book(self._folder, [used if each is entry else each for each in book])
        certificates = {
            role: pem(authority.issue(request, role, entry.place, hosts=peer.hosts)).decode()
            for role, request in requests.items()
        }
        log.info("%s has joined the site, its people as %s", entry.place, entry.seat)
        home = Peer(place=here.home, seat="operator", address="")  # it calls
        place = Place(
            site=here.site, place=entry.place, home=here.home, seat=entry.seat, peers=(home,)
        )
        known = _standing(authority, entry.place, here.home)
        return _pack(Answer(certificates=certificates, known=known, place=place))

    def renew_own(self, question: bytes) -> bytes:
        """The same for a place that has the authority's key in its folder: also of one that ended,
        as after months in which the lab was switched off.
        """
        return self.renew(question, load_place(self._folder).home)

    def renew(self, question: bytes, ended_of: str = "") -> bytes:
        """A certificate for longer, for who holds one that still stands; ended_of: a place whose
        may have ended.
        """
        asked = _read(RenewRequest, question)
        with alone(self._folder):
            return self._renew(asked, ended_of)

    def _renew(self, asked: RenewRequest, ended_of: str) -> bytes:
        authority = Authority(self._folder)
        try:
            old = x509.load_pem_x509_certificate(asked.certificate.encode())
            old.verify_directly_issued_by(authority.certificate)
            signature = base64.b64decode(asked.signature, validate=True)
            key = old.public_key()
            if not isinstance(key, ec.EllipticCurvePublicKey):
                raise SiteError("the old certificate has a key of another kind")
            key.verify(signature, asked.request.encode(), ec.ECDSA(hashes.SHA256()))
        except (ValueError, TypeError, InvalidSignature):
            raise SiteError("the old certificate is not of this site, or not the asker's") from None
        serial, now = f"{old.serial_number:x}", dt.datetime.now(dt.UTC)
        entry = next((each for each in authority.register() if each.serial == serial), None)
        stands = entry is not None and (
            entry.stands(now) or (entry.place == ended_of and entry.revoked is None)
        )
        if not stands:
            raise SiteError("the old certificate has ended or was revoked: join the site again")
        if not ended_of:
            _not_too_often(authority, [entry.common_name], now)
        hosts = tuple(
            str(name.value)
            for name in old.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
        )
        request = load_request(asked.request)
        name = entry.common_name.partition(".")[2]
        new = authority.issue(
            request, entry.role, entry.place, name=name, devices=entry.devices, hosts=hosts
        )
        home = load_place(self._folder).home
        known = _standing(authority, entry.place, home)
        return _pack(Answer(certificates={entry.role: pem(new).decode()}, known=known))


def new_requests(roles: tuple[str, ...] = AWAY) -> dict[str, tuple[bytes, str]]:
    """By role a new key and the request for its certificate, both PEM."""
    made = {}
    for role in roles:
        key = new_key()
        text = request_for(key, role).public_bytes(serialization.Encoding.PEM).decode()
        made[role] = private_pem(key), text
    return made


def is_whole(folder: Path, role: str) -> bool:
    """Are key and certificate of a role there, and of one another?"""
    try:
        certificate = x509.load_pem_x509_certificate((folder / f"{role}.pem").read_bytes())
        key = serialization.load_pem_private_key(key_of(folder, role).read_bytes(), None)
    except (OSError, ValueError, TypeError):
        return False
    return key.public_key() == certificate.public_key()


def renewal(folder: Path, role: str) -> tuple[bytes, bytes]:
    """A new key, PEM, and the question that renews the certificate of a role. Raises OSError,
    ValueError for files that cannot be read.
    """
    old = serialization.load_pem_private_key(key_of(folder, role).read_bytes(), None)
    ((key, request),) = new_requests((role,)).values()
    signature = old.sign(request.encode(), ec.ECDSA(hashes.SHA256()))
    asked = RenewRequest(
        certificate=(folder / f"{role}.pem").read_text(),
        request=request,
        signature=base64.b64encode(signature).decode(),
    )
    return key, asked.model_dump_json().encode()


def keep(folder: Path, answer: bytes, keys: dict[str, bytes], trusted: bytes) -> Answer:
    """Write what home gave, after a look at it; raises SiteError for what is not of this site."""
    given = _read(Answer, answer, LARGEST_ANSWER)
    authority = x509.load_pem_x509_certificate(trusted)
    if set(given.certificates) != set(keys):
        raise SiteError(f"home gave {', '.join(given.certificates)}: want {', '.join(keys)}")
    for role, text in given.certificates.items():
        try:
            certificate = x509.load_pem_x509_certificate(text.encode())
            certificate.verify_directly_issued_by(authority)
        except (ValueError, TypeError, InvalidSignature):
            raise SiteError(f"what home gave for {role} is not of this site") from None
        mine = serialization.load_pem_private_key(keys[role], None).public_key()
        if certificate.public_key() != mine:
            raise SiteError(f"home gave a certificate of another key for {role}")
    write(folder / TRUSTED, trusted, 0o644)
    for role, text in given.certificates.items():
        write_identity(folder, role, keys[role], text.encode())
    save_list(folder / KNOWN, given.known)
    if given.place is not None:
        save_place(folder, given.place)
    return given


def known_here(folder: Path, place: Place) -> list[Issued]:
    """The certificates that give rights in a place, as far as it knows; raises SiteError."""
    if place.at_home:
        return Authority(folder).register()
    if not (folder / KNOWN).is_file():
        raise SiteError(f"{folder / KNOWN} is not there: join the site again")
    return load_list(folder / KNOWN, Issued, "join the site again")


def _not_too_often(authority: Authority, names: list[str], now: dt.datetime) -> None:
    """Raises SiteError: who asks again and again would fill home's register, and its disk."""
    for name in names:
        standing = [e for e in authority.register() if e.common_name == name and e.stands(now)]
        if len(standing) >= MOST_STANDING:
            raise SiteError(f"{len(standing)} certificates of {name} stand already: use the last")


def _standing(authority: Authority, place: str, home: str) -> list[Issued]:
    """What a place has to know: its own certificates, and those of home that call there; of each
    name the last.
    """
    now = dt.datetime.now(dt.UTC)
    meant = {
        each.common_name: each
        for each in authority.register()
        if each.stands(now)
        and (each.place == place or (each.place == home and each.role in CALLING))
    }
    return list(meant.values())


def _read(model: type[M], content: bytes, most: int = LARGEST) -> M:
    if len(content) > most:
        raise SiteError(f"{len(content)} bytes are too much: want at most {most}")
    try:
        return model.model_validate_json(content)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or "the whole"
        raise SiteError(f"not a {model.__name__}: {where}: {first['msg']}") from None


def load_request(text: str) -> x509.CertificateSigningRequest:
    """A request from its PEM; raises SiteError."""
    try:
        return x509.load_pem_x509_csr(text.encode())
    except ValueError:
        raise SiteError("a request for a certificate cannot be read: want PEM") from None


def _pack(answer: Answer) -> bytes:
    return answer.model_dump_json().encode()
