"""viser's messages as far as they must be understood: what each role may send, which widget is
whose.

A message of a browser is one msgpack map with its class name under "type" (viser/infra/_messages,
Message.deserialize); there are no batches towards the server.
"""

import logging
from collections.abc import Collection
from typing import Any

import msgspec
import zstandard

from dashboard.web.auth import Role

log = logging.getLogger(__name__)

VIEWER_MAY = frozenset(
    {"ViewerCameraMessage", "FileTransferPartAck"}
)  # the second only counts a download's progress
OPERATOR_MAY = VIEWER_MAY | {
    "GuiUpdateMessage",
    "GuiButtonHoldMessage",
    "GuiFormSubmitMessage",
    "GuiFormDirtyMessage",
    "CommandTriggerMessage",
    "ScenePointerMessage",
    "SceneNodeClickMessage",
    "SceneNodeDragMessage",
    "TransformControlsUpdateMessage",
    "TransformControlsDragStartMessage",
    "TransformControlsDragEndMessage",
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
    name = fields.get("type")
    if not isinstance(name, str):
        raise BadMessage("a map without a text under 'type'")
    return name, fields


def may_send(role: Role, name: str, fields: dict, open_widgets: Collection[str] = ()) -> bool:
    """True when this role may send this message.

    A widget update may only carry "value": viser would set any property of the widget, for all
    browsers. open_widgets are uuids of widgets that change nothing for others (pause of one's own
    view); viewers may use those (Widgets).
    """
    if name == "GuiUpdateMessage":
        updates = fields.get("updates")
        if not isinstance(updates, dict) or set(updates) != {"value"}:
            return False
        uuid = fields.get("uuid")
        return role >= Role.operator or (isinstance(uuid, str) and uuid in open_widgets)
    return name in (OPERATOR_MAY if role >= Role.operator else VIEWER_MAY)


class _Sent(msgspec.Struct):
    """What is read of one message of viser's to a browser."""

    type: str = ""
    uuid: Any = None
    props: msgspec.Raw = msgspec.Raw(b"")


class _Frame(msgspec.Struct):
    """One WebSocket message of viser's."""

    messages: list[_Sent] = []


class Widgets:
    """Which of a connection's widgets anybody may use: those made under a label of `open_labels`.

    viser names a widget to the browser by an identifier that its interface keeps to itself; the
    browser is told it, with the label, when the widget is made. What cannot be read opens nothing.
    """

    def __init__(self, open_labels: Collection[str]) -> None:
        self._labels = frozenset(open_labels)
        self._frames = msgspec.msgpack.Decoder(_Frame)
        self._zstd = zstandard.ZstdDecompressor()
        self.open: set[str] = set()  # identifiers

    def learn(self, data: bytes) -> None:
        """Read one WebSocket message on its way to the browser: sizes, then msgpack under zstd."""
        try:
            packed = int.from_bytes(data[8:16], "little")
            sent = self._frames.decode(self._zstd.decompress(data[16 : 16 + packed])).messages
        except (zstandard.ZstdError, msgspec.DecodeError) as error:
            log.warning("a message of the scene cannot be read, so it opens nothing: %s", error)
            return
        for message in sent:
            if message.type in MAKES_INPUT and isinstance(message.uuid, str):
                label = _decode.decode(message.props).get("label")
                if label in self._labels:
                    self.open.add(message.uuid)
