"""One PMTiles file (version 3): whether it can be used, and what is in it.

Only its header, its first directory and its metadata are read here; tiles are read by the browser,
as ranges of the file.
"""

import json
import re
import struct
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from messages.text import plain

HEADER = struct.Struct("<7sB11Q6B4iBii")
FIRST = 16384  # bytes, in which header and first directory lie
LARGEST = 16 << 20  # bytes of metadata or of a directory, unpacked
NONE, GZIP = 1, 2  # how directories, metadata and tiles are packed
KINDS = {1: "vector", 2: "raster", 3: "raster", 4: "raster", 5: "raster"}  # MVT PNG JPEG WebP AVIF
DEEPEST = 30
LAYERS, WORDS = 64, 300  # of the metadata, that are told


class ArchiveError(ValueError):
    """The file cannot be used; the sentence names the file and says what to do."""


@dataclass(frozen=True)
class Archive:
    """What a file holds. bounds: west, south, east, north, deg."""

    path: Path
    size: int
    tag: str  # of this state of the file
    kind: str  # "vector" or "raster"
    zooms: tuple[int, int]
    bounds: tuple[float, float, float, float]
    attribution: str
    layers: tuple[str, ...]


def tag_of(path: Path) -> tuple[int, str]:
    """Bytes of the file, and the entity tag of its state. Raises OSError."""
    found = path.stat()
    return found.st_size, f'"{found.st_mtime_ns:x}-{found.st_size:x}"'


def open_archive(path: Path) -> Archive:
    """Look at a file. Raises ArchiveError."""
    try:
        size, tag = tag_of(path)
        if not path.is_file():
            raise ArchiveError(f"{path.name} is no file: [dashboard] map wants one PMTiles file")
        with path.open("rb") as file:
            first = file.read(FIRST)
            header = _header(path.name, first, size)
            root = first[header.root : header.root + header.root_bytes]
            _unpacked(path.name, "its first directory", root, header.packing)
            file.seek(header.meta)
            meta = _metadata(path.name, file.read(header.meta_bytes), header.packing)
    except FileNotFoundError:
        text = f"{path.name} is not there: put the file there, or change [dashboard] map"
        raise ArchiveError(text) from None
    except OSError as error:
        raise ArchiveError(f"{path.name} cannot be read: {error.strerror}") from None
    return Archive(
        path,
        size,
        tag,
        header.kind,
        header.zooms,
        header.bounds,
        _words(meta.get("attribution")),
        _layers(meta.get("vector_layers")),
    )


@dataclass(frozen=True)
class _Header:
    root: int
    root_bytes: int
    meta: int
    meta_bytes: int
    packing: int
    kind: str
    zooms: tuple[int, int]
    bounds: tuple[float, float, float, float]


def _header(name: str, first: bytes, size: int) -> _Header:
    if len(first) < HEADER.size or first[:7] != b"PMTiles":
        raise ArchiveError(f"{name} is no PMTiles file: make one with `pmtiles extract`")
    found = HEADER.unpack_from(first)
    version, root, root_bytes, meta, meta_bytes, leaf, leaf_bytes, data, data_bytes = found[1:10]
    _, packing, tile_packing, kind, low, high = found[13:19]
    if version != 3:
        raise ArchiveError(f"{name} is of PMTiles version {version}; convert it to version 3")
    for what, at, length in (
        ("first directory", root, root_bytes),
        ("metadata", meta, meta_bytes),
        ("directories", leaf, leaf_bytes),
        ("tiles", data, data_bytes),
    ):
        if at + length > size:
            text = f"{name} is cut off: its {what} should reach to byte {at + length} of {size}"
            raise ArchiveError(f"{text}; copy it again")
    if root + root_bytes > FIRST or meta_bytes > LARGEST:
        raise ArchiveError(f"{name} is damaged: its first directory lies beyond {FIRST} bytes")
    if packing not in (NONE, GZIP) or tile_packing not in (NONE, GZIP):
        raise ArchiveError(f"{name} is packed in a way that browsers cannot read; use gzip")
    if kind not in KINDS:
        raise ArchiveError(f"{name} holds tiles of kind {kind}; MVT, PNG, JPEG, WebP or AVIF do")
    bounds = tuple(value / 1e7 for value in found[19:23])
    west, south, east, north = bounds
    if not (low <= high <= DEEPEST and -180 <= west <= east <= 180 and -90 <= south <= north <= 90):
        raise ArchiveError(f"{name} is damaged: zooms {low} to {high}, bounds {bounds}")
    return _Header(root, root_bytes, meta, meta_bytes, packing, KINDS[kind], (low, high), bounds)


def _unpacked(name: str, what: str, data: bytes, packing: int) -> bytes:
    if packing == NONE:
        return data
    unpacker = zlib.decompressobj(wbits=31)
    try:
        found = unpacker.decompress(data, LARGEST)
    except zlib.error:
        raise ArchiveError(f"{name} is damaged: {what} cannot be unpacked") from None
    if not unpacker.eof:
        raise ArchiveError(f"{name} is damaged: {what} is not whole, or too large")
    return found


def _metadata(name: str, data: bytes, packing: int) -> dict[str, Any]:
    if not data:
        return {}
    text = _unpacked(name, "its metadata", data, packing)
    try:
        found = json.loads(text)
    except (ValueError, RecursionError):
        raise ArchiveError(f"{name} is damaged: its metadata is no JSON") from None
    return found if isinstance(found, dict) else {}


def _words(value: object) -> str:
    """A text without the tags that attributions come with."""
    return plain(re.sub(r"<[^>]*>", "", value), WORDS) if isinstance(value, str) else ""


def _layers(value: object) -> tuple[str, ...]:
    listed = value if isinstance(value, list) else []
    names = [one.get("id") for one in listed if isinstance(one, dict)]
    return tuple(plain(name, 64) for name in names if isinstance(name, str))[:LAYERS]
