"""`gyrofree site status`: who is there, as the page of places shows it."""

import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated, Any

import typer
import zenoh
from rich.table import Table

from dashboard.data.places import people_said, places
from gyrofree.commands.options import AsJson, Config, say, settings_of, show_table
from gyrofree.running.process import EXIT_FAILED, fail
from messages.bus.beating import place_of
from messages.bus.faults import BusUnavailable, IdentityError
from messages.bus.presence import LOOK_S, Change, Presence, State, Watching
from messages.bus.session import BusSettings, connected, open_client, subscribe
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import BEAT

ROUTER_S = 5.0
PATIENCE_S = 5.0
LISTEN_S = 2.0  # by then a process that runs has spoken, and one that is frozen has not


def site_status(
    follow: Annotated[
        bool, typer.Option("--follow", "-f", help="Go on: a line for each change, until Ctrl-C.")
    ] = False,
    as_json: AsJson = False,
    config: Config = None,
) -> None:
    """Which services of which places run, hang, are frozen or gone, whose clock is off, how many
    look.

    Ends with 1 where something hangs, is frozen or gone.
    """
    settings = settings_of(config)
    try:
        with _watching(settings.bus) as (session, presence):
            changes = _listen(session, presence, LISTEN_S)
            if not presence.processes:  # a busy router takes its time
                changes += _listen(session, presence, PATIENCE_S)
            found = places(presence)
            _show(found, as_json)
            if follow:
                for change in _until_told(session, presence, changes):
                    _say(change, as_json)
    except (BusUnavailable, IdentityError) as error:
        raise fail(error, EXIT_FAILED) from None
    except KeyboardInterrupt:
        return
    well = (State.RUNNING.value, State.ENDED.value)
    if any(one["state"] not in well for one in found):
        raise typer.Exit(EXIT_FAILED)


@contextmanager
def _watching(bus: BusSettings) -> Iterator[tuple[zenoh.Session, Presence]]:
    presence = Presence(place_of(bus))
    with open_client(bus, timeout_s=ROUTER_S) as session:
        watch = Watching(session, bus.prefix, presence)

        def heard(key: str, beat: pb.Beat) -> None:
            _, place, _, name = key.split("/")
            presence.beat(place, name, beat)

        beats = subscribe(session, BEAT, bus.prefix, heard)
        try:
            yield session, presence
        finally:
            beats.undeclare()
            watch.undeclare()


def _listen(session: zenoh.Session, presence: Presence, seconds: float) -> list[Change]:
    """Look for so long, by the watch's own time; what changed."""
    changes, end = [], presence.now_s + seconds
    while presence.now_s < end:
        time.sleep(LOOK_S / 2)
        changes += presence.look(time.monotonic(), connected(session))
    return changes


def _until_told(
    session: zenoh.Session, presence: Presence, known: list[Change]
) -> Iterator[Change]:
    told = {(one.process.place, one.process.name) for one in known}
    told |= set(presence.processes)
    while True:
        for key in set(presence.processes) - told:
            told.add(key)
            yield Change(presence.processes[key], State.UNKNOWN)
        yield from presence.look(time.monotonic(), connected(session))
        time.sleep(LOOK_S / 2)


def _say(change: Change, as_json: bool) -> None:
    one = change.process
    at = time.strftime("%H:%M:%S", time.gmtime())
    if as_json:
        line = {"utc": at, "place": one.place, "role": one.role, "name": one.name}
        return say(json.dumps(line | {"state": one.state.value, "before": change.before.value}))
    say(f"{at} {one.role} at {one.place}: {one.state.value} (was {change.before.value})")


def _show(found: list[dict[str, Any]], as_json: bool) -> None:
    if as_json:
        return say(json.dumps({"places": found}, indent=1))
    if not found:
        return say("nobody is there: does `gyrofree up` run?")
    for place in found:
        say(f"{place['name']}: {place['state']}, {people_said(place['people'], place['state'])}")
        table = Table("service", "state", "boards", "clock against the site's", box=None)
        for one in place["services"]:
            waits = ", ".join(one["waits"])
            boards = ", ".join(one["devices"]) + (f" (waits for {waits})" if waits else "")
            table.add_row(one["name"], one["state_said"], boards, one["clock"])
        show_table(table)
