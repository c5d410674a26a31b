"""An order in words, for its history."""

from google.protobuf.message import Message

from messages.text import plain

FIELDS = ("name", "value", "procedure", "unit", "text", "note", "id", "seconds", "until")
HUSHED = ("list", "status", "none")  # they ask, and change nothing


def words(command: Message) -> str:
    """The action and what was given with it; empty for what only asks."""
    fields = command.DESCRIPTOR.fields_by_name
    action = fields.get("action")
    said = [] if getattr(command, "ask", False) else ["set"]
    if action is not None:
        number = command.action
        found = action.enum_type.values_by_number.get(number)
        word = "?" if found is None else found.name.removeprefix("ACTION_").lower()
        said = [] if word in HUSHED else [word.replace("_", " ")]
    if not said:
        return ""
    for name in FIELDS:
        value = getattr(command, name) if name in fields else None
        if value or (name == "value" and action is None):
            shown = plain(value, 60) if isinstance(value, str) else f"{value:g}"
            said.append(shown if name in ("name", "value", "procedure") else f"{name} {shown}")
    return plain(" ".join(said), 200)
