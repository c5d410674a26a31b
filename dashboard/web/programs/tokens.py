"""API tokens: what a program shows instead of a password, with a role and an end.

A token is shown once, when it is made; kept is its SHA-256 only (it has 256 bits of its own, so a
slow hash would add nothing), in <users file>.tokens, readable by its owner. It belongs to a user:
it may never do more than he may now, and ends with him.
"""

import hashlib
import json
import secrets
import threading
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path

from dashboard.web.users import (
    Role,
    User,
    UsersError,
    changing,
    load_users,
    write_private,
)
from messages.clock import Moment
from messages.text import check as fault_in

PREFIX = "gyf_"
WALL = "wall"  # kind of the tokens of wall displays, which are good for nothing else
DAYS_MAX = 3650.0
MOST = 200  # tokens in all
PER_SECOND, BURST = 20.0, 60.0  # requests by one token
DAY_S = 86_400.0


@dataclass(frozen=True)
class Token:
    """One entry of the tokens file; times in s since 1970."""

    id: str
    user: str
    name: str  # what it is for
    role: str
    hash: str
    created: float
    ends: float
    moment: list[str | int] = field(default_factory=list)  # of its making: messages.clock.Moment
    kind: str = ""  # of a program; or WALL

    @property
    def over(self) -> bool:
        """By what has elapsed since it was made, where that is known, whatever the clock was set
        to; else by the clock.
        """
        made = Moment.of(self.moment)
        if made is not None:
            return made.age_s >= self.ends - self.created
        return time.time() >= self.ends


def tokens_file(users_file: Path) -> Path:
    """Where the tokens of a users file are kept."""
    return users_file.with_name(users_file.name + ".tokens")


def load_tokens(users_file: Path) -> dict[str, Token]:
    """All tokens by id; raises UsersError for a file that cannot be read."""
    path = tokens_file(users_file)
    try:
        entries = json.loads(path.read_text(encoding="utf-8"))["tokens"]
        found = [Token(**entry) for entry in entries]
        for one in found:
            Role[one.role], float(one.ends), float(one.created), one.hash.encode()
        return {one.id: one for one in found}
    except FileNotFoundError:
        return {}
    except OSError as error:
        raise UsersError(f"{path}: {error.strerror}") from None
    except (KeyError, TypeError, ValueError, AttributeError, RecursionError) as error:
        raise UsersError(
            f"{path}: no tokens file ({type(error).__name__}: {error}); remove it and make tokens"
            " again"
        ) from None


def _save(users_file: Path, tokens: dict[str, Token]) -> None:
    path = tokens_file(users_file)
    try:
        entries = [asdict(one) for one in tokens.values()]
        write_private(path, json.dumps({"version": 1, "tokens": entries}, indent=1) + "\n")
    except OSError as error:
        raise UsersError(f"{path}: {error.strerror}") from None


def issue_token(
    users_file: Path, user: str, name: str, role: str, days: float, kind: str = ""
) -> tuple[str, Token]:
    """A new token, which is told only here, and its entry. Raises UsersError for what is not
    acceptable: more than the user may do, no end.
    """
    owner = load_users(users_file).get(user)
    if owner is None:
        raise UsersError(f"no user {user!r} to make a token for")
    if role not in Role.__members__:
        raise UsersError(f"role {role!r}: want one of {', '.join(r.name for r in Role)}")
    if Role[role] > owner.role:
        raise UsersError(f"{user} is {owner.role.name}: a token of his cannot be {role}")
    if not 0.0 < days <= DAYS_MAX:
        raise UsersError(f"{days:g} days: want more than 0, at most {DAYS_MAX:g}")
    if not name.strip() or len(name) > 60 or fault_in(name):
        raise UsersError("say in up to 60 characters what the token is for")
    secret, now = PREFIX + secrets.token_urlsafe(32), time.time()
    entry = Token(
        secrets.token_hex(4),
        user,
        name.strip(),
        role,
        digest(secret),
        now,
        now + days * DAY_S,
        list(Moment.now()),
        kind,
    )
    with changing(users_file):
        tokens = {key: one for key, one in load_tokens(users_file).items() if not one.over}
        if len(tokens) >= MOST:
            raise UsersError(f"{MOST} tokens are there already: revoke some")
        _save(users_file, tokens | {entry.id: entry})
    return secret, entry


def revoke_token(users_file: Path, token_id: str) -> Token:
    """Take a token back, at once; raises UsersError when there is none of that id."""
    with changing(users_file):
        tokens = load_tokens(users_file)
        gone = tokens.pop(token_id, None)
        if gone is None:
            raise UsersError(f"no token {token_id!r}; there are {', '.join(tokens) or 'none'}")
        _save(users_file, tokens)
    return gone


def digest(secret: str) -> str:
    """What is kept of a token."""
    return hashlib.sha256(secret.encode()).hexdigest()


@dataclass
class Use:
    """How a token was used since the dashboard began."""

    requests: int = 0
    limited: int = 0  # refused for being too many
    last: float = 0.0  # s since 1970
    left: float = BURST
    at: float = field(default_factory=time.monotonic)


class TokenStore:
    """The tokens file as the dashboard sees it: read again when it changes, so that a revoked token
    is of no use at once.
    """

    def __init__(self, users_file: Path, user_of: Callable[[str], User | None]) -> None:
        self._users_file, self._user_of = users_file, user_of
        self._lock = threading.Lock()
        self._stamp: tuple[int, int, int] | None = None
        self._by_hash: dict[str, Token] = {}
        self.uses: dict[str, Use] = {}
        self.refused = 0  # requests with a token that is none

    def find(self, secret: str, kind: str = "") -> tuple[Token, User] | None:
        """A token of a kind that is good now, and its user with the lesser of both roles."""
        token = self._all().get(digest(secret)) if secret.startswith(PREFIX) else None
        if token is not None and (token.over or token.kind != kind):
            token = None
        user = self._user_of(token.user) if token is not None else None
        if token is None or user is None:
            with self._lock:
                self.refused += 1
            return None
        role = min(user.role, Role[token.role])
        return token, User(user.name, role, user.hash, user.created)

    def wait_s(self, token: Token) -> float:
        """Count a request; seconds to wait when there were too many, 0 when it may pass."""
        with self._lock:
            use, now = self.uses.setdefault(token.id, Use()), time.monotonic()
            use.left = min(BURST, use.left + (now - use.at) * PER_SECOND)
            use.at, use.last = now, time.time()
            if use.left < 1.0:
                use.limited += 1
                return (1.0 - use.left) / PER_SECOND
            use.left, use.requests = use.left - 1.0, use.requests + 1
            return 0.0

    def _all(self) -> dict[str, Token]:
        try:
            status = tokens_file(self._users_file).stat()
            stamp = (status.st_mtime_ns, status.st_size, status.st_ino)
        except OSError:
            stamp = None
        with self._lock:
            if stamp is None or stamp != self._stamp:
                self._by_hash = {t.hash: t for t in load_tokens(self._users_file).values()}
                self._stamp = stamp
            return self._by_hash
