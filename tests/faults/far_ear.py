"""A watch (watch.py) at another place: run it there. A JSON line asks, a JSON line answers."""

import json
import sys
from pathlib import Path

from faults.watch import Watch
from messages.bus.orders import OrderError
from messages.bus.session import BusSettings

ROUTER, FOLDER = "tls/127.0.0.1:7447", Path("var/site")
ROLE = "dashboard"  # hears all, and may order a recording


def answer(watch: Watch, what: str, *words) -> object:
    """What was asked for; raises OrderError."""
    match what:
        case "begin":
            return watch.begin()
        case "record":
            return watch.record(*words)
        case "stop":
            return watch.stop()
        case "well":
            return watch.well(*words)
    return {
        "alarms": sorted(watch.alarms),
        "active": sorted(getattr(watch, "active", ())),
        "recording": watch.recording,
        "durable": watch.durable,
    }


def main() -> None:
    """Argument: the site."""
    bus = BusSettings(prefix=sys.argv[1], router=ROUTER, tls=FOLDER)
    watch = Watch(bus.acting_as(ROLE))
    for line in sys.stdin:
        try:
            said = {"is": answer(watch, *json.loads(line))}
        except OrderError as error:
            said = {"refused": str(error)}
        print(json.dumps(said), flush=True)
    watch.close()


if __name__ == "__main__":
    main()
