"""`gyrofree alarms`: the service, and what people ask of it from a terminal."""

import getpass
import json
from datetime import UTC, datetime
from typing import Annotated, Any

import typer
from google.protobuf.json_format import MessageToDict
from rich.table import Table

from gyrofree.commands.options import AsJson, Config, Verbose, say, settings_of, show_table
from gyrofree.operations.attending import attended
from gyrofree.running.process import fail, run_service
from messages.contract import gyrofree_pb2 as pb

app = typer.Typer(
    invoke_without_command=True,
    rich_markup_mode=None,
    help=(
        "Watch limits and faults, keep alarms, tell people; the subcommands ask the service that"
        " runs. docs/alarms.md"
    ),
)

Id = Annotated[str, typer.Argument(help="Of an alarm; `gyrofree alarms list` shows them.")]
Device = Annotated[str, typer.Option(help="That the alarm is of; empty for the bench's own.")]
Text = Annotated[str, typer.Option("--note", help="What is kept with it.")]
ROUTER_S = 5.0
WORDS = {"STATE_RETURNED": "returned, not acknowledged"}


@app.callback()
def service(context: typer.Context, config: Config = None, verbose: Verbose = False) -> None:
    """Watch limits and faults, keep alarms, tell people."""
    if context.invoked_subcommand is not None:
        return
    settings = settings_of(config)

    def body(stop) -> None:  # noqa: ANN001
        from dashboard.alarms import service as alarms

        bus = settings.bus.acting_as("alarms")
        alarms.run(settings.alarms, settings.recorder.root, bus, stop)

    run_service(body, verbose, attended(settings, "alarms"))


def _ask(config: Any, **command: Any) -> pb.AlarmReply:
    """The service's answer; ends the command with one line where there is none."""
    from messages.bus import orders
    from messages.bus.faults import BusUnavailable
    from messages.bus.session import open_client

    bus = settings_of(config).bus
    try:
        with open_client(bus, timeout_s=ROUTER_S) as session:
            order = pb.AlarmCommand(user=getpass.getuser()[:60], **command)
            reply = orders.give(session, bus.prefix, orders.ALARMS, order)
    except (BusUnavailable, orders.OrderError, ValueError) as error:
        raise fail(error) from None
    if not reply.ok:
        raise fail(reply.message or "the alarms did not do it")
    return reply


def _plain(message: Any) -> dict[str, Any]:
    return MessageToDict(
        message, preserving_proto_field_name=True, always_print_fields_with_no_presence=True
    )


def _when(utc_ns: int) -> str:
    if not utc_ns:
        return ""
    return datetime.fromtimestamp(utc_ns * 1e-9, UTC).strftime("%Y-%m-%d %H:%M:%S")


def _word(state: int) -> str:
    name = pb.Alarm.State.Name(state)
    return WORDS.get(name, name.removeprefix("STATE_").lower())


def _level(level: int) -> str:
    return pb.Alarm.Level.Name(level).removeprefix("LEVEL_").lower()


@app.command("list")
def list_alarms(as_json: AsJson = False, config: Config = None) -> None:
    """What is wrong now, and what was and nobody has acknowledged; and the limits."""
    reply = _ask(config, action=pb.AlarmCommand.ACTION_LIST)
    shown = [one for one in reply.alarms if one.state != pb.Alarm.STATE_NORMAL]
    if as_json:
        result = {
            "alarms": [_plain(one) for one in shown],
            "limits": [_plain(one) for one in reply.limits],
            "ways": [_plain(one) for one in reply.ways],
            "trouble": reply.trouble,
        }
        say(json.dumps(result, indent=2))
        return
    table = Table("device", "id", "level", "state", "since (UTC)", "what")
    for one in shown:
        state = _word(one.state) + (", not known now" if one.unknown else "")
        table.add_row(
            one.device or "(bench)",
            one.id,
            _level(one.level),
            state,
            _when(one.raised_utc_ns),
            f"{one.title}: {one.text}",
        )
    if shown:
        show_table(table)
    else:
        say("no alarm")
    for limit in reply.limits:
        for reading in limit.readings:
            say(f"limit {limit.name} of {reading.device}: {reading.said}")
    if reply.trouble:
        say(f"trouble: {reply.trouble}")


@app.command()
def acknowledge(id: Id, device: Device = "", note: Text = "", config: Config = None) -> None:
    """Take note of an alarm, in your name."""
    action = pb.AlarmCommand.ACTION_ACKNOWLEDGE
    say(_ask(config, action=action, device=device, id=id, text=note).message)


@app.command()
def shelve(
    id: Id,
    minutes: Annotated[
        float, typer.Option(min=0.1, max=10_080.0, help="It is silent for so long, min.")
    ],
    device: Device = "",
    reason: Annotated[str, typer.Option(help="Why it may be silent.")] = "",
    config: Config = None,
) -> None:
    """Silence an alarm for a while; it comes back by itself."""
    action = pb.AlarmCommand.ACTION_SHELVE
    seconds = 60.0 * minutes
    reply = _ask(config, action=action, device=device, id=id, text=reason, seconds=seconds)
    say(reply.message)


@app.command()
def unshelve(id: Id, device: Device = "", config: Config = None) -> None:
    """End the silence of an alarm now."""
    say(_ask(config, action=pb.AlarmCommand.ACTION_UNSHELVE, device=device, id=id).message)


@app.command()
def history(
    last: Annotated[int, typer.Option(min=1, max=300, help="So many events.")] = 50,
    as_json: AsJson = False,
    config: Config = None,
) -> None:
    """What happened to alarms and limits, the newest first."""
    events = _ask(config, action=pb.AlarmCommand.ACTION_LIST).history[:last]
    if as_json:
        say(json.dumps([_plain(one) for one in events], indent=2))
        return
    table = Table("when (UTC)", "device", "id", "level", "what", "who", "text")
    for one in events:
        table.add_row(
            _when(one.utc_ns), one.device, one.id, _level(one.level), one.what, one.who, one.text
        )
    if events:
        show_table(table)
    else:
        say("nothing has happened yet")


@app.command()
def test(config: Config = None) -> None:
    """Send a notice through every way out, and say how it went."""
    say(_ask(config, action=pb.AlarmCommand.ACTION_TEST).message)
