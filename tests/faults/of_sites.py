"""Faults of a site's certificates, on a bench whose links are all encrypted."""

import datetime as dt
import subprocess
import time

from faults.bench import Bench
from faults.scenario import Alarmed, Line, Scenario
from gyrofree.running.process import command
from sites.authority import Authority, new_key, pem, private_pem, request_for
from sites.place import write_identity

SITE = "lab"
LIFE_S = 20.0  # enough for a service to start with it on a busy machine
ENDED_S = 5.0  # that it is without one


def ended(bench: Bench, role: str) -> None:
    """The certificate of a role ends while it is in use, and is renewed."""
    key = new_key()
    life = dt.timedelta(seconds=LIFE_S)
    boards = ("cube",) if role == "gateway" else ()
    request = request_for(key, role)
    made = Authority(bench.site).issue(request, role, SITE, devices=boards, life=life)
    write_identity(bench.site, role, private_pem(key), pem(made))
    if role == "router":
        bench.stop_router()
        bench.start_router()
    since = time.monotonic_ns()
    bench.until(lambda: bench.well(since), "bench with the short certificate")
    left = made.not_valid_after_utc - dt.datetime.now(dt.UTC)
    time.sleep(max(0.0, left.total_seconds()) + ENDED_S)
    subprocess.run(
        command("certs", "renew", role, "--config", str(bench.config)),
        check=True,
        capture_output=True,
        cwd=bench.folder,
    )
    if role == "router":
        bench.stop_router()
        bench.start_router()


def of(role: str, *said) -> Scenario:
    """The certificate of one role."""
    return Scenario(
        f"certificate of the {role} ends",
        f"in mid-session; renewed after {ENDED_S:g} s",
        lambda bench: ended(bench, role),
        said=said,
        on="site",
    )


ENDED = Line("its certificate ended", r"\(its certificate ended")

SITES = (
    of("gateway", ENDED, Alarmed(f"certificate-{SITE}-gateway")),
    of("recorder", ENDED, Alarmed("recorder")),
    of("estimator", ENDED, Alarmed(f"certificate-{SITE}-estimator")),
    of("router", Line("the router is gone", r"router \S+ is gone")),
)
