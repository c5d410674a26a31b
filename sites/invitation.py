"""An invitation: a line of text that lets one other place join the site, once.

It holds what a stranger needs for one question: the authority's certificate, a certificate that
may ask to join and nothing else, and a secret of which home keeps the hash. The keys of the place
that joins are made there and never leave it.
"""

import base64
import datetime as dt
import hashlib
import secrets
import zlib
from pathlib import Path

from cryptography import x509
from cryptography.exceptions import InvalidSignature
from pydantic import BaseModel, ConfigDict, ValidationError

from inertial.one_at_a_time import alone
from messages.contract.names import Name
from sites.authority import Authority, new_key, pem, private_pem, request_for
from sites.place import Peer, Place, Seat, SiteError, load_list, load_place, save_list, save_place

HEAD = "gyrofree-invitation-1-"
LONGEST = 16_000  # characters
BOOK = "authority/invitations.json"


class Invitation(BaseModel):
    """What the line says."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    site: Name
    home: Name
    place: Name
    seat: Seat
    ends: dt.datetime
    secret: str
    trusted: str  # PEM of the authority
    certificate: str  # PEM, of the role "join"
    key: str  # PEM

    def line(self) -> str:
        """As text that can be sent."""
        packed = zlib.compress(self.model_dump_json().encode(), 9)
        return HEAD + base64.urlsafe_b64encode(packed).decode()


class Entry(BaseModel):
    """What home remembers of an invitation."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    place: Name
    seat: Seat
    secret_sha256: str
    ends: dt.datetime
    common_name: str  # of the certificate in it
    used: str = ""  # sha256 of the request that used it


def read_invitation(line: str) -> Invitation:
    """What a line says; raises SiteError for one that is none or has ended."""
    text = "".join(line.split())
    if not text.startswith(HEAD) or len(text) > LONGEST:
        raise SiteError(
            f"{text[:24]!r} ... is no invitation: want the whole line that `gyrofree site invite`"
            f" printed; it begins with {HEAD}"
        )
    try:
        packed = base64.urlsafe_b64decode(text[len(HEAD) :])
        plain = zlib.decompressobj().decompress(packed, LONGEST)
        invitation = Invitation.model_validate_json(plain)
        trusted = x509.load_pem_x509_certificate(invitation.trusted.encode())
        certificate = x509.load_pem_x509_certificate(invitation.certificate.encode())
        certificate.verify_directly_issued_by(trusted)
    except (ValueError, TypeError, zlib.error, ValidationError, InvalidSignature):
        raise SiteError(
            "the invitation is damaged: copy the whole line, or have another one printed"
        ) from None
    now = dt.datetime.now(dt.UTC)
    if invitation.ends < now:
        raise SiteError(
            f"the invitation ended {invitation.ends:%Y-%m-%d %H:%M UTC}, and this machine's clock"
            f" says {now:%Y-%m-%d %H:%M UTC}: have another one printed at the site's home"
        )
    if now < certificate.not_valid_before_utc:  # no link to home would come about
        raise SiteError(
            f"the invitation begins {certificate.not_valid_before_utc:%Y-%m-%d %H:%M UTC}, and this"
            f" machine's clock says {now:%Y-%m-%d %H:%M UTC}: set it right first"
        )
    return invitation


def invite(
    folder: Path, place: str, seat: Seat, address: str, life: dt.timedelta
) -> tuple[Invitation, Place]:
    """Prepare for a place to join, at home: it becomes a peer whose router, at `address`, is
    called from now on. Raises SiteError.
    """
    with alone(folder):
        return _invite(folder, place, seat, address, life)


def _invite(
    folder: Path, place: str, seat: Seat, address: str, life: dt.timedelta
) -> tuple[Invitation, Place]:
    here, authority = load_place(folder), Authority(folder)
    if not here.at_home:
        raise SiteError(f"places are invited at the site's home, {here.home}")
    if place == here.place or any(each.place == place for each in here.peers):
        raise SiteError(f"{place} belongs to the site already: choose another name, or remove it")
    key, peer = new_key(), Peer(place=place, seat=seat, address=address)
    # the certificate that answers our router's call there until the place has its own
    certificate = authority.issue(
        request_for(key, "join"), "join", place, hosts=peer.hosts, life=life
    )
    entry = authority.register()[-1]
    invitation = Invitation(
        site=here.site,
        home=here.home,
        place=place,
        seat=seat,
        ends=entry.ends,
        secret=secrets.token_urlsafe(32),
        trusted=pem(authority.certificate).decode(),
        certificate=pem(certificate).decode(),
        key=private_pem(key).decode(),
    )
    known = Entry(
        place=place,
        seat=seat,
        secret_sha256=hashed(invitation.secret.encode()),
        ends=entry.ends,
        common_name=entry.common_name,
    )
    # in place of one that was cut off here, before anybody saw it
    others = [each for each in load_book(folder) if each.place != place]
    save_book(folder, [*others, known])
    here = here.model_copy(update={"peers": (*here.peers, peer)})
    save_place(folder, here)
    return invitation, here


def hashed(content: bytes) -> str:
    """What is kept of a secret."""
    return hashlib.sha256(content).hexdigest()


def load_book(folder: Path) -> list[Entry]:
    """All invitations of this home; raises SiteError."""
    remedy = "restore it from a backup, or remove it: invitations that are not used yet then end"
    return load_list(folder / BOOK, Entry, remedy)


def save_book(folder: Path, book: list[Entry]) -> None:
    """Write it as a whole."""
    save_list(folder / BOOK, book)
