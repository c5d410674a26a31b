"""What the pages and the REST interface share: the services behind them, and who is asking."""

import math
from collections import Counter
from collections.abc import Callable, Collection
from dataclasses import dataclass, field

from fastapi import HTTPException, Request

from dashboard.data.store import Store
from dashboard.desk import Desk
from dashboard.settings import DashboardSettings
from dashboard.web.accounts.audit import Audit
from dashboard.web.auth import Gate, Role, SignIn, User, WaitError, same_token
from dashboard.web.command.seats import Seats
from dashboard.web.control import Replay
from dashboard.web.first.control import FirstRun
from dashboard.web.guard import STILL
from dashboard.web.jobs import Jobs
from dashboard.web.places.lookers import Lookers
from dashboard.web.readings import Readings
from dashboard.web.tls.certificate import Certificate
from dashboard.web.uploads import Uploads
from dashboard.web.users import UsersError
from dashboard.web.views import Views
from messages.contract import gyrofree_pb2 as pb
from sessions.library.catalogue import Catalogue

METRICS = "/metrics"  # asked for by programs only, as all below /api/ is


@dataclass
class Front:
    """Everything the web side talks to. Without bus (store, desk) or replay the pages say that it
    is not there.
    """

    settings: DashboardSettings
    gate: Gate
    catalogue: Catalogue
    scene_port: Callable[[], int]
    store: Store | None = None
    desk: Desk | None = None
    replay: Replay | None = None
    jobs: Jobs | None = None
    first_run: FirstRun | None = None  # while there is no board, and where one can be configured
    readings: Readings = field(default_factory=Readings)
    uploads: Uploads = field(default_factory=Uploads)
    certificate: Certificate | None = None  # of the port, where it speaks TLS by itself
    open_labels: Collection[str] = ()  # of the scene's inputs that concern nobody else
    ended: Counter[str] = field(default_factory=Counter)  # why -> connections that were ended
    lookers: Lookers = field(default_factory=Lookers)  # people, by role
    views: Views = field(init=False)
    seats: Seats = field(init=False)

    def __post_init__(self) -> None:
        users = self.settings.users
        self.views = Views(users.with_name(users.name + ".views"))
        self.seats = Seats(self.gate)


@dataclass(frozen=True)
class Asker:
    """The signed-in user of a request."""

    session: SignIn
    user: User
    token: str = ""  # id of the API token that he showed; empty: his browser's cookie

    @property
    def name(self) -> str:
        return self.user.name

    @property
    def role(self) -> Role:
        return self.user.role


def seat_of(request: Request, who: Asker) -> pb.Seat:
    """The seat that a request orders from: a sign-in, or a token."""
    front = front_of(request)
    name = f"t-{who.token}" if who.token else front.seats.of_key(front.gate.key_of(request))
    return pb.Seat(id=name, user=who.name[:60], admin=who.role >= Role.admin)


def desk_of(request: Request, who: Asker) -> Desk | None:
    """The desk of who asks; None without a bus."""
    desk = front_of(request).desk
    return None if desk is None else desk.of(seat_of(request, who))


def front_of(request: Request) -> Front:
    """The Front of the application this request came to."""
    return request.app.state.front


def address_of(request: Request) -> str:
    """Address of the client, for waiting times and the log."""
    return request.client.host if request.client else "unknown"


def asker(request: Request) -> Asker:
    """Who asks: by his cookie, or for REST by an API token in `Authorization: Bearer`; HTTP 401
    for nobody.
    """
    who = _asker(request)
    request.scope[STILL] = lambda: still_may(request, who)
    return who


def still_may(request: Request, who: Asker) -> bool:
    """Does the right stand with which he asked, while the answer is sent?"""
    gate = front_of(request).gate
    try:
        if who.token:
            secret = request.headers["authorization"].partition(" ")[2].strip()
            return gate.tokens.find(secret) is not None
        return gate.session_of(request) is not None
    except UsersError:
        return False


def _asker(request: Request) -> Asker:
    path = request.url.path
    if "authorization" in request.headers and (path.startswith("/api/") or path == METRICS):
        return _by_token(request)
    front = front_of(request)
    found = front.gate.session_of(request)
    if found is None:
        raise HTTPException(401, "sign in first")
    who = Asker(*found)
    front.lookers.saw(who.session.csrf, who.role.name)
    return who


def _by_token(request: Request) -> Asker:
    """Who shows a token; HTTP 401 for one that is none, 429 for too many requests."""
    gate = front_of(request).gate
    scheme, _, secret = request.headers["authorization"].partition(" ")
    found = gate.tokens.find(secret.strip()) if scheme.lower() == "bearer" else None
    if found is None:
        try:
            gate.backoff.attempt(address_of(request), "API token")
        except WaitError as wait:
            raise _wait(str(wait).replace("passwords", "tokens"), wait.seconds) from None
        gate.audit.refused("API token", "", address_of(request), request.url.path)
        raise HTTPException(
            401,
            "this token is unknown, revoked or past its end; want Authorization: Bearer TOKEN",
            {"www-authenticate": "Bearer"},
        )
    token, user = found
    if seconds := gate.tokens.wait_s(token):
        raise _wait(f"token {token.name!r} asks too often: wait {seconds:.2f} s", seconds)
    return Asker(SignIn(user.name, "", token.created, token.created), user, token.id)


def _wait(text: str, seconds: float) -> HTTPException:
    return HTTPException(429, text, {"retry-after": str(max(1, math.ceil(seconds)))})


def needs(role: Role) -> Callable[[Request], Asker]:
    """A dependency for orders by REST: that role at least, and the session's token in
    X-CSRF-Token.
    """

    def check(request: Request) -> Asker:
        who = asker(request)
        # a token is sent by no browser on its own, so no other site can borrow it
        if not who.token and not same_token(
            request.headers.get("x-csrf-token", ""), who.session.csrf
        ):
            audit_of(request).refused(_act(request), who.name, address_of(request), "X-CSRF-Token")
            raise HTTPException(
                403,
                "the header X-CSRF-Token is missing or is not this session's; GET /api/me has it",
            )
        check_role(who, role, request)
        return who

    return check


def check_role(who: Asker, role: Role, request: Request) -> None:
    """HTTP 403 unless this user has the role; orders and refusals stand in the audit log."""
    audit, where = audit_of(request), address_of(request)
    by = f"as {who.role.name}" + (f" by token {who.token}" if who.token else "")
    if who.role < role:
        audit.refused(_act(request), who.name, where, f"{by}, takes {role.name}")
        raise HTTPException(
            403, f"{who.name} is signed in as {who.role.name}; this takes the role {role.name}"
        )
    # what everybody may do, such as to have his own view kept, would wash the rest out of the log
    if request.method not in ("GET", "HEAD") and role > Role.viewer:
        audit.done(_act(request), who.name, where, by)


def audit_of(request: Request) -> Audit:
    """Where acts are written down."""
    return front_of(request).gate.audit


def _act(request: Request) -> str:
    return f"{request.method} {request.url.path}"
