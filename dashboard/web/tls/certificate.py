"""The certificate of the web port: read, checked, taken anew when its files change, its end said.

A connection keeps the certificate that it began with, so a new one ends nothing. Files that are
written one after the other do not fit together for a moment: the old pair stays until they do.
"""

import logging
import ssl
import time
from datetime import UTC, datetime
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives.serialization import load_pem_private_key

from dashboard.settings import DashboardSettings

log = logging.getLogger(__name__)

# Forward secrecy and authenticated encryption; of TLS 1.3 all suites are such.
CIPHERS = "ECDHE+AESGCM:ECDHE+CHACHA20"
DAY_S = 86_400.0
WARN_DAYS = 30.0  # before its end, but not before the last quarter of a short life
LOOK_S = 1.0  # s between two looks at the files

Stamp = tuple[tuple[int, int, int], ...]


class CertificateError(ValueError):
    """A certificate or key that cannot be served; the text says which file and what to do."""


class Certificate:
    """The pair of files and what TLS is made of them; `context` is for new connections."""

    def __init__(self, certificate: Path, key: Path) -> None:
        """Raises CertificateError."""
        self._certificate, self._key = certificate, key
        self._stamp = self._now()
        self.context, self._leaf = self._load()
        self.renewed = 0  # times that other files were taken
        self.fault = ""  # of files that changed and cannot be served; the ones before still are
        self._looked = time.monotonic()
        self._said_s = 0.0  # monotonic; of the last word on its end
        self.say_end()

    @property
    def ends(self) -> datetime:
        """End of its validity, UTC."""
        return self._leaf.not_valid_after_utc

    @property
    def left_s(self) -> float:
        """Seconds to its end by the wall clock; negative after it."""
        return (self.ends - datetime.now(UTC)).total_seconds()

    @property
    def names(self) -> list[str]:
        """The hosts it is for."""
        try:
            found = self._leaf.extensions.get_extension_for_class(x509.SubjectAlternativeName)
        except x509.ExtensionNotFound:
            return []
        return [str(name.value) for name in found.value]

    @property
    def near_its_end(self) -> bool:
        """Time to renew it."""
        life_s = (self.ends - self._leaf.not_valid_before_utc).total_seconds()
        return self.left_s < min(WARN_DAYS * DAY_S, life_s / 4.0)

    def look(self) -> None:
        """Take other files when they are there. Cheap: to be called again and again."""
        now = time.monotonic()
        if now - self._looked < LOOK_S:
            return
        self._looked = now
        if now - self._said_s > DAY_S:
            self.say_end()
        stamp = self._now()
        if stamp == self._stamp:
            return
        self._stamp = stamp
        try:
            self.context, self._leaf = self._load()
        except CertificateError as error:
            self.fault = str(error)
            log.error("%s; the certificate from before goes on being served", error)
            return
        self.fault = ""
        self.renewed += 1
        log.info("%s: taken anew, for %s", self._certificate, ", ".join(self.names))
        self.say_end()

    def say_end(self) -> None:
        """One line where its end is near or past."""
        self._said_s = time.monotonic()
        day = self.ends.strftime("%Y-%m-%d %H:%M UTC")
        if self.left_s <= 0.0:
            log.error("%s ended on %s: browsers refuse it; renew it", self._certificate, day)
        elif self._leaf.not_valid_before_utc > datetime.now(UTC):
            log.error("%s is not valid yet: is this machine's clock right?", self._certificate)
        elif self.near_its_end:
            days = self.left_s / DAY_S
            log.warning("%s ends on %s, in %.1f days: renew it", self._certificate, day, days)

    def _now(self) -> Stamp:
        found = []
        for path in (self._certificate, self._key):
            try:
                status = path.stat()
            except OSError:
                found.append((0, 0, 0))
            else:
                found.append((status.st_mtime_ns, status.st_size, status.st_ino))
        return tuple(found)

    def _load(self) -> tuple[ssl.SSLContext, x509.Certificate]:
        leaf = _leaf(self._certificate)
        _check_key(self._key, leaf)
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.minimum_version = ssl.TLSVersion.TLSv1_2
        context.set_ciphers(CIPHERS)
        context.set_alpn_protocols(["http/1.1"])
        context.options |= (
            ssl.OP_NO_COMPRESSION | ssl.OP_NO_RENEGOTIATION | ssl.OP_CIPHER_SERVER_PREFERENCE
        )
        try:
            context.load_cert_chain(self._certificate, self._key)
        except (ssl.SSLError, OSError) as error:
            raise CertificateError(
                f"{self._certificate} and {self._key} cannot be served: {error}"
            ) from None
        return context, leaf


def _read(path: Path, key: str) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise CertificateError(
            f"[dashboard] {key} {path}: {error.strerror}; want a PEM file that the dashboard's"
            " user can read"
        ) from None


def _leaf(path: Path) -> x509.Certificate:
    """The first certificate of the file, which is the server's own; the chain comes after it."""
    try:
        return x509.load_pem_x509_certificates(_read(path, "tls_certificate"))[0]
    except ValueError as error:
        raise CertificateError(
            f"[dashboard] tls_certificate {path}: no certificate in PEM form ({error})"
        ) from None


def _check_key(path: Path, leaf: x509.Certificate) -> None:
    """That it can be read without asking somebody, and belongs to the certificate."""
    text = _read(path, "tls_key")
    try:
        key = load_pem_private_key(text, None)
    except TypeError:
        raise CertificateError(
            f"[dashboard] tls_key {path} is locked by a password: want one without"
        ) from None
    except Exception as error:  # of the library's, several kinds
        raise CertificateError(
            f"[dashboard] tls_key {path}: no private key in PEM form ({error})"
        ) from None
    if key.public_key() != leaf.public_key():
        raise CertificateError(f"[dashboard] tls_key {path} is not the key of the certificate")
    if path.stat().st_mode & 0o077:
        log.warning("%s can be read by others than its owner: chmod 600", path)


def open_certificate(settings: DashboardSettings) -> Certificate | None:
    """What the settings name; None where TLS is not the dashboard's. Raises CertificateError."""
    if settings.tls_certificate is None or settings.tls_key is None:
        return None
    return Certificate(settings.tls_certificate, settings.tls_key)
