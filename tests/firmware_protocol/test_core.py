"""The C99 core against the Python side: the same vectors, and the same events for streams damaged
at random.
"""

import dataclasses
import random
import struct
import subprocess
from pathlib import Path

import pytest
from support.protocol_damage import damaged_truth
from support.protocol_support import ROOT, payload_of, printed, receive, stream_bytes, vectors

from firmware_protocol.codec import REASONS, Damaged, Deframer, Frame, encode
from firmware_protocol.frames import Acc12, Status, Unknown
from firmware_protocol.ledger import Ledger
from firmware_protocol.payloads import pack
from firmware_protocol.spec import SPEC

CORE = ROOT / "firmware_protocol" / "core"
STRICT = ["-std=c99", "-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror"]
SANITIZED = ["-g", "-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]


@pytest.fixture(scope="module")
def harness(tmp_path_factory) -> Path:
    """The core and its harness, warnings as errors, with sanitizers."""
    program = tmp_path_factory.mktemp("core") / "gf_harness"
    core = [str(CORE / name) for name in ("gf_frame.c", "gf_payload.c", "gf_command.c")]
    sources = [*core, str(ROOT / "tests" / "firmware_protocol" / "c" / "gf_harness.c")]
    subprocess.run(
        ["gcc", *STRICT, *SANITIZED, "-I", str(CORE), *sources, "-o", str(program)],
        check=True,
        timeout=120,
    )
    return program


def run(harness: Path, mode: str, data: bytes) -> str:
    done = subprocess.run([str(harness), mode], input=data, capture_output=True, timeout=120)
    assert done.returncode == 0, done.stderr.decode()
    return done.stdout.decode()


def decoded(harness: Path, streams: list[bytes]) -> list[str]:
    """What C makes of each stream, one text per stream."""
    text = run(
        harness, "decode", b"".join(struct.pack("<I", len(stream)) + stream for stream in streams)
    )
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


@pytest.mark.parametrize("source", sorted(path.name for path in CORE.glob("*.c")))
def test_the_core_uses_no_library(tmp_path, source):
    """Freestanding: an object file wants nothing but the core and what a compiler may always call,
    and owns no writable memory."""
    made = tmp_path / "core.o"
    subprocess.run(
        [
            "gcc",
            *STRICT,
            "-Os",
            "-ffreestanding",
            "-c",
            "-I",
            str(CORE),
            str(CORE / source),
            "-o",
            str(made),
        ],
        check=True,
        timeout=120,
    )
    symbols = subprocess.run(
        ["nm", str(made)], capture_output=True, text=True, check=True, timeout=60
    ).stdout
    kinds = {line.split()[-1]: line.split()[-2] for line in symbols.splitlines()}
    outside = {name for name, kind in kinds.items() if kind == "U" and not name.startswith("gf_")}
    assert outside <= {
        "memcpy",
        "memset",
        "memmove",
        "memcmp",
        "__stack_chk_fail",
        "_GLOBAL_OFFSET_TABLE_",
    }
    assert not {name for name, kind in kinds.items() if kind in "BbDdC"}


def test_vectors_encode_the_same_in_c(harness):
    items = [
        (v["type"], {k: int(v[k]) for k in ("epoch", "flags", "seq", "t_us")}, pack(payload_of(v)))
        for v in vectors()["frame"]
    ]
    assert encoded(harness, items) == [v["wire"] for v in vectors()["frame"]]


def test_vectors_decode_the_same_in_c(harness):
    compare(harness, [bytes.fromhex(v["wire"]) for v in vectors()["frame"]])
    compare(harness, [stream_bytes(v) for v in vectors()["stream"]])


def flat(value: object) -> list[int]:
    """Numbers of a field in wire order."""
    if isinstance(value, bytes | tuple):
        return [number for item in value for number in flat(item)]
    if dataclasses.is_dataclass(value):
        return [
            number
            for field in dataclasses.fields(value)
            for number in flat(getattr(value, field.name))
        ]
    return [value]


def test_vectors_are_built_from_fields_the_same_in_c(harness):
    """Left out: a HELLO of another minor version, and ACKs longer than any that a device sends."""
    known = [
        v
        for v in vectors()["frame"]
        if v["type"] in SPEC.layouts
        and len(v["fields"].get("echo", "")) <= 64
        and v["fields"].get("minor", SPEC.minor) == SPEC.minor
    ]
    assert {v["type"] for v in known} == set(SPEC.layouts)
    lines = [" ".join(map(str, [v["type"], *flat(payload_of(v))])) for v in known]
    made = run(harness, "pack", ("\n".join(lines) + "\n").encode()).splitlines()
    assert made == [pack(payload_of(v)).hex() for v in known]


def test_a_full_payload_takes_no_more(harness):
    rows = (*range(12),) * 20
    lines = [f"16 1 2 15 0 {' '.join(map(str, rows[: 12 * n]))}" for n in (19, 20)]
    lines += [f"18 0 1 {' '.join(['7'] * n)}" for n in (120, 121)]
    lines += [f"20 {' '.join(['7'] * n)}" for n in (488, 489)]
    made = run(harness, "pack", ("\n".join(lines) + "\n").encode()).splitlines()
    assert [len(text) // 2 for text in made] == [468, 0, 488, 0, 488, 0]


def c_frames(text: str) -> list[Frame]:
    """The frames that C printed."""
    frames = []
    for line in text.splitlines():
        if line.startswith("F "):
            type_, epoch, flags, seq, t_us, wire, *payload = line.split()[1:]
            raw = bytes.fromhex("".join(payload))
            frames.append(
                Frame(int(type_), int(epoch), int(flags), int(seq), int(t_us), raw, int(wire))
            )
    return frames


def ledger_of(text: str, size: int) -> Ledger:
    """The ledger over the events that C printed."""
    ledger, frames = Ledger(), iter(c_frames(text))
    ledger.received(size)
    for kind, *rest in map(str.split, text.splitlines()):
        if kind == "F":
            ledger.count(next(frames))
        elif kind == "D":
            ledger.count(Damaged(bytes(int(rest[1])), REASONS[int(rest[0]) - 1]))
        else:
            assert ledger.unaccounted(int(rest[0])) == 0
    return ledger


def test_the_ledger_is_the_same_from_the_events_of_c(harness):
    chance = random.Random(7)
    streams = [stream_bytes(v) for v in vectors()["stream"]] + [
        damaged_stream(chance) for _ in range(200)
    ]
    for stream, text in zip(streams, decoded(harness, streams), strict=True):
        assert ledger_of(text, len(stream)) == receive(stream)[1]


@pytest.mark.parametrize("seed", [1, 2])
def test_what_c_counts_as_lost_is_lost_and_what_it_accepts_was_sent(harness, seed):
    """5,000 frames damaged in five ways; tests/bench/bench_conformance.py does 100,000."""
    truth = damaged_truth(seed, 5_000, 100, 20)
    [text] = decoded(harness, [truth.wire])
    ledger, frames = ledger_of(text, len(truth.wire)), c_frames(text)
    assert ledger.lost_frames == 5_000 - len(frames) > 20 == ledger.device_dropped
    assert ledger.link_lost == ledger.lost_frames - 20
    assert [f.seq for f in frames if f[:6] != Deframer().feed(truth.sent[f.seq])[0][:6]] == []


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
                wire += encode(
                    Acc12(i, 1, 15, 0, ((i, 0, -1) * 4,) * chance.randrange(20)),
                    epoch=1,
                    seq=i,
                    t_us=i,
                )
            case _:
                size = chance.choice((0, 1, 92, 230, 235, 484, 488, chance.randrange(489)))
                payload = bytes(size) if chance.random() < 0.1 else chance.randbytes(size)
                wire += encode(
                    Unknown(chance.choice((0x14, 0x10, 0x11, 0x12, 0x99)), payload),
                    epoch=1,
                    seq=i,
                    t_us=i,
                )
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
    chunks = [bytes([a]) for a in range(1, 256)] + [
        bytes([a, b]) for a in range(1, 256) for b in (1, 2, 3, 254, 255)
    ]
    compare(harness, [b"\0" + chunk + b"\0" for chunk in chunks])
