"""Key and certificate for a process on another machine, as a folder to be carried there."""

import datetime as dt
from pathlib import Path

from inertial.one_at_a_time import alone
from messages.bus.tls import TRUSTED
from sites.authority import Authority, Issued, pem
from sites.enrolment import load_request, new_requests
from sites.place import SiteError, load_place, new_folder, write, write_identity
from sites.roles import ROLES


def hand_out(
    authority: Authority,
    folder: Path,
    role: str,
    name: str,
    devices: tuple[str, ...],
    life: dt.timedelta,
    out: Path,
) -> Issued:
    """Write `<role>.pem`, `<role>.key` and ca.pem to `out`. Raises SiteError, OSError."""
    if role in ("join", "router", "authority") or role not in ROLES:
        wanted = [each for each in ROLES if each not in ("join", "router", "authority")]
        raise SiteError(f"no certificate of role {role!r} is handed out: want {', '.join(wanted)}")
    if bool(devices) != (role == "gateway"):
        raise SiteError("a gateway's certificate names its boards (--board), others none")
    with alone(folder):
        ((key, request),) = new_requests((role,)).values()
        place = load_place(folder)
        here = place.place
        if name in {peer.place for peer in place.peers}:
            raise SiteError(f"{name} is a place of this site: choose another name for the machine")
        if any(each.common_name == f"{role}.{name}" for each in authority.register()):
            raise SiteError(
                f"{role}.{name} was issued already: choose another name for the machine"
            )
        with new_folder(out) as draft:
            write(draft / TRUSTED, (folder / TRUSTED).read_bytes(), 0o644)
            certificate = authority.issue(
                load_request(request), role, here, name=name, devices=devices, life=life
            )
            write_identity(draft, role, key, pem(certificate))
        return authority.register()[-1]
