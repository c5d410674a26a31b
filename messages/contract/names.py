"""What a name on the bus looks like."""

import re
from typing import Annotated

from pydantic import AfterValidator

NAME = re.compile(r"[a-z][a-z0-9_-]{0,31}")


def _is_a_name(text: str) -> str:
    if not NAME.fullmatch(text):
        raise ValueError(
            f"{text!r}: want a-z, 0-9, _ and - after a first letter, at most 32 characters"
        )
    return text


Name = Annotated[str, AfterValidator(_is_a_name)]  # of a setting that stands in a key
