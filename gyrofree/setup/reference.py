"""docs/configuration.md, made from the models: `gyrofree config reference > docs/configuration.md`.

A test says when the page is behind them.
"""

from pathlib import Path
from typing import Any

from pydantic import BaseModel

from gyrofree.config import Settings
from gyrofree.setup.keys import Key, is_list, keys_of, tables

HEAD = """# Configuration

Made from the models of the settings by `gyrofree config reference > docs/configuration.md`.

One file, `gyrofree.toml`, read by every process: `--config FILE`, else the one in the working
folder, else the defaults below. Every key is optional unless it says *needed*. A key that is not
known is refused with its nearest name, a value out of its range with its line. Relative paths are
taken from the folder that the process runs in. Any encoding of text and any line end is read.

- `gyrofree setup` finds the board, asks and writes the file.
- `gyrofree config check` reads it as the services do; `gyrofree config show` prints what is in
  force, `--all` with every default, `--json` for programs.
- `gyrofree config default` prints the file that is shipped: the keys that people change, at their
  defaults.
"""


def page() -> str:
    """The whole page."""
    lines = [HEAD]
    places: dict[tuple[str, type[BaseModel]], list[str]] = {}
    for path, model in tables(Settings):
        places.setdefault((path[0], model), []).append(_title(path))
    for (_, model), titles in places.items():
        first, *others = titles
        also = [f"Also {', '.join(others)}.", ""] if others else []
        lines += [f"## {first}", "", _first(model), "", *also, *_rows(model), ""]
    return "\n".join(lines).rstrip() + "\n"


def _title(path: tuple[str, ...]) -> str:
    name = ".".join("NAME" if part == "*" else part for part in path)
    key = next(k for k in keys_of(_owner(path)) if k.name == [p for p in path if p != "*"][-1])
    return f"`[[{name}]]`" if is_list(key.field.annotation) else f"`[{name}]`"


def _owner(path: tuple[str, ...]) -> type[BaseModel]:
    """The model that has the last named key of a path."""
    model: type[BaseModel] = Settings
    *before, _ = [part for part in path if part != "*"]
    for part in before:
        model = next(k.model for k in keys_of(model) if k.name == part)  # type: ignore[assignment]
    return model


def _first(model: type[BaseModel]) -> str:
    """The first paragraph of its docstring, without the name of its table."""
    text = " ".join((model.__doc__ or "").split("\n\n")[0].split())
    head, colon, rest = text.partition("]: ")
    return rest[:1].upper() + rest[1:] if colon and head.startswith("[") else text


def _rows(model: type[BaseModel]) -> list[str]:
    head = ("key", "type", "unit", "default", "range", "what it does")
    rows = [head, ("---",) * len(head)]
    for key in keys_of(model):
        rows.append(
            (f"`{key.name}`", key.kind, key.unit, _default(key), key.limits, _cell(key.text))
        )
    return ["| " + " | ".join(cell or " " for cell in row) + " |" for row in rows]


def _default(key: Key) -> str:
    if key.required:
        return "*needed*"
    value = key.default
    if isinstance(value, BaseModel) or key.model is not None:
        return "its own" if isinstance(value, BaseModel) else "none"
    return f"`{_plain(value)}`" if value not in (None, {}) else "none"


def _plain(value: Any) -> str:
    match value:
        case bool():
            return str(value).lower()
        case str() | Path():
            return f'"{value}"'
        case list() | tuple():
            return f"[{', '.join(map(_plain, value))}]"
        case int():
            return f"{value:_}" if value >= 100_000 else str(value)
    return str(value)


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("<", "&lt;")
