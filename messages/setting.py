"""A key of gyrofree.toml: its default, unit, limits and what it does, at one place.

The reference (docs/configuration.md), the file that is shipped and the one that `gyrofree setup`
writes are made from these, so none of them can claim another default than the one in force.
"""

from typing import Any

from pydantic import Field


def setting(
    default: Any = ..., text: str = "", *, unit: str = "", shown: bool = False, **limits: Any
) -> Any:
    """A field of a settings model.

    default: left out where the key must be there; a list or table is copied for every model. text:
    what the key does, without a full stop at its end. unit: of the value. shown: stands in a
    written gyrofree.toml also while it has its default. limits: as pydantic's Field has them.
    """
    extra = {"unit": unit, "shown": shown}
    return Field(default, description=text, json_schema_extra=extra, **limits)
