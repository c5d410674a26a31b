"""The service of a site: at home it lets places join and renews certificates; everywhere it has
those of its own place renewed in time.

Renewed files are seen by `gyrofree up`, which starts the service concerned anew; the gateway's
port stays open meanwhile, so no board notices.
"""

import contextlib
import datetime as dt
import logging
import threading
import time
from collections.abc import Callable
from pathlib import Path

import zenoh
from cryptography import x509

from inertial.one_at_a_time import alone
from messages.bus.beating import Beating, tell_time
from messages.bus.session import BusSettings, open_client
from messages.bus.tls import TRUSTED
from messages.bus.turning import Loop
from sites.authority import DAYS
from sites.copying.fetching import INDEX, Copies
from sites.copying.roads import Roads
from sites.copying.serving import Serving
from sites.enrolment import Registrar, keep, renewal
from sites.lanes import Lanes
from sites.place import Place, SiteError, load_place
from sites.previews import Previews
from sites.roles import SEGMENTS, join_key, renew_key
from sites.settings import SiteSettings

LOOK_S = 3600.0  # between two looks at the certificates
AGAIN_S = 60.0  # after a renewal that did not succeed
LEFT = dt.timedelta(days=DAYS / 3)  # of a certificate's life; less is renewed
ASK_S = 10.0
INDEX_S = 15.0  # for what there is: short, and asked again
RENEW_S = 120.0  # that asking for a certificate of each role may take
SEGMENT_S = 60.0  # for a part or a list of segments over a slow link
WAKE_S = 1.0  # while nothing is to be done, that much is said so often
HASH_S = 60.0  # that reading and hashing a file may take between two segments
ROUND_S = 1.0  # between two looks at what home has recorded

Beside = Callable[[zenoh.Session], contextlib.AbstractContextManager[None]]

log = logging.getLogger(__name__)


class HomeRefused(SiteError):
    """Home was reached and says why not: to ask again would not help."""


def run(
    folder: Path,
    sessions: Path,
    bus: BusSettings,
    stop: threading.Event,
    settings: SiteSettings | None = None,
    beside: Beside = lambda _: contextlib.nullcontext(),
) -> None:
    """Until `stop`; raises SiteError where the folder has no place. sessions: the folder of the
    recordings, which home shows and others fill. beside: what else runs at a place that is not
    home, with the session.
    """
    settings = settings or SiteSettings()
    place = load_place(folder)
    if place.at_home:  # before the bus, which lets nobody in whose certificate has ended
        look(folder, place, _asker(folder, place, None))
    with open_client(bus, stop) as session, Beating(session, bus):
        log.info("place %s of site %s%s", place.place, place.site, ", its home" * place.at_home)
        keeping = threading.Thread(
            target=_keep_certificates, args=(folder, place, session, stop), daemon=True
        )
        keeping.start()
        if place.at_home:
            declared = [
                *declare(session, place, Registrar(folder)),
                tell_time(session, place.site),
            ]
            serving = Serving(session, place.site, sessions)
            previews = Previews(session, place.site)

            def at_lane(lane: zenoh.Session, key: str) -> list[zenoh.Queryable]:
                return [serving.at(lane, key + SEGMENTS.rstrip("/")), previews.at(lane, key)]

            lanes = Lanes(folder, bus, settings.lanes, at_lane)
            stop.wait()
            for each in (lanes, previews, serving):
                each.close()
            for one in declared:
                one.undeclare()
        else:
            with beside(session):
                copy(Copies(sessions, folder, place.home, place.place), place.site, session, stop)
        keeping.join(ASK_S + 1.0)


def copy(copies: Copies, site: str, session: zenoh.Session, stop: threading.Event) -> None:
    """Bring home's recordings here, round after round, until `stop`."""
    until = cancelled_by(stop)

    def ask(key: str) -> bytes:
        patience_s = INDEX_S if f"{SEGMENTS}{INDEX}/" in key else SEGMENT_S
        return asked(session, key, b"", patience_s, until)

    roads = Roads(session, site, ask)
    said = ""
    with Loop("copies", SEGMENT_S + HASH_S) as loop:

        def stopped() -> bool:
            loop.turn()
            return stop.is_set()

        while not stop.wait(ROUND_S):
            loop.turn()
            try:
                copies.round(roads, stopped)
                said = ""
            except (SiteError, OSError) as error:
                if str(error) != said and not stop.is_set():
                    log.warning("recordings are not copied: %s", error)
                said = str(error)


def cancelled_by(stop: threading.Event) -> zenoh.CancellationToken:
    """What ends the waiting for answers when `stop` is set: over a bad link they may be long."""
    token = zenoh.CancellationToken()

    def watch() -> None:
        stop.wait()
        token.cancel()

    threading.Thread(target=watch, name="asking ends", daemon=True).start()
    return token


def _keep_certificates(
    folder: Path, place: Place, session: zenoh.Session, stop: threading.Event
) -> None:
    ask, due = _asker(folder, place, session, cancelled_by(stop)), time.monotonic() + AGAIN_S / 10
    with Loop("certificates") as loop:
        while not stop.wait(WAKE_S):
            loop.turn()
            if time.monotonic() >= due:
                with loop.during("renewing certificates", RENEW_S):
                    good = _looked(folder, place, ask)
                due = time.monotonic() + (LOOK_S if good else AGAIN_S)


def _looked(folder: Path, place: Place, ask: Callable[[bytes], bytes]) -> bool:
    try:
        return look(folder, place, ask)
    except (SiteError, OSError) as error:  # a file that cannot be read now may be again
        log.warning("certificates are not looked after: %s", error)
        return False


def look(folder: Path, place: Place, ask: Callable[[bytes], bytes]) -> bool:
    """Renew what is old; False where that did not succeed for one."""
    good = True
    for role, ends in own_certificates(folder).items():
        left = ends - dt.datetime.now(dt.UTC)
        if left > min(LEFT, _life(folder, role) / 3):
            continue
        try:
            renew(folder, role, ask)
            log.info("certificate of %s renewed", role)
        except (SiteError, OSError, ValueError) as error:
            good = False
            log.warning(
                "certificate of %s ends in %s and was not renewed: %s",
                role,
                str(left).split(".")[0],
                error,
            )
    return good


def renew(folder: Path, role: str, ask: Callable[[bytes], bytes]) -> None:
    """Have the certificate of a role made anew; raises SiteError, OSError, ValueError."""
    with alone(folder):
        key, question = renewal(folder, role)
        keep(folder, ask(question), {role: key}, (folder / TRUSTED).read_bytes())


def own_certificates(folder: Path) -> dict[str, dt.datetime]:
    """By role the end of each certificate that this place has."""
    return {role: _read(folder / f"{role}.pem").not_valid_after_utc for role in own_roles(folder)}


def own_roles(folder: Path) -> list[str]:
    """Roles of which this place has a certificate, whatever is in its file."""
    return sorted(path.stem for path in folder.glob("*.pem") if path.name != TRUSTED)


def _life(folder: Path, role: str) -> dt.timedelta:
    certificate = _read(folder / f"{role}.pem")
    return certificate.not_valid_after_utc - certificate.not_valid_before_utc


def _read(path: Path) -> x509.Certificate:
    try:
        return x509.load_pem_x509_certificate(path.read_bytes())
    except (OSError, ValueError) as error:
        raise SiteError(
            f"{path}: cannot be read: {str(error).partition('. ')[0]}; at the site's home `gyrofree"
            f" certs renew {path.stem}` makes it anew, elsewhere restore it from a backup"
        ) from None


def _asker(
    folder: Path,
    place: Place,
    session: zenoh.Session | None,
    until: zenoh.CancellationToken | None = None,
) -> Callable[[bytes], bytes]:
    """Who renews: home itself, others ask over the bus."""
    if place.at_home:
        return Registrar(folder).renew_own

    def ask(question: bytes) -> bytes:
        return asked(session, renew_key(place.site), question, until=until)

    return ask


def asked(
    session: zenoh.Session,
    key: str,
    question: bytes,
    patience_s: float = ASK_S,
    until: zenoh.CancellationToken | None = None,
) -> bytes:
    """Home's answer; raises SiteError with its reason, or where it does not answer. until: ends all
    waiting when it is cancelled.
    """
    # behind everything that is live: who fetches the past must not hold up the present
    for reply in session.get(
        key,
        payload=question,
        timeout=patience_s,
        priority=zenoh.Priority.BACKGROUND,
        cancellation_token=until,
    ):
        if reply.ok is not None:
            return reply.ok.payload.to_bytes()
        said = reply.err.payload.to_bytes().decode(errors="replace")[:500]
        if said != "Timeout":
            raise HomeRefused(f"home refuses: {said}")
    raise SiteError("the site's home does not answer")


def declare(session: zenoh.Session, place: Place, registrar: Registrar) -> list[zenoh.Queryable]:
    def taking(answer: Callable[[bytes], bytes], what: str) -> Callable[[zenoh.Query], None]:
        def on_query(query: zenoh.Query) -> None:
            question = query.payload.to_bytes() if query.payload is not None else b""
            try:
                query.reply(str(query.key_expr), answer(question))
            except SiteError as error:
                log.warning("%s refused: %s", what, error)
                query.reply_err(str(error).encode())
            except Exception:  # whatever a stranger sends, the service goes on
                log.exception("%s refused", what)
                query.reply_err(b"the question cannot be answered; home's log says why")

        return on_query

    return [
        session.declare_queryable(join_key(place.site), taking(registrar.join, "joining")),
        session.declare_queryable(renew_key(place.site), taking(registrar.renew, "renewal")),
    ]
