"""Small PMTiles files for tests: one tile of the whole world, drawn by our own few lines."""

import gzip
import json
import struct
import zlib
from pathlib import Path

HEADER = struct.Struct("<7sB11Q6B4iBii")
MVT, PNG = 1, 2
EXTENT = 4096


def archive(path: Path, tile: bytes, kind: int, metadata: dict, packed: bool = True) -> Path:
    """A file of version 3 with one tile, zoom 0."""
    pack = gzip.compress if packed else bytes
    tile = pack(tile) if kind == MVT else tile
    # entries: how many; numbers, run lengths, lengths and offsets + 1 of each
    root = pack(b"\x01\x00\x01" + varint(len(tile)) + b"\x01")
    meta = pack(json.dumps(metadata).encode())
    at = HEADER.size
    data = at + len(root) + len(meta)
    code = 2 if packed else 1
    sections = (at, len(root), at + len(root), len(meta), data, 0, data, len(tile), 1, 1, 1)
    low, high = (-180, -85), (180, 85)
    corners = (round(v * 1e7) for v in (*low, *high))
    tile_code = code if kind == MVT else 1
    head = HEADER.pack(b"PMTiles", 3, *sections, 1, code, tile_code, kind, 0, 0, *corners, 0, 0, 0)
    path.write_bytes(head + root + meta + tile)
    return path


def vector(path: Path, layer: str = "water", packed: bool = True) -> Path:
    """A world whose one layer covers all of it."""
    metadata = {
        "vector_layers": [{"id": layer}],
        "attribution": '<a href="https://example.org">Tiles of the test</a>',
    }
    return archive(path, mvt(layer), MVT, metadata, packed)


def raster(path: Path, colour: tuple[int, int, int]) -> Path:
    """A world of one colour."""
    return archive(path, png(colour), PNG, {})


def varint(value: int) -> bytes:
    out = bytearray()
    while value > 127:
        out.append(value & 127 | 128)
        value >>= 7
    return bytes([*out, value])


def part(number: int, data: bytes) -> bytes:
    """A field of bytes of a protobuf message."""
    return varint(number << 3 | 2) + varint(len(data)) + data


def mvt(layer: str) -> bytes:
    """A vector tile with one polygon over all of it."""

    def zigzag(value: int) -> bytes:
        return varint((value << 1) ^ (value >> 31))

    side = EXTENT + 200
    moves = [(-100, -100), (side, 0), (0, side), (-side, 0)]
    draw = [varint(9), *map(zigzag, moves[0]), varint(3 << 3 | 2)]
    draw += [zigzag(v) for move in moves[1:] for v in move] + [varint(15)]
    feature = b"\x18\x03" + part(4, b"".join(draw))  # type: polygon
    body = part(1, layer.encode()) + part(2, feature) + b"\x28" + varint(EXTENT) + b"\x78\x02"
    return part(3, body)


def png(colour: tuple[int, int, int], side: int = 256) -> bytes:
    """A square of one colour."""

    def chunk(name: bytes, data: bytes) -> bytes:
        body = name + data
        return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))

    rows = (b"\0" + bytes(colour) * side) * side
    head = struct.pack(">IIBBBBB", side, side, 8, 2, 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", head)
        + chunk(b"IDAT", zlib.compress(rows))
        + (chunk(b"IEND", b""))
    )
