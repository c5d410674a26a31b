"""Faults of processes: killed, stopped, and the router away."""

import signal
import time

from support.one_thread import held

from faults.account import Account
from faults.bench import Bench
from faults.scenario import Alarmed, Certified, Line, Loss, Scenario, Status, Word
from messages.bus.pulse import MOST_S

STOPPED_S = MOST_S + 3.0  # longer than a turn of the supervisor may take
RESTARTED = "{} ended by signal SIGKILL: starting it again"


def killed(service: str, *said: Line, **more) -> Scenario:
    """kill -9 of a service that `up` looks after."""
    line = Line(RESTARTED.format(service))
    return Scenario(
        f"{service} killed",
        f"`kill -9` of {service}",
        lambda bench: bench.kill(service),
        said=(line, *said),
        **more,
    )


def frozen(service: str, seconds: float, *said, **more) -> Scenario:
    """SIGSTOP, and SIGCONT after so long."""
    return Scenario(
        f"{service} stopped for {seconds:g} s",
        f"SIGSTOP of {service}, SIGCONT after {seconds:g} s",
        lambda bench: bench.freeze(service, seconds),
        said=said,
        **more,
    )


def alarm(role: str) -> Alarmed:
    """That of a service of the bench."""
    return Alarmed(f"service-here-{role}")


def hold(bench: Bench, service: str, thread: str, role: str) -> None:
    """Stop one thread of a service until its alarm is there, as a debugger does."""
    with held(bench.pid(service), thread):
        about = f"service-here-{role}"
        bench.until(lambda: about in bench.watch.alarms, f"alarm {about}")


def stands(service: str, role: str, thread: str = "", *said: Word, **more) -> Scenario:
    """The thread that works hangs while the one that beats lives on."""
    return Scenario(
        f"{service} hangs",
        f"the thread of {service} that works is stopped, as by a debugger, until that is said",
        lambda bench: hold(bench, service, thread, role),
        said=(alarm(role), *said),
        **more,
    )


def away(bench: Bench, seconds: float) -> None:
    """No router for so long."""
    bench.stop_router()
    time.sleep(seconds)
    bench.start_router()


def away_and_gateway_killed(bench: Bench) -> None:
    """Both at once."""
    bench.stop_router()
    time.sleep(2.0)
    bench.kill("gateway")
    time.sleep(2.0)
    bench.start_router()


def guardian_killed(bench: Bench) -> None:
    """The gateway's guardian; its child goes on until the next one is loaded."""
    run = bench.watch.newest("link").header.run
    bench.processes("gateway")[0].send_signal(signal.SIGKILL)
    bench.until(lambda: bench.watch.newest("link").header.run != run, "another gateway")


def stop_supervisor(bench: Bench) -> None:
    """It has no session on the bus; one of its children beats for it."""
    up = bench.supervisor
    up.suspend()
    time.sleep(STOPPED_S)
    up.resume()


def all_killed(bench: Bench) -> None:
    """Everything at once, as without power, and all is started again."""
    bench.kill_all()
    bench.start_router()
    bench.start_up()


def certified(counted: Account) -> bool:
    return counted.missing == counted.said_missing


PROCESSES = (
    Scenario(
        "gateway killed",
        "`kill -9` of the gateway",
        lambda bench: bench.kill("gateway"),
        said=(Line("killed by SIGKILL: starting again"),),
        quick=True,
    ),
    killed("record", Line("recovered"), Line("going on where"), quick=True),
    killed("estimator", Line("going on from the state of before"), quick=True),
    killed("procedures"),
    killed("alarms"),
    killed("dashboard"),
    Scenario(
        "guardian killed",
        "`kill -9` of the gateway's guardian",
        guardian_killed,
        Loss("what the board says while the port changes hands", (0, 3000), complete=None),
        (
            Line("the process that guards this one is gone: handing over"),
            Certified("`missing_samples` of the certificate", certified),
        ),
    ),
    Scenario(
        "everything killed",
        "`kill -9` of all processes at once, guardian and router too, and all is started again",
        all_killed,
        Loss("what the board says until its port is open again", (0, 6000), complete=None),
        (Line("recovered"), Line("going on where")),
    ),
    frozen(
        "gateway",
        1.8,
        Status("`stops` of the link", "links", lambda link: link.stops > 0),
    ),
    frozen("record", 5.0, alarm("recorder")),
    frozen("estimator", 5.0, alarm("estimator"), Alarmed("estimator-products-ekf")),
    frozen("procedures", 5.0, alarm("procedures")),
    frozen("alarms", 5.0),  # nobody else says what is wrong
    frozen("dashboard", 5.0, alarm("dashboard")),
    frozen("router", 8.0, Alarmed("link")),
    stands("gateway", "gateway", "link cube"),
    stands("record", "recorder"),
    stands("estimator", "estimator", "estimator", Alarmed("estimator-products-ekf")),
    stands("procedures", "procedures"),
    stands("dashboard", "dashboard"),
    stands("router", "router"),
    Scenario(
        f"up stopped for {STOPPED_S:g} s",
        f"SIGSTOP of the supervisor, SIGCONT after {STOPPED_S:g} s",
        stop_supervisor,
        said=(alarm("up"),),
    ),
    Scenario(
        "router killed",
        "`kill -9` of the router, started again at once",
        lambda bench: away(bench, 0.0),
        quick=True,
    ),
    Scenario(
        "router away for 5 s",
        "router killed, started again after 5 s",
        lambda bench: away(bench, 5.0),
        said=(Alarmed("recorder"),),
    ),
    Scenario(
        "router away for 30 s",
        "router killed, started again after 30 s",
        lambda bench: away(bench, 30.0),
        said=(Alarmed("link"), Alarmed("recorder"), Alarmed("estimator-products-ekf")),
    ),
    Scenario(
        "gateway killed while there is no router",
        "router killed, gateway killed 2 s later, router started again after 2 s more",
        away_and_gateway_killed,
        said=(Line("killed by SIGKILL: starting again"),),
    ),
)
