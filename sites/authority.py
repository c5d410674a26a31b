"""The site's own certificate authority, and the register of all that it issued.

Keys are on P-256, certificates end after months, not years, and each has a common name of its own,
`<role>.<place>`, by which the routers know what its holder may do. Zenoh asks no list of revoked
certificates; what is revoked here loses its name in the routers' rules, and with it every right,
and its common name is never given again.
"""

import datetime as dt
import ipaddress
from pathlib import Path

from cryptography import x509
from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID
from pydantic import BaseModel, ConfigDict

from inertial.one_at_a_time import alone
from messages.bus.tls import TRUSTED
from messages.contract.names import NAME, Name
from sites.place import SiteError, load_list, save_list, write
from sites.roles import ROLES

KEY, REGISTER = "authority/ca.key", "authority/register.json"
AUTHORITY_DAYS = 10 * 365
DAYS = 90  # of a certificate; renewed when a third of that is left
BACKDATED = dt.timedelta(minutes=10)  # clocks of two places differ
HOSTS = ("localhost", "127.0.0.1", "::1")  # every router is reached from its own machine


class Issued(BaseModel):
    """One certificate that was issued."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    common_name: str
    role: str
    place: Name
    devices: tuple[Name, ...] = ()  # of a gateway: the boards whose keys it may publish
    serial: str
    ends: dt.datetime
    revoked: dt.datetime | None = None

    def stands(self, now: dt.datetime) -> bool:
        """Does it give any right at this time?"""
        return self.revoked is None and now < self.ends


class Authority:
    """Issues, renews and revokes; its files are read anew for each call, as several processes use
    them.
    """

    def __init__(self, folder: Path) -> None:
        """Raises SiteError where this folder has no authority, or one that cannot be read."""
        self._folder = folder
        try:
            self._key = serialization.load_pem_private_key((folder / KEY).read_bytes(), None)
            self.certificate = x509.load_pem_x509_certificate((folder / TRUSTED).read_bytes())
        except FileNotFoundError:
            raise SiteError(
                f"{folder} has no authority: certificates are issued at the site's home, where"
                " `gyrofree site init` was run"
            ) from None
        except (OSError, ValueError, TypeError) as error:
            raise SiteError(f"{folder / KEY} or {TRUSTED} cannot be read: {error}") from None
        if self._key.public_key() != self.certificate.public_key():
            raise SiteError(f"{folder}: {KEY} is not the key of {TRUSTED}: restore both together")

    @classmethod
    def create(cls, folder: Path, site: str) -> "Authority":
        """A new one; raises SiteError where there is one already."""
        if (folder / KEY).exists():
            raise SiteError(f"{folder} has an authority already: it is not replaced")
        key, now = new_key(), dt.datetime.now(dt.UTC)
        name = _name(f"authority of {site}")
        identifier = x509.SubjectKeyIdentifier.from_public_key(key.public_key())
        certificate = (
            _builder(name, name, key.public_key(), now, dt.timedelta(days=AUTHORITY_DAYS))
            .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
            .add_extension(_usage(signs=True), critical=True)
            .add_extension(identifier, critical=False)
            .sign(key, hashes.SHA256())
        )
        write(folder / KEY, private_pem(key))
        write(folder / TRUSTED, pem(certificate), 0o644)
        return cls(folder)

    def issue(
        self,
        request: x509.CertificateSigningRequest,
        role: str,
        place: str,
        *,
        name: str = "",
        devices: tuple[str, ...] = (),
        hosts: tuple[str, ...] = (),
        life: dt.timedelta = dt.timedelta(days=DAYS),
    ) -> x509.Certificate:
        """A certificate for the key of a request, which must be signed by that key. What else the
        request wishes does not count: name, hosts and end are decided here. name: of the machine,
        where a place has several; else the place's. Raises SiteError.
        """
        _checked(request)
        if role not in ROLES:
            raise SiteError(f"no role {role!r}: want one of {', '.join(ROLES)}")
        for text in (place, name or place):
            if not NAME.fullmatch(text):
                raise SiteError(f"name {text[:40]!r}: want a-z, 0-9, _ and - after a first letter")
        with alone(self._folder):
            return self._issue(request, role, place, name or place, devices, hosts, life)

    def _issue(
        self,
        request: x509.CertificateSigningRequest,
        role: str,
        place: str,
        name: str,
        devices: tuple[str, ...],
        hosts: tuple[str, ...],
        life: dt.timedelta,
    ) -> x509.Certificate:
        now, register = dt.datetime.now(dt.UTC), self.register()
        common_name = _free_name(f"{role}.{name}", place, register)
        names = [_host(host) for host in dict.fromkeys((*HOSTS, *hosts))]
        key_id = x509.AuthorityKeyIdentifier.from_issuer_public_key(self._key.public_key())
        usages = [ExtendedKeyUsageOID.SERVER_AUTH, ExtendedKeyUsageOID.CLIENT_AUTH]
        certificate = (
            _builder(_name(common_name), self.certificate.subject, request.public_key(), now, life)
            .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
            .add_extension(_usage(signs=False), critical=True)
            .add_extension(x509.SubjectAlternativeName(names), critical=False)
            .add_extension(x509.ExtendedKeyUsage(usages), critical=False)
            .add_extension(key_id, critical=False)
            .sign(self._key, hashes.SHA256())
        )
        entry = Issued(
            common_name=common_name,
            role=role,
            place=place,
            devices=devices,
            serial=f"{certificate.serial_number:x}",
            ends=certificate.not_valid_after_utc,
        )
        self._save([*register, entry])
        return certificate

    def revoke(self, common_name: str) -> int:
        """Take a common name from all certificates that have it; how many. Raises SiteError."""
        with alone(self._folder):
            return self._revoke(common_name)

    def _revoke(self, common_name: str) -> int:
        register, now = self.register(), dt.datetime.now(dt.UTC)
        meant = [each for each in register if each.common_name == common_name]
        if not meant:
            known = ", ".join(dict.fromkeys(each.common_name for each in register)) or "none"
            raise SiteError(f"no certificate {common_name!r} was issued here; there are {known}")
        ended = {"revoked": now}
        self._save(
            [
                each.model_copy(update=ended)
                if each.common_name == common_name and each.revoked is None
                else each
                for each in register
            ]
        )
        return sum(each.revoked is None for each in meant)

    def register(self) -> list[Issued]:
        """All that was ever issued, the oldest first; raises SiteError."""
        remedy = "restore it from a backup: without it nothing can be issued or revoked"
        return load_list(self._folder / REGISTER, Issued, remedy)

    def _save(self, register: list[Issued]) -> None:
        save_list(self._folder / REGISTER, register)


def new_key() -> ec.EllipticCurvePrivateKey:
    """A private key."""
    return ec.generate_private_key(ec.SECP256R1())


def request_for(key: ec.EllipticCurvePrivateKey, name: str) -> x509.CertificateSigningRequest:
    """A request to certify a key."""
    builder = x509.CertificateSigningRequestBuilder().subject_name(_name(name))
    return builder.sign(key, hashes.SHA256())


def pem(certificate: x509.Certificate) -> bytes:
    """As text."""
    return certificate.public_bytes(serialization.Encoding.PEM)


def private_pem(key: ec.EllipticCurvePrivateKey) -> bytes:
    """As text, without a password: the file is the owner's alone."""
    return key.private_bytes(
        serialization.Encoding.PEM,
        serialization.PrivateFormat.PKCS8,
        serialization.NoEncryption(),
    )


def _checked(request: x509.CertificateSigningRequest) -> None:
    key = request.public_key()
    if not isinstance(key, ec.EllipticCurvePublicKey) or key.curve.name != "secp256r1":
        raise SiteError("a request has a key of another kind: want one on P-256")
    try:
        signed = request.is_signature_valid
    except (InvalidSignature, ValueError):
        signed = False
    if not signed:
        raise SiteError("a request is not signed by its own key")


def _free_name(wanted: str, place: str, register: list[Issued]) -> str:
    """The name itself where no certificate of it was revoked and none is of another place, whose
    rights would come with the name; else with a number.
    """
    taken = {e.common_name for e in register if e.revoked is not None or e.place != place}
    number, name = 1, wanted
    while name in taken:
        number += 1
        name = f"{wanted}-{number}"
    return name


def _name(common_name: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, common_name)])


def _host(text: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ipaddress.ip_address(text))
    except ValueError:
        return x509.DNSName(text)


def _builder(
    name: x509.Name,
    issuer: x509.Name,
    key: ec.EllipticCurvePublicKey,
    now: dt.datetime,
    life: dt.timedelta,
) -> x509.CertificateBuilder:
    return (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(issuer)
        .public_key(key)
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - BACKDATED)
        .not_valid_after(now + life)
    )


def _usage(signs: bool) -> x509.KeyUsage:
    return x509.KeyUsage(
        digital_signature=not signs,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=not signs,
        key_cert_sign=signs,
        crl_sign=signs,
        encipher_only=False,
        decipher_only=False,
    )
