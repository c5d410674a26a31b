"""What happens at a new place of a site: made at home, or joined from elsewhere."""

import json
import threading
import time
from collections.abc import Callable
from pathlib import Path

import zenoh

from inertial.one_at_a_time import alone
from messages.bus.session import BusSettings, open_router
from messages.bus.tls import TRUSTED
from sites.authority import Authority, pem
from sites.enrolment import JoinRequest, keep, load_request, new_requests
from sites.invitation import Invitation
from sites.place import (
    PLACE,
    Place,
    SiteError,
    load_place,
    new_folder,
    save_place,
    write,
    write_identity,
)
from sites.roles import SERVICES, join_key
from sites.service import HomeRefused, asked

JOINING = "joining"  # folder of the invitation's certificate, while it is needed
PAUSE_S = 1.0


def make_site(folder: Path, name: str, extra: tuple[str, ...] = ()) -> Place:
    """A new site whose home is here, with a certificate for each of its services. Raises
    SiteError.
    """
    _not_a_place(folder)
    place = Place(site=name, place=name, home=name)
    with new_folder(folder) as draft:
        issue_here(draft, Authority.create(draft, name), place, (*SERVICES, *extra))
        save_place(draft, place)
    return place


def _not_a_place(folder: Path) -> None:
    if (folder / PLACE).exists():
        raise SiteError(f"{folder} is a place of {load_place(folder).site} already")


def issue_here(folder: Path, authority: Authority, place: Place, roles: tuple[str, ...]) -> None:
    """Keys and certificates for processes of this place."""
    for role, (key, request) in new_requests(roles).items():
        certificate = authority.issue(load_request(request), role, place.place)
        write_identity(folder, role, key, pem(certificate))


def _requests_kept(folder: Path) -> dict[str, tuple[bytes, str]]:
    """Those of an earlier try, which home may have answered already; else new ones."""
    path = folder / "requests.json"
    try:
        kept = json.loads(path.read_bytes())
        return {role: (key.encode(), request) for role, (key, request) in kept.items()}
    except (OSError, ValueError, TypeError, AttributeError):
        made = new_requests()
        text = {role: (key.decode(), request) for role, (key, request) in made.items()}
        write(path, json.dumps(text).encode())
        return made


def join(
    folder: Path,
    invitation: Invitation,
    listen: str,
    stop: threading.Event,
    said: Callable[[str], None],
) -> Place:
    """Wait for home's call and ask it for this place's certificates. `said` gets what is waited
    for, once. Raises SiteError; OSError where the folder cannot be written, zenoh.ZError where
    nothing can listen at `listen`.
    """
    _not_a_place(folder)
    temporary = folder / JOINING
    temporary.mkdir(parents=True, exist_ok=True, mode=0o700)
    with alone(temporary):
        _not_a_place(folder)  # it may have become one while another joined here
        return _join(folder, temporary, invitation, listen, stop, said)


def _join(
    folder: Path,
    temporary: Path,
    invitation: Invitation,
    listen: str,
    stop: threading.Event,
    said: Callable[[str], None],
) -> Place:
    trusted = invitation.trusted.encode()
    write(temporary / TRUSTED, trusted, 0o644)
    write_identity(temporary, "join", invitation.key.encode(), invitation.certificate.encode())
    bus = BusSettings(prefix=invitation.site, listen=[listen], tls=temporary).acting_as("join")
    made = _requests_kept(temporary)
    keys = {role: key for role, (key, _) in made.items()}
    question = join_question(invitation, made)
    with open_router(bus) as session:
        told = False
        while not stop.is_set():
            if not list(session.info.routers_zid()):
                if not told:
                    said(f"listening at {listen}, waiting for {invitation.home} to call")
                    told = True
                stop.wait(PAUSE_S)
                continue
            answer = _patiently(session, join_key(invitation.site), question, stop)
            given = keep(folder, answer, keys, trusted)
            for path in temporary.iterdir():
                path.unlink()
            temporary.rmdir()
            return given.place
    raise SiteError("not joined: ended before home had answered; the invitation is still good")


def join_question(invitation: Invitation, made: dict[str, tuple[bytes, str]]) -> bytes:
    """What Registrar.join answers; made: of new_requests, for each role of the place."""
    asked = JoinRequest(
        place=invitation.place,
        secret=invitation.secret,
        requests={role: request for role, (_, request) in made.items()},
    )
    return asked.model_dump_json().encode()


def _patiently(session: zenoh.Session, key: str, question: bytes, stop: threading.Event) -> bytes:
    """Home's answer; a link that has just been made may need some seconds to bring it."""
    end = time.monotonic() + 30.0
    while True:
        try:
            return asked(session, key, question)
        except HomeRefused:
            raise
        except SiteError:
            if stop.is_set() or time.monotonic() > end:
                raise
        stop.wait(PAUSE_S)
