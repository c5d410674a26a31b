"""An order to the recorder of a site, given at the lab: `python -m support.far_order start ID`."""

import sys
from pathlib import Path

from messages.bus import orders
from messages.bus.session import BusSettings, open_client
from messages.contract import gyrofree_pb2 as pb

PATIENCE_S = 20.0
ACTIONS = {
    "start": pb.RecorderCommand.ACTION_START,
    "stop": pb.RecorderCommand.ACTION_STOP,
}


def main() -> None:
    """Arguments: site, start or stop, and a name for the session."""
    site, action, *name = sys.argv[1:]
    bus = BusSettings(prefix=site, router="tls/127.0.0.1:7447", tls=Path("var/site"))
    order = pb.RecorderCommand(action=ACTIONS[action], name="".join(name), user="bench")
    with open_client(bus.acting_as("operator")) as session:
        orders.give(session, site, orders.RECORDER, order, timeout_s=PATIENCE_S)


if __name__ == "__main__":
    main()
