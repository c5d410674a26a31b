"""Sign-in: server-side sessions, waiting times for wrong passwords, and the rule who may do what.

The cookie holds a random id only; everything else stays here, so that signing out or removing a
user takes effect at once. Ids are kept hashed, in memory and in a private file: a restarted
dashboard still knows who is signed in.
"""

import asyncio
import hashlib
import hmac
import json
import logging
import secrets
import threading
from collections.abc import Awaitable, Callable
from dataclasses import asdict, dataclass, field

from starlette.requests import HTTPConnection

from dashboard.settings import DashboardSettings
from dashboard.web.accounts.audit import Audit
from dashboard.web.accounts.backoff import Backoff, WaitError
from dashboard.web.accounts.bell import Bell
from dashboard.web.programs.tokens import TokenStore
from dashboard.web.users import (
    Role,
    User,
    UserStore,
    add_user,
    issue_link_token,
    redeem_link_token,
    write_private,
)
from messages.clock import Clock, Moment
from messages.text import plain

__all__ = [
    "Backoff",
    "Gate",
    "Role",
    "SignIn",
    "User",
    "UserStore",
    "WaitError",
    "add_user",
    "issue_link_token",
]

log = logging.getLogger(__name__)

SESSIONS = 1024  # sign-ins at a time
AGENT = 120  # characters kept of what a browser calls itself
LINK = "one-time link"  # can be nobody's name
PARALLEL = 2  # passwords verified at once: each takes 32 MiB and a core


@dataclass
class SignIn:
    """One sign-in; times in s since 1970 by the gate's clock, which nobody sets."""

    user: str
    csrf: str
    created: float
    seen: float
    password: str = ""  # mark of the one it began under; empty: of a version that kept none
    moment: list[str | int] = field(default_factory=list)  # of its beginning: messages.clock.Moment
    role: str = ""  # of the user when it began; empty: of a version that kept none
    address: str = ""  # it came from
    means: str = ""  # password, one-time link ...
    agent: str = ""  # what the browser calls itself
    external: bool = False  # an identity provider vouched for him; no user of our file


async def _no_farewell(_: str) -> str:
    return ""


class Gate:
    """All of sign-in behind four verbs: sign_in, redeem, session_of, sign_out."""

    def __init__(
        self,
        settings: DashboardSettings,
        users: UserStore,
        clock: Callable[[], float] | None = None,
    ) -> None:
        """clock: s since 1970; None: by elapsed time, whatever is done to the wall clock."""
        self.settings, self.users = settings, users
        self.tokens = TokenStore(settings.users, users.get)
        self.audit, self.bell = Audit(settings.users), Bell()
        self._own = clock is None
        self._clock = clock or _elapsed()
        self.backoff = Backoff(settings.free_attempts, settings.longest_wait_s, self._clock)
        self._file = settings.users.with_name(settings.users.name + ".signed-in")
        self._lock = threading.Lock()
        self._sessions: dict[str, SignIn] = self._load()
        self._verifying = asyncio.Semaphore(PARALLEL)
        # where an identity provider ends the sign-in of this key, too; empty: it does not
        self.farewell: Callable[[str], Awaitable[str]] = _no_farewell

    async def sign_in(self, name: str, password: str, address: str, agent: str = "") -> str | None:
        """A new session id, or None for a wrong name or password; raises WaitError and
        UsersError.
        """
        user = await self.verified(name, password, address)
        return None if user is None else self.begin(user.name, address, "password", agent)

    async def verified(self, name: str, password: str, address: str) -> User | None:
        """The user whose password this is; raises WaitError and UsersError."""
        self.backoff.attempt(address, name)
        async with self._verifying:
            user = await asyncio.to_thread(self.users.verify, name, password)
        if user is None:
            self.audit.refused("password", name, address, "wrong name or password")
            return None
        self.backoff.forgive(address, name)
        return user

    def redeem(self, token: str, address: str, agent: str = "") -> str | None:
        """A new session id for a one-time link, or None when it is used, expired or unknown; raises
        WaitError.
        """
        self.backoff.attempt(address, LINK)
        now = None if self._own else self._clock()
        name = redeem_link_token(self.settings.users, token, now)
        if name is None or self.users.get(name) is None:
            self.audit.refused("sign-in", "", address, "one-time link: used, expired or unknown")
            return None
        self.backoff.forgive(address, LINK)
        return self.begin(name, address, LINK, agent)

    def session_of(self, connection: HTTPConnection) -> tuple[SignIn, User] | None:
        """Who sends this request or opens this WebSocket; None for nobody."""
        token = connection.cookies.get(self.settings.cookie, "")
        return self.look_up(_digest(token), _by_a_person(connection)) if token else None

    def key_of(self, connection: HTTPConnection) -> str:
        """What look_up takes: the hash of the cookie's id."""
        return _digest(connection.cookies.get(self.settings.cookie, ""))

    def look_up(self, key: str, used: bool = False) -> tuple[SignIn, User] | None:
        """The session and the user as the users file has him now; ends what is over. used: a person
        did something, so it is not idle.
        """
        session, now = self._sessions.get(key), self._clock()
        if session is None:
            return None
        user = self._user_of(session)
        if why := self._over(session, user, now):
            self.end(key, why)
            return None
        if used:
            session.seen = now
        return None if user is None else (session, user)

    def _user_of(self, session: SignIn) -> User | None:
        if session.external:  # his name ends in the provider's suffix; a user made since is another
            return User(session.user, Role[session.role], "", session.created)
        return self.users.get(session.user)

    def _over(self, session: SignIn, user: User | None, now: float) -> str:
        """Why it is; empty when it is not."""
        if now - session.created > self.settings.session_hours * 3600:
            return "past its longest"
        if now - session.seen > self.settings.idle_hours * 3600:
            return "idle"
        if now < session.seen - 1.0:
            return "its age is not known any more"
        if user is None:
            return "no such user any more"
        if not session.external and not _same_password(user, session):
            return "another password"
        return "another role" if session.role not in ("", user.role.name) else ""

    def sign_out(self, connection: HTTPConnection) -> None:
        """Forget the session of this request."""
        self.end(self.key_of(connection), "signed out")

    def sign_ins(self, name: str) -> dict[str, SignIn]:
        """The open ones of a user by key, the newest first."""
        mine = [(k, s) for k, s in list(self._sessions.items()) if s.user == name]
        good = [(key, session) for key, session in mine if self.look_up(key) is not None]
        return dict(sorted(good, key=lambda pair: -pair[1].created))

    def external(self) -> dict[str, Role]:
        """Who is signed in by an identity provider."""
        return {s.user: Role[s.role] for s in list(self._sessions.values()) if s.external}

    def begin(
        self, name: str, address: str, means: str, agent: str = "", role: Role | None = None
    ) -> str:
        """The id of a new session of a user who has shown who he is. role: given by an identity
        provider, whose people are not in the users file.
        """
        token, now = secrets.token_urlsafe(32), self._clock()
        for key in list(self.sign_ins(name))[self.settings.sign_ins_per_user - 1 :]:
            self.end(key, "one sign-in too many")
        with self._lock:
            user = None if role is not None else self.users.get(name)
            mark = "" if user is None else _mark(user)
            rank = user.role.name if user is not None else role.name if role is not None else ""
            self._sessions[_digest(token)] = SignIn(
                name,
                secrets.token_urlsafe(24),
                now,
                now,
                mark,
                list(Moment.now()),
                rank,
                address,
                means,
                plain(agent, AGENT),
                role is not None,
            )
            while len(self._sessions) > SESSIONS:
                self._sessions.pop(next(iter(self._sessions)))
            self._save()
        self.audit.done("sign-in", name, address, f"by {means}")
        return token

    def end(self, key: str, why: str, by: str = "") -> None:
        """End a sign-in with all that is open under it. by: another than its user."""
        with self._lock:
            session = self._sessions.pop(key, None)
            if session is None:
                return
            self._save()
        detail = why + (f", by {by}" if by else "")
        self.audit.done("sign-in ended", session.user, session.address, detail)
        self.bell.ring()

    def _load(self) -> dict[str, SignIn]:
        try:
            found = {
                key: SignIn(**entry) for key, entry in json.loads(self._file.read_text()).items()
            }
            return {key: self._moved(one) for key, one in found.items()}
        except FileNotFoundError:
            return {}
        except (OSError, ValueError, TypeError, AttributeError, RecursionError) as error:
            log.warning("%s: %s: everybody has to sign in again", self._file, error)
            return {}

    def _moved(self, session: SignIn) -> SignIn:
        """A sign-in of an earlier process, its times by this one's clock."""
        began = Moment.of(session.moment)
        if self._own and began is not None:
            used_s = max(0.0, session.seen - session.created)
            session.created = self._clock() - began.age_s
            session.seen = min(session.created + used_s, self._clock())
        return session

    def _save(self) -> None:
        try:
            write_private(
                self._file,
                # not who came by a provider: what it gives him may be another by the next start
                json.dumps({k: asdict(s) for k, s in self._sessions.items() if not s.external}),
            )
        except OSError as error:
            log.warning("%s: %s: a restart will sign everybody out", self._file, error.strerror)


def _by_a_person(connection: HTTPConnection) -> bool:
    """Pages ask for values again and again by themselves: that is no use of a sign-in."""
    if connection.scope["type"] != "http":
        return False
    asks = connection.scope["method"] in ("GET", "HEAD")
    return not (asks and connection.url.path.startswith(("/api/", "/map/", "/metrics", "/wall/")))


def _elapsed() -> Callable[[], float]:
    clock = Clock()
    return lambda: clock.now_ns() * 1e-9


def _mark(user: User) -> str:
    """Of a password and when it was given."""
    return _digest(f"{user.hash} {user.created}")


def _same_password(user: User, session: SignIn) -> bool:
    """A new password ends the sign-ins under the old one."""
    if session.password:
        return hmac.compare_digest(session.password, _mark(user))
    return user.created <= session.created + 1


def _digest(token: str) -> str:
    return hashlib.sha256(token.encode()).hexdigest()


def same_token(given: str, wanted: str) -> bool:
    """Compare two tokens in constant time."""
    return hmac.compare_digest(given.encode(), wanted.encode())
