"""The photo of the unit under test: one beside the recording, told by its content, made small and
without what a camera writes into it (place, owner), and in the report with its digest.
"""

import hashlib
import io
import os
from dataclasses import dataclass
from pathlib import Path

from PIL import Image, ImageOps, UnidentifiedImageError

FILE = "unit-photo.jpg"
FORMATS = ("JPEG", "PNG")  # found in the bytes; names and types that are claimed do not count
MOST_BYTES = 8 << 20
MOST_PIXELS = 40_000_000
EDGE, QUALITY = 1600, 85  # px of the longer side, of what is kept


class PhotoError(ValueError):
    """Bytes that are no photo that is taken; the text says what was wanted."""


@dataclass(frozen=True)
class Photo:
    """As it is kept."""

    jpeg: bytes
    sha256: str


def kept_form(data: bytes) -> bytes:
    """A photo as it is kept: JPEG, upright, EDGE at most, pixels alone. Raises PhotoError."""
    if len(data) > MOST_BYTES:
        raise PhotoError(f"{len(data):,} bytes: want a photo of at most {MOST_BYTES:,}")
    try:
        with Image.open(io.BytesIO(data), formats=FORMATS) as image:
            width, height = image.size
            if width * height > MOST_PIXELS:
                raise PhotoError(f"{width} x {height} pixels: want at most {MOST_PIXELS:,}")
            upright = ImageOps.exif_transpose(image).convert("RGB")
    except UnidentifiedImageError:
        raise PhotoError("neither a JPEG nor a PNG: want a photo in one of these forms") from None
    except (OSError, SyntaxError, ValueError, EOFError, Image.DecompressionBombError) as error:
        if isinstance(error, PhotoError):
            raise
        raise PhotoError(f"a damaged picture ({str(error)[:80]}): save it anew") from None
    upright.thumbnail((EDGE, EDGE))
    plain = Image.new("RGB", upright.size)
    plain.paste(upright)
    kept = io.BytesIO()
    plain.save(kept, "JPEG", quality=QUALITY)
    return kept.getvalue()


def keep(folder: Path, data: bytes) -> Photo:
    """Put it beside the recording, in place of the one before. Raises PhotoError, OSError."""
    jpeg = kept_form(data)
    new = folder / (FILE + ".new")
    with new.open("wb") as stream:
        stream.write(jpeg)
        stream.flush()
        os.fsync(stream.fileno())
    os.replace(new, folder / FILE)
    return _photo(jpeg)


def read(folder: Path) -> Photo | None:
    """The session's photo; None where there is none. Raises OSError."""
    try:
        return _photo((folder / FILE).read_bytes())
    except FileNotFoundError:
        return None


def _photo(jpeg: bytes) -> Photo:
    return Photo(jpeg, hashlib.sha256(jpeg).hexdigest())
