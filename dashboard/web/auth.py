"""Sign-in: server-side sessions, waiting times for wrong passwords, and the rule who may do what.

The cookie holds a random id only; everything else stays here, so that signing out or removing a
user takes effect at once. Ids are kept hashed, in memory and in a private file: a restarted
dashboard still knows who is signed in.
"""

import asyncio
import hashlib
import hmac
import ipaddress
import json
import logging
import secrets
import threading
from collections.abc import Callable
from dataclasses import asdict, dataclass, field

from starlette.requests import HTTPConnection

from dashboard.settings import DashboardSettings
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

__all__ = [
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

ADDRESSES = 4096  # addresses whose failures are remembered; the oldest go first
SESSIONS = 1024  # sign-ins at a time
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


class WaitError(Exception):
    """Too many wrong passwords from this address."""

    def __init__(self, seconds: float) -> None:
        super().__init__(f"too many wrong passwords from this address: wait {seconds:.0f} s")
        self.seconds = seconds


class Backoff:
    """Waiting time per address: none for the first failures, then 1, 2, 4 ... s up to a limit."""

    def __init__(self, free: int, longest_s: float, clock: Callable[[], float]) -> None:
        self._free, self._longest, self._clock = free, longest_s, clock
        self._failures: dict[
            str, tuple[int, float]
        ] = {}  # network -> failures, time of the next attempt

    @staticmethod
    def network(address: str) -> str:
        """An IPv6 host owns a /64: count that as one address."""
        try:
            parsed = ipaddress.ip_address(address)
        except ValueError:
            return address
        return (
            str(ipaddress.ip_network((parsed, 64), strict=False))
            if parsed.version == 6
            else address
        )

    def attempt(self, address: str) -> None:
        """Count an attempt as failed before it is verified, so that parallel ones gain nothing;
        raises WaitError.
        """
        key, now = self.network(address), self._clock()
        count, allowed = self._failures.pop(key, (0, 0.0))
        if now > allowed + self._longest:
            count = 0
        if now < allowed:
            allowed = min(allowed, now + self._longest)  # also when the clock went back
            self._failures[key] = (count, allowed)
            raise WaitError(allowed - now)
        over = count + 1 - self._free
        wait = min(2.0 ** min(over, 30), self._longest) if over >= 0 else 0.0
        self._failures[key] = (count + 1, now + wait)
        while len(self._failures) > ADDRESSES:
            self._failures.pop(next(iter(self._failures)))

    def forgive(self, address: str) -> None:
        """The password was right after all."""
        self._failures.pop(self.network(address), None)


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
        self._own = clock is None
        self._clock = clock or _elapsed()
        self.backoff = Backoff(settings.free_attempts, settings.longest_wait_s, self._clock)
        self._file = settings.users.with_name(settings.users.name + ".signed-in")
        self._lock = threading.Lock()
        self._sessions: dict[str, SignIn] = self._load()
        self._verifying = asyncio.Semaphore(PARALLEL)

    async def sign_in(self, name: str, password: str, address: str) -> str | None:
        """A new session id, or None for a wrong name or password; raises WaitError and
        UsersError.
        """
        self.backoff.attempt(address)
        async with self._verifying:
            user = await asyncio.to_thread(self.users.verify, name, password)
        if user is None:
            log.warning("sign-in refused for %r from %s", name[:64], address)
            return None
        self.backoff.forgive(address)
        return self._begin(user.name, address, "password")

    def redeem(self, token: str, address: str) -> str | None:
        """A new session id for a one-time link, or None when it is used, expired or unknown; raises
        WaitError.
        """
        self.backoff.attempt(address)
        now = None if self._own else self._clock()
        name = redeem_link_token(self.settings.users, token, now)
        if name is None or self.users.get(name) is None:
            log.warning("sign-in link refused from %s: used, expired or unknown", address)
            return None
        self.backoff.forgive(address)
        return self._begin(name, address, "one-time link")

    def session_of(self, connection: HTTPConnection) -> tuple[SignIn, User] | None:
        """Who sends this request or opens this WebSocket; None for nobody."""
        token = connection.cookies.get(self.settings.cookie, "")
        return self.look_up(_digest(token)) if token else None

    def key_of(self, connection: HTTPConnection) -> str:
        """What look_up takes: the hash of the cookie's id."""
        return _digest(connection.cookies.get(self.settings.cookie, ""))

    def look_up(self, key: str) -> tuple[SignIn, User] | None:
        """The session and the user as the users file has him now; ends what is expired."""
        session, now = self._sessions.get(key), self._clock()
        if session is None:
            return None
        old = now - session.created > self.settings.session_hours * 3600
        idle = now - session.seen > self.settings.idle_hours * 3600
        back = now < session.seen - 1.0  # its age is not known any more
        user = self.users.get(session.user)
        if old or idle or back or user is None or not _same_password(user, session):
            self._end(key)
            return None
        session.seen = now
        return session, user

    def sign_out(self, connection: HTTPConnection) -> None:
        """Forget the session of this request."""
        self._end(self.key_of(connection))

    def _begin(self, name: str, address: str, means: str) -> str:
        token, now = secrets.token_urlsafe(32), self._clock()
        with self._lock:
            user = self.users.get(name)
            mark = "" if user is None else _mark(user)
            self._sessions[_digest(token)] = SignIn(
                name, secrets.token_urlsafe(24), now, now, mark, list(Moment.now())
            )
            while len(self._sessions) > SESSIONS:
                self._sessions.pop(next(iter(self._sessions)))
            self._save()
        log.info("%s signed in from %s by %s", name, address, means)
        return token

    def _end(self, key: str) -> None:
        with self._lock:
            if self._sessions.pop(key, None) is not None:
                self._save()

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
                json.dumps({key: asdict(session) for key, session in self._sessions.items()}),
            )
        except OSError as error:
            log.warning("%s: %s: a restart will sign everybody out", self._file, error.strerror)


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
