"""`gyrofree orders`: who has the command, and what was ordered."""

import json
from datetime import UTC, datetime
from typing import Annotated

import typer
from google.protobuf.json_format import MessageToDict
from rich.table import Table

from gyrofree.commands.options import AsJson, Config, say, settings_of, show_table
from gyrofree.running.process import fail
from messages.contract import gyrofree_pb2 as pb

ROUTER_S = 5.0


def orders(
    last: Annotated[int, typer.Option(min=1, max=1000, help="So many, the newest first.")] = 50,
    find: Annotated[str, typer.Option(help="With these words, as a name or `refused`.")] = "",
    as_json: AsJson = False,
    config: Config = None,
) -> None:
    """Who has the command of the bench, and all orders with what came of each."""
    from messages.bus import orders as bus_orders
    from messages.bus.command.watch import name_of
    from messages.bus.faults import BusUnavailable
    from messages.bus.session import open_client

    bus, ask = settings_of(config).bus, pb.SeatCommand(text=find[:200], most=last)
    try:
        with open_client(bus, timeout_s=ROUTER_S) as session:
            reply = bus_orders.give(session, bus.prefix, bus_orders.SEAT, ask)
    except (BusUnavailable, bus_orders.OrderError, ValueError) as error:
        raise fail(error) from None
    holder = name_of(reply.status.holder) if reply.status.holder.id else ""
    if as_json:
        rows = [MessageToDict(one, preserving_proto_field_name=True) for one in reply.history]
        said = {"command": holder, "last": reply.status.last, "orders": rows, "lost": reply.lost}
        say(json.dumps(said, indent=2))
        return
    say(f"command: {holder or 'nobody has it'}")
    table = Table("when (UTC)", "who", "to", "what", "came of it", "after", "said")
    for one in reply.history:
        table.add_row(
            f"{datetime.fromtimestamp(one.at_utc_ns * 1e-9, UTC):%Y-%m-%d %H:%M:%S}",
            f"{one.user or 'nobody'} {one.place}".strip(),
            f"{one.whom} {one.device}".strip(),
            one.what,
            pb.OrderGiven.Outcome.Name(one.outcome).removeprefix("OUTCOME_").replace("_", " "),
            f"{one.seconds:.2f} s",
            one.text,
        )
    if reply.history:
        show_table(table)
    else:
        say("no order yet")
