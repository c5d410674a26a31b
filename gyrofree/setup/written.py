"""Settings as the text of a gyrofree.toml, each key with what it does behind it."""

import textwrap
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import tomli_w
from pydantic import BaseModel

from gateway.settings import DeviceSettings
from gyrofree.config import Settings
from gyrofree.setup.keys import Key, is_list, keys_of
from messages.text import plain

WIDTH = 110  # characters of a line
EXAMPLE = DeviceSettings(
    name="cube", port="/dev/serial/by-id/usb-FTDI_FT232R_USB_UART_A50285BI-if00-port0"
)
DEFAULTS = (
    "The configuration of one installation: the defaults in force, as `gyrofree config default`"
    " writes them. Every key is optional; docs/configuration.md has all of them. A wrong key is"
    " refused with its nearest name. `gyrofree setup` finds the board and fills this in."
)


def shipped() -> str:
    """The file of the defaults."""
    example = "\n".join(_table(("gateway", "devices"), EXAMPLE, False, True)).strip()
    blocks = "One block per board:\n" + example
    return as_toml(Settings(), DEFAULTS, after={"gateway": blocks})


def as_toml(
    settings: Settings,
    head: str = "",
    everything: bool = False,
    after: Mapping[str, str] | None = None,
) -> str:
    """A file that gives these settings.

    everything: also the keys that have their default. after: comments behind a section.
    """
    lines = _comment(head) if head else []
    for key in keys_of(Settings):
        lines += _table((key.name,), getattr(settings, key.name), everything)
        if after and key.name in after:
            lines += ["", *(f"# {line}".rstrip() for line in after[key.name].splitlines())]
    return "\n".join(lines).strip("\n") + "\n"


def _table(
    path: tuple[str, ...], model: BaseModel, everything: bool, block: bool = False
) -> list[str]:
    """A table with what stands below it; nothing where all of it is as it is anyway."""
    plain: list[tuple[str, str]] = []
    below: list[str] = []
    for key in keys_of(type(model)):
        value = getattr(model, key.name)
        if not (everything or _stands(key) or value != key.default):
            continue
        if value is None and key.default is None:
            continue
        if key.model is not None:
            for name, inner, listed in _inner(key, value):
                below += _table((*path, *name), inner, everything, listed)
        elif isinstance(value, Mapping):
            below += _names((*path, key.name), key, value)
        else:
            plain.append((f"{_name(key.name)} = {_value(value)}", _said(key)))
    if not plain:
        return below
    header = f"[[{_joined(path)}]]" if block else f"[{_joined(path)}]"
    return ["", header, *_aligned(plain), *below]


def _stands(key: Key) -> bool:
    """True for what is written also while it has its default."""
    inner = keys_of(key.model) if key.model is not None else []
    return key.shown or key.required or any(k.shown for k in inner)


def _names(path: tuple[str, ...], key: Key, value: Mapping) -> list[str]:
    """A table of values by names of the person's; nothing where there is none."""
    if not value:
        return []
    lines = [f"{_name(name)} = {_value(inner)}" for name, inner in value.items()]
    return ["", f"[{_joined(path)}]  # {_said(key)}", *lines]


def _inner(key: Key, value: Any) -> Iterator[tuple[tuple[str, ...], BaseModel, bool]]:
    """Models below a key: their path from here, and whether they are blocks of a list."""
    if isinstance(value, BaseModel):
        yield (key.name,), value, False
    elif is_list(key.field.annotation):
        for one in value:
            yield (key.name,), one, True
    elif key.model is not None:
        for name, one in value.items():
            yield (key.name, name), one, False


def _aligned(pairs: list[tuple[str, str]]) -> list[str]:
    """Keys with their comments behind them, or above where they are too long."""
    short = [len(text) for text, said in pairs if len(text) < 48]
    column = max(short, default=0) + 2
    lines = []
    for text, said in pairs:
        line = f"{text:<{column}}# {said}" if len(text) < column else f"{text}  # {said}"
        lines += [line] if len(line) <= WIDTH else [*_comment(said), text]
    return lines


def _said(key: Key) -> str:
    return f"{key.unit}, {key.text}" if key.unit not in ("", "1") else key.text


def _comment(text: str) -> list[str]:
    return [
        f"# {line}"
        for line in textwrap.wrap(plain(text, 4 * WIDTH), WIDTH - 2, break_on_hyphens=False)
    ]


def _joined(path: tuple[str, ...]) -> str:
    return ".".join(map(_name, path))


def _name(key: str) -> str:
    return _right({key: 0}).partition(" = ")[0] if not key.isidentifier() else key


def _value(value: Any) -> str:
    """As TOML, which has no word for none: where that is meant, the text is empty."""
    if value is None:
        return '""'
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_value, value))}]"
    return _right({"k": str(value) if isinstance(value, Path) else value}).partition(" = ")[2]


def _right(table: dict) -> str:
    return tomli_w.dumps(table).strip()
