"""What the page of an office has of a board, ten times a second as a JSON line: run it there.

It is the page's own feed and store, without the web.
"""

import json
import sys
import threading
import time
from pathlib import Path

from dashboard.data.device import Device
from dashboard.data.feed import Feed
from dashboard.data.store import Store
from messages.bus.session import BusSettings, open_client
from messages.contract.topics import ACCEL

EVERY_S = 0.1
PAST_S = 600.0


def said(device: Device, rate: int) -> dict:
    """Its newest sample and the rows of the last minutes, by UTC."""
    t, _ = device.window(ACCEL.name, "", device.t_newest - PAST_S, device.t_newest)
    return {
        "at": time.time(),
        "rate": rate,
        "newest": device.utc0_ns * 1e-9 + device.t_newest,
        "rows": [round(device.utc0_ns * 1e-9 + each, 2) for each in t[-6000:].tolist()],
        "late": len(device.late),
    }


def main() -> None:
    """Arguments: site, device, live."""
    site, name, live = sys.argv[1:]
    bus = BusSettings(prefix=site, router="tls/127.0.0.1:7447", tls=Path("var/site"))
    store, watched = Store(), threading.Event()
    watched.set()
    with open_client(bus.acting_as("dashboard")) as session:
        feed = Feed(session, site, store, watched, live=live)
        told = 0.0
        while True:
            time.sleep(EVERY_S)
            with store.lock:
                device = store.devices.get(name)
                if device is None or not device.rings:
                    continue
                line = said(device, store.preview_hz)
            line["lost"] = sum(lost for _, lost in feed._mender.counts().values())
            if line["at"] - told < 1.0:  # all rows are long
                line["rows"] = line["rows"][-1:]
            else:
                told = line["at"]
            print(json.dumps(line), flush=True)


if __name__ == "__main__":
    main()
