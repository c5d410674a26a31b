"""viser's messages as far as they must be understood: what each role may send, which widget is
whose.

A message of a browser is one msgpack map with its class name under "type" (viser/infra/_messages,
Message.deserialize); there are no batches towards the server.
"""

import logging
import math
from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Any

import msgspec
import zstandard

from dashboard.web.auth import Role

log = logging.getLogger(__name__)

ROLE = "Role"  # label of the input by which the scene is told who looks; nobody else writes there
TEXT_LENGTH = 6000  # characters of an input
NAME_LENGTH = 300  # of an identifier or a node's name
FAR = 1e9  # of a number without a bound of its own
WHOLE = 1 << 62

Rule = Callable[[object], bool]


def number(low: float = -FAR, high: float = FAR) -> Rule:
    """A finite number in between."""
    return lambda value: (
        isinstance(value, float | int)
        and not isinstance(value, bool)
        and math.isfinite(value)
        and low <= value <= high
    )


def whole(value: object) -> bool:
    """A natural number that no arithmetic is afraid of."""
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value <= WHOLE


def vector(size: int) -> Rule:
    """So many numbers, finite ones."""
    one = number()
    return lambda value: isinstance(value, list) and len(value) == size and all(map(one, value))


def name(value: object) -> bool:
    """An identifier or the name of a node."""
    return isinstance(value, str) and len(value) <= NAME_LENGTH


# what a browser may send: class -> its fields, all of them and no others
VIEWER_MAY: dict[str, dict[str, Rule]] = {
    "ViewerCameraMessage": {
        "wxyz": vector(4),
        "position": vector(3),
        "fov": number(0.0, math.pi),
        "near": number(0.0),
        "far": number(0.0),
        "image_height": whole,
        "image_width": whole,
        "look_at": vector(3),
        "up_direction": vector(3),
    },
    "FileTransferPartAck": {  # it only counts a download's progress
        "source_component_uuid": lambda value: value is None or name(value),
        "transfer_uuid": name,
        "transferred_bytes": whole,
        "total_bytes": whole,
    },
}
OPERATOR_MAY: dict[str, dict[str, Rule]] = VIEWER_MAY | {
    "GuiUpdateMessage": {"uuid": name, "updates": lambda value: isinstance(value, dict)},
    "CommandTriggerMessage": {"uuid": name},
    "TransformControlsUpdateMessage": {
        "name": name,
        "wxyz": vector(4),
        "position": vector(3),
        "owner": name,
    },
    "TransformControlsDragStartMessage": {"name": name, "owner": name},
    "TransformControlsDragEndMessage": {"name": name, "owner": name},
}
MAKES_INPUT = frozenset(
    {
        "GuiButtonMessage",
        "GuiButtonGroupMessage",
        "GuiCheckboxMessage",
        "GuiDropdownMessage",
        "GuiSliderMessage",
        "GuiTextMessage",
    }
)  # to a browser; of the inputs that the scene has
BOUNDS = ("min", "max", "options")  # properties that say what values a widget takes
DROPPED_QUIETLY = frozenset({"GetRenderResponseMessage", "LocalStorageGetItemResponseMessage"})
_decode = msgspec.msgpack.Decoder(dict)


class BadMessage(ValueError):
    """Bytes from a browser that are no message of viser's."""


def message_type(data: bytes) -> tuple[str, dict]:
    """Class name and fields of a browser's message; raises BadMessage. Nesting is bounded by
    msgspec.
    """
    try:
        fields = _decode.decode(data)
    except (
        msgspec.DecodeError,
        msgspec.ValidationError,
        RecursionError,
        UnicodeDecodeError,
    ) as error:
        raise BadMessage(f"{len(data)} bytes are no msgpack map: {error}") from None
    kind = fields.get("type")
    if not isinstance(kind, str):
        raise BadMessage("a map without a text under 'type'")
    return kind, fields


def update(uuid: str, value: str) -> bytes:
    """The message by which a browser gives an input a value."""
    fields = {"type": "GuiUpdateMessage", "uuid": uuid, "updates": {"value": value}}
    return msgspec.msgpack.encode(fields)


def may_send(role: Role, kind: str, fields: dict, widgets: "Widgets") -> bool:
    """True when this role may send this message, and it holds what such a message holds.

    A widget update may only carry "value", and one that the widget can have: viser would set any
    property of the widget, for all browsers, and turns a value into the widget's type by force.
    Widgets that change nothing for others (pause of one's own view) viewers may use, too.
    """
    known = OPERATOR_MAY if role >= Role.operator or kind == "GuiUpdateMessage" else VIEWER_MAY
    rules = known.get(kind)
    if rules is None or set(fields) != {"type", *rules}:
        return False
    if not all(rule(fields[key]) for key, rule in rules.items()):
        return False
    if kind != "GuiUpdateMessage":
        return True
    uuid, updates = fields["uuid"], fields["updates"]
    if uuid == widgets.role:
        return False
    if role < Role.operator and uuid not in widgets.open:
        return False
    return set(updates) == {"value"} and widgets.takes(uuid, updates["value"])


@dataclass
class Widget:
    """An input as the browser has been told of it."""

    kind: str  # the message that made it
    props: dict[str, Any]

    def takes(self, value: object) -> bool:
        """Is this a value that a person can give it?"""
        if self.kind in ("GuiButtonMessage", "GuiCheckboxMessage"):
            return isinstance(value, bool)
        if self.kind == "GuiSliderMessage":
            low, high = self.props.get("min"), self.props.get("max")
            return number()(low) and number()(high) and number(low, high)(value)
        if not isinstance(value, str) or len(value) > TEXT_LENGTH:
            return False
        return self.kind == "GuiTextMessage" or value in self.props.get("options", ())


class _Sent(msgspec.Struct):
    """What is read of one message of viser's to a browser."""

    type: str = ""
    uuid: Any = None
    props: msgspec.Raw = msgspec.Raw(b"")
    updates: msgspec.Raw = msgspec.Raw(b"")


class _Frame(msgspec.Struct):
    """One WebSocket message of viser's."""

    messages: list[_Sent] = []


class Widgets:
    """A connection's widgets: what values they take, and which of them anybody may use: those made
    under a label of `open_labels`.

    viser names a widget to the browser by an identifier that its interface keeps to itself; the
    browser is told it, with the label, when the widget is made. What cannot be read opens nothing.
    """

    def __init__(self, open_labels: Collection[str]) -> None:
        self._labels = frozenset(open_labels)
        self._frames = msgspec.msgpack.Decoder(_Frame)
        self._zstd = zstandard.ZstdDecompressor()
        self._known: dict[str, Widget] = {}
        self.open: set[str] = set()  # identifiers
        self.role = ""  # identifier of the input labelled ROLE

    def takes(self, uuid: str, value: object) -> bool:
        """Is there such a widget, and can it have this value?"""
        widget = self._known.get(uuid)
        return widget is not None and widget.takes(value)

    def learn(self, data: bytes) -> None:
        """Read one WebSocket message on its way to the browser: sizes, then msgpack under zstd."""
        try:
            packed = int.from_bytes(data[8:16], "little")
            sent = self._frames.decode(self._zstd.decompress(data[16 : 16 + packed])).messages
            for message in sent:
                if isinstance(message.uuid, str):
                    self._learn(message, message.uuid)
        except (zstandard.ZstdError, msgspec.DecodeError) as error:
            log.warning("a message of the scene cannot be read, so it opens nothing: %s", error)

    def _learn(self, message: _Sent, uuid: str) -> None:
        if message.type in MAKES_INPUT:
            props = _decode.decode(message.props)
            self._known[uuid] = Widget(message.type, props)
            if props.get("label") == ROLE:
                self.role = uuid
            elif props.get("label") in self._labels:
                self.open.add(uuid)
        elif message.type == "GuiUpdateMessage" and uuid in self._known:
            changed = _decode.decode(message.updates)
            self._known[uuid].props |= {k: v for k, v in changed.items() if k in BOUNDS}
        elif message.type == "GuiRemoveMessage":
            self._known.pop(uuid, None)
            self.open.discard(uuid)
