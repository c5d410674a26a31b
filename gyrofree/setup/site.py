"""A place of a site, as the processes of this installation see it."""

import datetime as dt
from collections.abc import Callable
from pathlib import Path
from typing import Any

from gyrofree.config import ConfigError, Settings, load
from gyrofree.running.supervisor import Supervisor
from gyrofree.running.watch import SERVICES
from gyrofree.setup.written import as_toml
from sites.access import rules_of
from sites.authority import REGISTER
from sites.enrolment import KNOWN, known_here
from sites.place import PLACE, Place, SiteError, load_place, write
from sites.service import Beside, own_certificates

SERVICE = "site"  # the child that lets others join, and renews
WATCHING = ("router", "dashboard")  # all that a place without boards runs
SERVICE_OF = {"recorder": "record", "authority": SERVICE}  # by role, where it is called otherwise
GO_ON = ("gateway", "estimator", "record")  # where they were, when they are killed
BOOKS = (PLACE, KNOWN, REGISTER)  # files that say who may come
SOON = dt.timedelta(days=14)  # an end that is said


def services(settings: Settings) -> tuple[str, ...]:
    """What this installation runs; raises ConfigError for a place that cannot be read."""
    folder = settings.bus.tls
    if folder is None:
        return SERVICES
    place = _place(folder)
    return (*(SERVICES if place.at_home else WATCHING), SERVICE)


def write_place(
    config: Path,
    site: str,
    folder: Path,
    listen: str,
    port: int,
    settings: Settings | None = None,
) -> None:
    """Write a place into a configuration; everything else stays as it was, or is as in `settings`.

    folder: of its certificates. listen: endpoint of its router, which has this port; where other
    machines reach it the processes of this one have a door of their own, which no stranger can
    crowd. Raises ConfigError, OSError.
    """
    near = f"tls/127.0.0.1:{port}"
    open_to_others = not listen.startswith(("tls/127.", "tls/localhost:", "tls/[::1]:"))
    if open_to_others:
        near = f"tls/127.0.0.1:{port + 1 if port < 65535 else port - 1}"
    if settings is None:
        settings = load(config) if config.exists() else Settings()
    bus = settings.bus.model_copy(
        update={
            "prefix": site,
            "router": near,
            "listen": [near, listen] if open_to_others else [near],
            "tls": folder,
        }
    )
    text = as_toml(settings.model_copy(update={"bus": bus}), "Written by `gyrofree`.")
    write(config, text.encode(), 0o644)


def only_watching(settings: Settings) -> str:
    """Why nobody here may give orders; empty where some may. Raises ConfigError."""
    if settings.bus.tls is None:
        return ""
    place = _place(settings.bus.tls)
    if place.seat == "operator":
        return ""
    return f"{place.place} watches {place.site}: its home, {place.home}, gave it no right to order"


def place_of(settings: Settings) -> str:
    """The name of this place in its site; empty without one. Raises ConfigError."""
    return "" if settings.bus.tls is None else _place(settings.bus.tls).place


def is_afar(settings: Settings) -> bool:
    """Are the boards at another place of the site? Raises ConfigError."""
    return settings.bus.tls is not None and not _place(settings.bus.tls).at_home


def own_alarms(settings: Settings) -> Beside:
    """What tells people of the alarms of a place that is not home; home has a service for it."""
    from dashboard.alarms.own_place import told  # here: `up` needs none of it

    bus, place = settings.bus.acting_as("authority"), place_of(settings)
    recordings = Path(settings.recorder.root)
    return lambda session: told(session, bus, place, settings.alarms, recordings)


def router_rules(settings: Settings) -> tuple[dict[str, Any] | None, tuple[str, ...]]:
    """What the router lets through, and the routers that it calls; no rules without a site."""
    folder = settings.bus.tls
    if folder is None:
        return None, ()
    place = _place(folder)
    if settings.bus.prefix != place.site:
        raise ConfigError(
            f"[bus] prefix = {settings.bus.prefix!r}: the certificates in {folder} are of the site"
            f" {place.site!r}, whose keys begin with that name"
        )
    return access(settings, folder, place), tuple(p.address for p in place.peers if p.address)


def access(settings: Settings, folder: Path, place: Place) -> dict[str, Any]:
    """The rules of this place's router; raises ConfigError."""
    now = dt.datetime.now(dt.UTC)
    try:
        standing = [each for each in known_here(folder, place) if each.stands(now)]
    except SiteError as error:
        raise ConfigError(str(error)) from None
    boards = [device.name for device in settings.gateway.devices]
    return rules_of(place, standing, {f"gateway.{place.place}": boards})


def _place(folder: Path) -> Place:
    try:
        return load_place(folder)
    except SiteError as error:
        raise ConfigError(f"[bus] tls: {error}") from None


def of_no_site(config: Path, folder: Path) -> None:
    """An installation is of one site: it is not taken from one by the way. Raises ConfigError."""
    tls = load(config).bus.tls if config.exists() else None
    if tls is not None and tls.absolute() != folder.absolute():
        raise ConfigError(
            f"{config}: [bus] tls = {str(tls)!r}: this installation is of a site already; begin in"
            " an empty folder, or take that line out"
        )


def unfinished(config: Path, folder: Path) -> Place | None:
    """The place of a folder whose making was cut off before the configuration knew of it; raises
    ConfigError, SiteError.
    """
    if not (folder / PLACE).exists() or (config.exists() and load(config).bus.tls is not None):
        return None
    return load_place(folder)


class Renewed:
    """Starts what has a new certificate anew, and the router when who may come has changed."""

    def __init__(self, settings: Settings, supervisor: Supervisor) -> None:
        self._settings, self._supervisor = settings, supervisor
        self._folder = settings.bus.tls
        self._seen, self._rules = self._stamps(), self._now()

    def look(self) -> None:
        """Once; cheap."""
        stamps = self._stamps()
        changed = {name for name, stamp in stamps.items() if self._seen.get(name) != stamp}
        if not changed:
            return
        self._seen = stamps
        names = {SERVICE_OF.get(name, name) for name in changed if name not in BOOKS}
        rules = self._now()
        if rules is not None and rules != self._rules:
            self._rules = rules
            names.add("router")
        known = [c.name for c in self._supervisor.children if c.name in names]
        if known:
            why = "new certificates, or another who may come"
            self._supervisor.say(f"{why}: {', '.join(known)} start anew")
            self._supervisor.restart(*(name for name in known if name not in GO_ON))
            self._supervisor.begin_anew(*(name for name in known if name in GO_ON))

    def _stamps(self) -> dict[str, int]:
        """By role, or by name of a book, when it was written."""
        found = {}
        for path in (*self._folder.glob("*.pem"), *(self._folder / name for name in BOOKS)):
            try:
                stamp = path.stat().st_mtime_ns
            except OSError:
                continue
            name = str(path.relative_to(self._folder))
            found[name if name in BOOKS else path.stem] = stamp
        return found

    def _now(self) -> tuple | None:
        """What the router would do; None where that cannot be read."""
        try:
            return router_rules(self._settings)
        except ConfigError as error:
            self._supervisor.say(str(error), "yellow")
            return None


def endings(folder: Path) -> list[str]:
    """Certificates of this place that end soon or have ended, in words."""
    now, said = dt.datetime.now(dt.UTC), []
    for role, ends in own_certificates(folder).items():
        if ends < now:
            said.append(f"certificate of {role} ended {ends:%Y-%m-%d}: its process is shut out")
        elif ends - now < SOON:
            said.append(f"certificate of {role} ends {ends:%Y-%m-%d %H:%M UTC}")
    return said


def chain(*looks: Callable[[], None]) -> Callable[[], None]:
    """One after the other."""

    def all_of_them() -> None:
        for look in looks:
            look()

    return all_of_them
