"""Every key of gyrofree.toml, as the models have it: what the reference and written files say."""

import types
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

LIMITS = {"ge": "at least {}", "gt": "above {}", "le": "at most {}", "lt": "below {}"}
WORDS = {bool: "true or false", int: "integer", float: "number", str: "text", Path: "path"}


@dataclass(frozen=True)
class Key:
    """One field of a settings model."""

    name: str
    field: FieldInfo

    @property
    def text(self) -> str:
        """What it does."""
        return self.field.description or ""

    @property
    def unit(self) -> str:
        """Of its value; empty where it has none."""
        return self._extra.get("unit", "")

    @property
    def shown(self) -> bool:
        """Stands in a written file also while it has its default."""
        return bool(self._extra.get("shown"))

    @property
    def required(self) -> bool:
        """True where there is no default."""
        return self.field.is_required()

    @property
    def default(self) -> Any:
        """None also where there is none."""
        value = self.field.get_default(call_default_factory=True)
        return None if value is PydanticUndefined else value

    @property
    def model(self) -> type[BaseModel] | None:
        """The model of the tables below this key; None where its values are plain."""
        return _model_of(self.field.annotation)

    @property
    def kind(self) -> str:
        """Its type for people."""
        return _word(self.field.annotation)

    @property
    def limits(self) -> str:
        """What its value must keep to; empty where everything of its type goes."""
        said = []
        for rule in self.field.metadata:
            said += [
                form.format(f"{getattr(rule, name):,}".replace(",", " "))
                for name, form in LIMITS.items()
                if getattr(rule, name, None) is not None
            ]
        return ", ".join(said)

    @property
    def _extra(self) -> dict:
        extra = self.field.json_schema_extra
        return extra if isinstance(extra, dict) else {}


def keys_of(model: type[BaseModel]) -> list[Key]:
    """Its keys, those with plain values before those that are tables of their own."""
    found = [Key(name, field) for name, field in model.model_fields.items()]
    return sorted(found, key=lambda key: key.model is not None)


def tables(
    model: type[BaseModel], path: tuple[str, ...] = ()
) -> Iterator[tuple[tuple[str, ...], type[BaseModel]]]:
    """Every table that a file may have: its path (`*` for a name of the person's) and its model."""
    if path:
        yield path, model
    for key in keys_of(model):
        if key.model is not None:
            named = get_origin(key.field.annotation) is dict
            yield from tables(key.model, (*path, key.name, *(["*"] if named else [])))


def is_list(annotation: Any) -> bool:
    """True for list[...]: blocks with double brackets where they hold models."""
    return get_origin(annotation) is list


def _model_of(annotation: Any) -> type[BaseModel] | None:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next((m for inner in get_args(annotation) if (m := _model_of(inner))), None)


def _word(annotation: Any) -> str:
    if annotation in WORDS:
        return WORDS[annotation]
    inner = [a for a in get_args(annotation) if a is not type(None)]
    origin = get_origin(annotation)
    if origin in (Union, types.UnionType):
        return " or ".join(_word(a) for a in inner)
    if origin is list:
        return "blocks" if _model_of(inner[0]) else f"list of {_word(inner[0])}"
    if origin is tuple:
        return f"{len(inner)} {_word(inner[0])}s"
    if origin is dict:
        return f"{'table' if _model_of(inner[1]) else _word(inner[1])} by device name"
    if origin is not None:  # Annotated
        return _word(inner[0])
    return "table"
