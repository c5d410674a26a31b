"""Who may enter: the users file and one-time sign-in links.

The users file is JSON, readable by its owner only, replaced as a whole on each change:
{"version": 1, "users": {"anna": {"hash": "$argon2id$...", "role": "operator", "created":
1750000000}}}. A link is a file named after the SHA-256 of its token in <users file>.links/, so that
another process (the demo's supervisor) can issue what the dashboard redeems; removing that file is
what makes it work once.
"""

import functools
import hashlib
import json
import os
import re
import secrets
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from enum import IntEnum
from pathlib import Path

from argon2 import PasswordHasher
from argon2.exceptions import InvalidHashError, VerificationError

from dashboard.web.accounts.passwords import PASSWORD_MAX, fault_of
from inertial.one_at_a_time import alone
from messages.clock import Moment

USER_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._@-]{0,63}")

# One lane, 32 MiB, above OWASP's 19 MiB: a small board must be able to verify without stalling the
# data's way.
_hasher = PasswordHasher(time_cost=2, memory_cost=32768, parallelism=1)


@functools.cache
def _dummy() -> str:
    """Verified for unknown names, so that the time taken tells nothing."""
    return _hasher.hash(secrets.token_hex(16))


class UsersError(ValueError):
    """A user, role, password or users file that cannot be used; the text says what to do."""


class Role(IntEnum):
    """What a user may do; each includes the ones before it."""

    viewer = 1  # look, move the camera, download
    operator = 2  # drive the widgets, record, replay
    admin = 3  # manage users


@dataclass(frozen=True)
class User:
    """One entry of the users file."""

    name: str
    role: Role
    hash: str
    created: float  # s since 1970


def write_private(path: Path, text: str) -> None:
    """Replace a file as a whole; only its owner can read it. Raises OSError."""
    path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    handle, name = tempfile.mkstemp(
        dir=path.parent, prefix=f".{path.name}."
    )  # mkstemp makes mode 0600
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as stream:
            stream.write(text)
            stream.flush()
            os.fsync(stream.fileno())
        os.replace(name, path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


@contextmanager
def changing(path: Path) -> Iterator[None]:
    """The page and commands change users and tokens one after the other: of two at once one would
    be lost, and who was removed would be there again. Raises UsersError.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        with alone(path.parent):
            yield
    except OSError as error:
        raise UsersError(
            f"{path.parent}: {error.strerror}; choose another [dashboard] users"
        ) from None


def load_users(path: Path) -> dict[str, User]:
    """All users by name; none when the file is absent. Raises UsersError for a file that cannot be
    read.
    """
    try:
        entries = json.loads(path.read_text(encoding="utf-8"))["users"]
        return {
            name: User(name, Role[entry["role"]], str(entry["hash"]), float(entry["created"]))
            for name, entry in entries.items()
        }
    except FileNotFoundError:
        return {}
    except OSError as error:
        raise UsersError(
            f"{path}: {error.strerror}; the dashboard's user must be able to read it"
        ) from None
    except (KeyError, TypeError, ValueError, AttributeError, RecursionError) as error:
        raise UsersError(
            f"{path}: no users file ({type(error).__name__}: {error}); restore a copy, or remove it"
            " and add users again"
        ) from None


def _save(path: Path, users: dict[str, User]) -> None:
    entries = {
        u.name: {"hash": u.hash, "role": u.role.name, "created": u.created} for u in users.values()
    }
    try:
        write_private(path, json.dumps({"version": 1, "users": entries}, indent=1) + "\n")
    except OSError as error:
        raise UsersError(f"{path}: {error.strerror}; choose another [dashboard] users") from None


def add_user(path: Path, name: str, password: str, role: str | Role) -> User:
    """Add a user or replace his password and role; raises UsersError for what is not acceptable."""
    if not USER_NAME.fullmatch(name):
        raise UsersError(
            f"user name {name!r}: want letters, digits and . _ @ -, at most 64 characters"
        )
    if fault := fault_of(password, name):
        raise UsersError(fault)
    rank = role_of(role)
    made = User(name, rank, _hasher.hash(password), round(time.time()))
    with changing(path):
        _save(path, load_users(path) | {name: made})
    return made


def set_password(path: Path, name: str, password: str) -> None:
    """Another password, with the role that he has now; raises UsersError for one that is not
    acceptable, and when there is no such user any more.
    """
    if fault := fault_of(password, name):
        raise UsersError(fault)
    made = _hasher.hash(password)
    with changing(path):
        users = load_users(path)
        if name not in users:
            raise UsersError(f"there is no user {name!r} any more")
        users[name] = replace(users[name], hash=made, created=round(time.time()))
        _save(path, users)


def role_of(role: str | Role) -> Role:
    """The role of that name; raises UsersError."""
    try:
        return role if isinstance(role, Role) else Role[role]
    except KeyError:
        raise UsersError(f"role {role!r}: want one of {', '.join(r.name for r in Role)}") from None


def set_role(path: Path, name: str, role: str | Role) -> User:
    """Another role with the same password; raises UsersError when there is no such user or role."""
    rank = role_of(role)
    with changing(path):
        users = load_users(path)
        if name not in users:
            raise UsersError(f"{path}: no user {name!r}; there are {', '.join(sorted(users))}")
        users[name] = replace(users[name], role=rank)
        _save(path, users)
    return users[name]


def remove_user(path: Path, name: str) -> None:
    """Remove a user; raises UsersError when there is none of that name."""
    with changing(path):
        users = load_users(path)
        if users.pop(name, None) is None:
            raise UsersError(
                f"{path}: no user {name!r}; there are {', '.join(sorted(users)) or 'none'}"
            )
        _save(path, users)


class UserStore:
    """The users file as the dashboard sees it: read again when it changes, so that a removed user
    is out at once.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._lock = threading.Lock()
        self._stamp: tuple[int, int, int] | None = None
        self._users: dict[str, User] = {}
        _dummy()  # now, not while the first unknown name waits

    def all(self) -> dict[str, User]:
        """Users by name; raises UsersError as load_users does."""
        try:
            status = self.path.stat()
            stamp = (status.st_mtime_ns, status.st_size, status.st_ino)
        except OSError:
            stamp = None
        with self._lock:
            if stamp is None or stamp != self._stamp:
                self._users, self._stamp = load_users(self.path), stamp
            return self._users

    def get(self, name: str) -> User | None:
        """The user of that name."""
        return self.all().get(name)

    def verify(self, name: str, password: str) -> User | None:
        """The user when the password is right. Takes some 100 ms either way: call it in a
        thread.
        """
        user = self.get(name) if len(name) <= 64 else None
        try:
            _hasher.verify(user.hash if user else _dummy(), password[: PASSWORD_MAX + 1])
        except (VerificationError, InvalidHashError):
            return None
        return user


def _link_file(users_file: Path, token: str) -> Path:
    return (
        users_file.with_name(users_file.name + ".links")
        / hashlib.sha256(token.encode()).hexdigest()
    )


def issue_link_token(users_file: Path, user: str, lifetime_s: float = 900.0) -> str:
    """A token that signs `user` in once within lifetime_s; raises UsersError when there is no such
    user.
    """
    if user not in load_users(users_file):
        raise UsersError(f"{users_file}: no user {user!r} to make a sign-in link for")
    token = secrets.token_urlsafe(32)
    link = _link_file(users_file, token)
    try:
        written = {
            "user": user,
            "expires": time.time() + lifetime_s,
            "lifetime_s": lifetime_s,
            "moment": list(Moment.now()),
        }
        write_private(link, json.dumps(written))
    except OSError as error:
        raise UsersError(
            f"{link.parent}: {error.strerror}; choose another [dashboard] users"
        ) from None
    return token


def link_token_waits(users_file: Path, token: str) -> bool:
    """True while nobody has used this token."""
    return _link_file(users_file, token).exists()


def redeem_link_token(users_file: Path, token: str, now: float | None = None) -> str | None:
    """Name of the user the token is for, once; None when unknown, used or expired: by what has
    elapsed since it was made, or at `now`, s since 1970.
    """
    link = _link_file(users_file, token)
    try:
        content = json.loads(link.read_text(encoding="utf-8"))
        # of two that race, only one removes the file; the other gets FileNotFoundError
        link.unlink()
        made = Moment.of(content.get("moment"))
        if now is None and made is not None:
            valid = made.age_s < float(content["lifetime_s"])
        else:
            valid = (time.time() if now is None else now) < float(content["expires"])
        return str(content["user"]) if valid else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def demo_link(users_file: Path, url: str, lifetime_s: float = 900.0) -> str:
    """The demo's address with a one-time link; makes the local operator `demo` with a password
    nobody knows.
    """
    if "demo" not in load_users(users_file):
        add_user(users_file, "demo", secrets.token_urlsafe(32), Role.operator)
    return f"{url}/login/link?token={issue_link_token(users_file, 'demo', lifetime_s)}"
