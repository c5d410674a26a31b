"""Who a process is on the bus: its certificate, its key, and whom it trusts.

The files lie in one folder, `<role>.pem` and `<role>.key` beside `ca.pem`, as `gyrofree site`
writes them. With a folder every link is TLS with certificates on both sides; there is no mixture.
"""

import datetime as dt
import json
from pathlib import Path
from typing import Any

from cryptography import x509
from cryptography.hazmat.primitives import serialization
from cryptography.x509.oid import NameOID

from messages.bus.faults import IdentityError
from messages.contract.names import NAME

TRUSTED = "ca.pem"
NEXT = ".next"  # of a key's name, until its certificate is there


def values(folder: Path, role: str) -> dict[str, Any]:
    """Zenoh's settings for a process of this role; raises IdentityError where a file is missing."""
    certificate, key = folder / f"{role}.pem", key_of(folder, role)
    for path in (folder / TRUSTED, certificate, key):
        if not path.is_file():
            raise IdentityError(
                f"[bus] tls = {str(folder)!r}: {path.name} is not there, which the {role} needs;"
                f" `gyrofree certs list` shows what this place has"
            )
    tls = {
        "root_ca_certificate": folder / TRUSTED,
        "listen_certificate": certificate,
        "listen_private_key": key,
        "connect_certificate": certificate,
        "connect_private_key": key,
    }
    return {
        "transport/link/protocols": ["tls"],
        "transport/link/tls": {name: str(path) for name, path in tls.items()}
        | {
            "enable_mtls": True,
            "verify_name_on_connect": True,
            # of a certificate that ends in mid-session: its rights end with it
            "close_link_on_expiration": True,
        },
    }


def key_of(folder: Path, role: str) -> Path:
    """The file with the key of a role's certificate. Who renews writes the new key beside the old
    one, then the certificate, then puts the key in its place; cut off before that last step, it is
    done here.
    """
    key, waiting = folder / f"{role}.key", folder / f"{role}.key{NEXT}"
    try:
        certificate = x509.load_pem_x509_certificate((folder / f"{role}.pem").read_bytes())
        mine = serialization.load_pem_private_key(waiting.read_bytes(), None).public_key()
    except (OSError, ValueError, TypeError):
        return key
    if mine != certificate.public_key():
        return key  # cut off earlier: the old pair is whole
    try:
        waiting.replace(key)
    except FileNotFoundError:
        return key  # another process did it in this moment
    except OSError:
        return waiting  # a folder that may only be read
    return key


def place_of(folder: Path, role: str) -> str:
    """The place that a process speaks for: of its folder or, where that was handed out for another
    machine, the machine's name in its certificate. Empty where neither can be read.
    """
    try:
        name = json.loads((folder / "place.json").read_bytes())["place"]
    except (OSError, ValueError, KeyError, TypeError):
        name = common_name(folder, role).partition(".")[2]
    return name if isinstance(name, str) and NAME.fullmatch(name) else ""


def common_name(folder: Path, role: str) -> str:
    """Of a role's certificate; empty where it cannot be read."""
    try:
        certificate = x509.load_pem_x509_certificate((folder / f"{role}.pem").read_bytes())
    except (OSError, ValueError):
        return ""
    found = certificate.subject.get_attributes_for_oid(NameOID.COMMON_NAME)
    return str(found[0].value) if found else ""


def life(folder: Path, role: str) -> tuple[dt.datetime, dt.datetime] | None:
    """When a role's certificate begins and ends; None where it cannot be read."""
    try:
        certificate = x509.load_pem_x509_certificate((folder / f"{role}.pem").read_bytes())
    except (OSError, ValueError):
        return None
    return certificate.not_valid_before_utc, certificate.not_valid_after_utc


def trouble(folder: Path, role: str) -> str:
    """What is wrong with a certificate at this moment, in words; empty: nothing that is seen."""
    try:
        certificate = x509.load_pem_x509_certificate((folder / f"{role}.pem").read_bytes())
        authority = x509.load_pem_x509_certificate((folder / TRUSTED).read_bytes())
    except (OSError, ValueError) as error:
        return f"{folder / role}.pem or {TRUSTED} cannot be read: {error}"
    now, form = dt.datetime.now(dt.UTC), "%Y-%m-%d %H:%M UTC"
    if now >= certificate.not_valid_after_utc:
        return (
            f"its certificate ended {certificate.not_valid_after_utc.strftime(form)}:"
            " `gyrofree certs renew` makes a new one"
        )
    if now < certificate.not_valid_before_utc:
        return (
            f"its certificate begins {certificate.not_valid_before_utc.strftime(form)}: is this"
            " machine's clock right?"
        )
    if certificate.issuer != authority.subject:
        return f"its certificate is not of the authority in {TRUSTED}: join the site again"
    return ""
