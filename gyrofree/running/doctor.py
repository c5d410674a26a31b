"""`gyrofree doctor`: is this machine ready, and if not, what to do.

Each check returns one Finding; none changes anything. `health` asks a running service for a sign of
life and is what the containers' health checks call.
"""

import ctypes
import grp
import importlib.metadata
import os
import shutil
import socket
import ssl
import struct
import sys
import time
import urllib.error
import urllib.request
from dataclasses import asdict, dataclass
from pathlib import Path
from queue import Empty, Queue
from urllib.parse import urlsplit

from dashboard.web.tls.certificate import CertificateError, open_certificate
from gyrofree.config import Settings
from messages.bus.faults import BusUnavailable
from messages.bus.session import open_client, subscribe
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import ALARM, ESTIMATOR, LINK, PROCEDURE, STATUS
from messages.text import plain

LEAST_FREE = 1 << 30  # bytes of disk below which recording is at risk
STA_UNSYNC = 0x0040  # linux/timex.h
LISTEN_S = 2.5  # to running estimators, which speak once a second
DOUBTED = "settings: "  # begins an estimator's message of a setting that the data contradict
HEALTH_WAIT = 4.0  # s; the slowest sign of life comes once a second
SIGN_OF_LIFE = {
    "gateway": LINK,
    "estimator": ESTIMATOR,
    "recorder": STATUS,
    "procedures": PROCEDURE,
    "alarms": ALARM,
}


@dataclass(frozen=True)
class Finding:
    """The outcome of one check."""

    check: str
    state: str  # "ok", "warn" or "fail"
    found: str
    remedy: str = ""


def examine(settings: Settings) -> list[Finding]:
    """All checks, in the order the data flow."""
    return [
        _versions(),
        *_ports(settings),
        _clock(),
        _endpoint("bus port", settings.bus.listen[0].partition("/")[2], "[bus] listen"),
        _endpoint(
            "dashboard port",
            f"{settings.dashboard.host}:{settings.dashboard.port}",
            "[dashboard] port",
        ),
        _folder("journal folder", Path(settings.gateway.journal)),
        _folder("recordings folder", Path(settings.recorder.root)),
        *_certificate(settings),
        *_settings(settings),
    ]


def _settings(settings: Settings) -> list[Finding]:
    """What running estimators say of settings that their data contradict; nothing where no bus
    runs.
    """
    host, _, port = settings.bus.listen[0].partition("/")[2].rpartition(":")
    if not port_taken(host.strip("[]"), int(port)):
        return []
    try:
        session = open_client(settings.bus, timeout_s=HEALTH_WAIT)
    except BusUnavailable:
        return []
    heard: Queue[pb.EstimatorStatus] = Queue()
    with session:
        subscription = subscribe(
            session, ESTIMATOR, settings.bus.prefix, lambda _, message: heard.put(message)
        )
        time.sleep(LISTEN_S)
        subscription.undeclare()
    said: dict[str, str] = {}
    while not heard.empty():
        status = heard.get()
        device = status.header.device
        said[device] = max(said.get(device, ""), status.message.partition(DOUBTED)[2], key=len)
    return [
        Finding(f"settings of {device}", "warn", plain(text), "change the setting, start it anew")
        if text
        else Finding(f"settings of {device}", "ok", "nothing in the data contradicts them")
        for device, text in sorted(said.items())
    ]


def as_json(findings: list[Finding]) -> list[dict]:
    """Findings as plain dictionaries."""
    return [asdict(finding) for finding in findings]


def _versions() -> Finding:
    names = ("gyrofree", "eclipse-zenoh", "viser", "numpy", "fastapi", "pyserial")
    found = ", ".join(f"{name} {importlib.metadata.version(name)}" for name in names)
    python = ".".join(map(str, sys.version_info[:3]))
    return Finding("versions", "ok", f"Python {python}, {found}")


def _ports(settings: Settings) -> list[Finding]:
    by_id = (
        sorted(Path("/dev/serial/by-id").glob("*")) if Path("/dev/serial/by-id").is_dir() else []
    )
    seen = ", ".join(path.name for path in by_id) or "no USB serial adapter is plugged in"
    findings = [Finding("serial ports", "ok", seen)]
    for device in settings.gateway.devices:
        port, name = device.port, f"port of {device.name}"
        if "://" in port:
            findings.append(Finding(name, "ok", f"{port} (checked when it is opened)"))
        elif not os.path.exists(port):
            findings.append(
                Finding(
                    name, "warn", f"{port} is not there", "plug the board in; the gateway waits"
                )
            )
        elif not os.access(port, os.R_OK | os.W_OK):
            group = grp.getgrgid(os.stat(port).st_gid).gr_name
            remedy = f"sudo usermod -aG {group} $USER, then sign in again"
            findings.append(
                Finding(name, "fail", f"{port}: no permission to read and write", remedy)
            )
        else:
            findings.append(Finding(name, "ok", port))
    return findings


def _clock() -> Finding:
    """The kernel's word on whether UTC is disciplined (adjtimex, read only)."""
    buffer = ctypes.create_string_buffer(512)
    if ctypes.CDLL(None).adjtimex(buffer) < 0:
        return Finding("clock", "warn", "the kernel does not tell whether UTC is disciplined")
    status = struct.unpack_from("i", buffer, 40)[
        0
    ]  # struct timex: modes, offset, freq, maxerror, esterror, status
    if status & STA_UNSYNC:
        remedy = "start chrony or systemd-timesyncd; rates are unaffected"
        return Finding("clock", "warn", "UTC is not disciplined", remedy)
    return Finding("clock", "ok", "UTC is disciplined")


def port_taken(host: str, port: int) -> bool:
    """True when nothing can listen there."""
    with socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError:
            return True
    return False


def _endpoint(check: str, address: str, key: str) -> Finding:
    host, _, port = address.rpartition(":")
    if port_taken(host.strip("[]"), int(port)):
        return Finding(
            check, "warn", f"{address} is taken", f"gyrofree runs already, or choose another {key}"
        )
    return Finding(check, "ok", f"{address} is free")


def _folder(check: str, folder: Path) -> Finding:
    there = next(path for path in (folder.absolute(), *folder.absolute().parents) if path.exists())
    if not os.access(there, os.W_OK):
        return Finding(
            check,
            "fail",
            f"{folder}: no permission to write in {there}",
            f"sudo chown $USER {there}",
        )
    free = shutil.disk_usage(there).free
    text = f"{folder}: {free / 2**30:.1f} GiB free"
    if free < LEAST_FREE:
        return Finding(check, "warn", text, "make room: 1 GiB at least")
    return Finding(check, "ok", text)


def health(service: str, settings: Settings) -> Finding:
    """One sign of life of a running service; state "ok" or "fail"."""
    if service == "dashboard":
        return _dashboard_health(settings)
    try:
        session = open_client(settings.bus, timeout_s=HEALTH_WAIT)
    except BusUnavailable as error:
        return Finding(service, "fail", str(error))
    with session:
        if service == "router":
            return Finding(service, "ok", f"{urlsplit(settings.bus.router).path} answers")
        heard: Queue[str] = Queue()
        topic = SIGN_OF_LIFE[service]
        subscription = subscribe(session, topic, settings.bus.prefix, lambda key, _: heard.put(key))
        try:
            return Finding(service, "ok", f"speaks on {heard.get(timeout=HEALTH_WAIT)}")
        except Empty:
            return Finding(
                service,
                "fail",
                f"nothing on {topic.pattern(settings.bus.prefix)} for {HEALTH_WAIT:g} s",
            )
        finally:
            subscription.undeclare()


def _dashboard_health(settings: Settings) -> Finding:
    host = "127.0.0.1" if settings.dashboard.host in ("0.0.0.0", "::") else settings.dashboard.host
    tls = settings.dashboard.tls_certificate
    url = f"{'https' if tls else 'http'}://{host}:{settings.dashboard.port}/api/health"
    try:
        with urllib.request.urlopen(
            url, timeout=HEALTH_WAIT, context=_only(tls) if tls else None
        ) as answer:
            return Finding("dashboard", "ok", f"{url} answers {answer.status}")
    except (urllib.error.URLError, OSError) as error:
        return Finding("dashboard", "fail", f"{url}: {error}")


def _only(certificate: Path) -> ssl.SSLContext:
    """Trust in the one certificate of the file, whatever name it is for: the asked host is ours."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname = False
    context.verify_flags |= ssl.VERIFY_X509_PARTIAL_CHAIN
    context.load_verify_locations(certificate)
    return context


def _certificate(settings: Settings) -> list[Finding]:
    """What the web port's own certificate says, where it has one."""
    try:
        found = open_certificate(settings.dashboard)
    except CertificateError as error:
        return [
            Finding(
                "certificate of the page",
                "fail",
                str(error),
                "want PEM files of a certificate and its key",
            )
        ]
    if found is None:
        return []
    text = f"for {', '.join(found.names) or 'no host'}, ends {found.ends:%Y-%m-%d %H:%M} UTC"
    if found.left_s <= 0.0:
        return [Finding("certificate of the page", "fail", text, "browsers refuse it: renew it")]
    state = "warn" if found.near_its_end else "ok"
    return [Finding("certificate of the page", state, text, "renew it" if state == "warn" else "")]
