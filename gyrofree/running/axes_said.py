"""What the axis monitor said last in a row of messages, in the words of `gyrofree run`."""

from collections.abc import Iterable, Iterator

from inertial.rate.axis_fault import axis_word
from inertial.rate.axis_verdicts import good_of
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import AXES, parse


def keeping_axes(
    rows: Iterable[tuple[int, str, bytes]], last: dict[str, bytes]
) -> Iterator[tuple[int, str, bytes]]:
    """The rows (time, key, payload); `last` keeps the newest axis health, by bus key."""
    for row in rows:
        if parse(row[1]).topic is AXES:
            last[row[1]] = row[2]
        yield row


def axes_said(payload: bytes) -> str:
    """How many axes are good, and what is wrong with the others."""
    said = pb.AxisHealth.FromString(payload)
    states = {axis.name: axis_word(axis.state, axis.excluded) for axis in said.axes}
    good = f"axes: {good_of(states)}"
    return (
        said.message
        if said.message.startswith(good)
        else "; ".join(filter(None, (good, said.message)))
    )
