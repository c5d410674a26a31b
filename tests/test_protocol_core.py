"""The C99 core against the Python side: the same vectors, and the same events for streams damaged at random."""

import random
import struct
import subprocess
from pathlib import Path

import pytest
from protocol_support import ROOT, payload_of, printed, stream_bytes, vectors

from firmware_protocol.codec import Deframer, encode
from firmware_protocol.frames import Acc12, Status, Unknown
from firmware_protocol.payloads import pack

CORE = ROOT / "firmware_protocol" / "core"
STRICT = ["-std=c99", "-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror"]
SANITIZED = ["-g", "-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]


@pytest.fixture(scope="module")
def harness(tmp_path_factory) -> Path:
    """The core and its harness, warnings as errors, with sanitizers."""
    program = tmp_path_factory.mktemp("core") / "gf_harness"
    sources = [str(CORE / "gf_frame.c"), str(ROOT / "tests" / "c" / "gf_harness.c")]
    subprocess.run(["gcc", *STRICT, *SANITIZED, "-I", str(CORE), *sources, "-o", str(program)], check=True, timeout=120)
    return program


def run(harness: Path, mode: str, data: bytes) -> str:
    done = subprocess.run([str(harness), mode], input=data, capture_output=True, timeout=120)
    assert done.returncode == 0, done.stderr.decode()
    return done.stdout.decode()


def decoded(harness: Path, streams: list[bytes]) -> list[str]:
    """What C makes of each stream, one text per stream."""
    text = run(harness, "decode", b"".join(struct.pack("<I", len(stream)) + stream for stream in streams))
    texts, current = [], ""
    for line in text.splitlines(keepends=True):
        current += line
        if line.startswith("P "):
            texts.append(current)
            current = ""
    return texts


def python_decoded(stream: bytes) -> str:
    deframer = Deframer()
    return printed(deframer.feed(stream), deframer.pending)


def encoded(harness: Path, items: list[tuple[int, dict, bytes]]) -> list[str]:
    """Wire bytes in hex that C makes of (type, header, payload)."""
    records = bytearray()
    for type_, header, payload in items:
        values = (header[name] for name in ("epoch", "flags", "seq", "t_us"))
        records += struct.pack("<BBBIQH", type_, *values, len(payload)) + payload
    return run(harness, "encode", bytes(records)).splitlines()


def compare(harness: Path, streams: list[bytes]) -> None:
    for stream, text in zip(streams, decoded(harness, streams), strict=True):
        assert text == python_decoded(stream), stream.hex()


def test_the_core_uses_no_library(tmp_path):
    """Freestanding: the object file wants nothing but what a compiler may always call, and owns no writable memory."""
    made = tmp_path / "gf_frame.o"
    subprocess.run(["gcc", *STRICT, "-Os", "-ffreestanding", "-c", "-I", str(CORE), str(CORE / "gf_frame.c"), "-o",
                    str(made)], check=True, timeout=120)
    symbols = subprocess.run(["nm", str(made)], capture_output=True, text=True, check=True, timeout=60).stdout
    kinds = {line.split()[-1]: line.split()[-2] for line in symbols.splitlines()}
    assert {name for name, kind in kinds.items() if kind == "U"} <= {"memcpy", "memset", "memmove", "memcmp",
                                                                     "__stack_chk_fail", "_GLOBAL_OFFSET_TABLE_"}
    assert not {name for name, kind in kinds.items() if kind in "BbDdC"}


def test_vectors_encode_the_same_in_c(harness):
    items = [(v["type"], {k: int(v[k]) for k in ("epoch", "flags", "seq", "t_us")}, pack(payload_of(v)))
             for v in vectors()["frame"]]
    assert encoded(harness, items) == [v["wire"] for v in vectors()["frame"]]


def test_vectors_decode_the_same_in_c(harness):
    compare(harness, [bytes.fromhex(v["wire"]) for v in vectors()["frame"]])
    compare(harness, [stream_bytes(v) for v in vectors()["stream"]])


def test_both_encoders_agree_on_every_payload_length(harness):
    chance = random.Random(1)
    header = {"epoch": 1, "flags": 0, "seq": 0x01020304, "t_us": 0x0102030405060708}
    fillings = [lambda n: chance.randbytes(n), lambda n: bytes(n), lambda n: b"\xff" * n]
    items = [(0x14, header, filling(n)) for n in range(489) for filling in fillings]
    made = encoded(harness, items)
    assert made == [encode(Unknown(0x14, payload), **header).hex() for _, _, payload in items]
    compare(harness, [bytes.fromhex("".join(made[i : i + 50])) for i in range(0, len(made), 50)])


def test_the_c_encoder_refuses_what_exceeds_the_wire(harness):
    header = {"epoch": 1, "flags": 0, "seq": 1, "t_us": 1}
    assert encoded(harness, [(0x14, header, bytes(489)), (0x14, header, bytes(488))])[0] == ""


def damaged_stream(chance: random.Random) -> bytes:
    """Frames of all lengths, with bytes changed, cut out, put in, and runs beyond the limits."""
    wire = bytearray()
    for i in range(chance.randrange(1, 30)):
        match chance.randrange(12):
            case 0:
                wire += chance.randbytes(chance.randrange(60))
            case 1:
                wire += bytes([chance.choice((0, 0, 1, 0x55, 0xFF))]) * chance.randrange(505, 1540)
            case 2:
                wire += b"\0" * chance.randrange(4)
            case 3:
                wire += encode(Status(*range(6)), epoch=i, seq=i, t_us=i)
            case 4 | 5:
                wire += encode(Acc12(i, 1, 15, 0, ((i, 0, -1) * 4,) * chance.randrange(20)), epoch=1, seq=i, t_us=i)
            case _:
                size = chance.choice((0, 1, 92, 230, 235, 484, 488, chance.randrange(489)))
                payload = bytes(size) if chance.random() < 0.1 else chance.randbytes(size)
                wire += encode(Unknown(chance.choice((0x14, 0x10, 0x11, 0x12, 0x99)), payload), epoch=1, seq=i, t_us=i)
    for _ in range(chance.randrange(6)):
        at = chance.randrange(len(wire) + 1)
        wire[at : at + chance.randrange(20)] = chance.randbytes(chance.randrange(4))
    return bytes(wire)


@pytest.mark.parametrize("seed", range(4))
def test_streams_damaged_at_random_give_the_same_events_in_c(harness, seed):
    chance = random.Random(seed)
    compare(harness, [damaged_stream(chance) for _ in range(300)])


def test_small_chunks_decode_the_same_in_c(harness):
    """Every chunk of one and two bytes, where the stuffing has its corners."""
    chunks = [bytes([a]) for a in range(1, 256)] + [bytes([a, b]) for a in range(1, 256) for b in (1, 2, 3, 254, 255)]
    compare(harness, [b"\0" + chunk + b"\0" for chunk in chunks])
