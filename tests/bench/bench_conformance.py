"""100,000 frames, 1,000 of them damaged in five ways, through the C core and the Python deframer.

Prints, for each, the frames counted as lost, those truly lost, and those accepted that differ from
what was sent.
"""

import json
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]

from support.protocol_damage import Truth, damaged_truth  # noqa: E402
from support.protocol_support import receive  # noqa: E402

from firmware_protocol.codec import Deframer, Frame  # noqa: E402
from firmware_protocol.ledger import Ledger  # noqa: E402
from tests.firmware_protocol.test_core import CORE, c_frames, ledger_of  # noqa: E402

N_FRAMES, N_DAMAGES, N_DROPS, SEEDS = 100_000, 1_000, 150, (20_260, 1)


def harness(folder: Path) -> Path:
    """The C core as it is fast, without sanitizers."""
    program = folder / "gf_harness"
    sources = [
        *map(str, CORE.glob("*.c")),
        str(ROOT / "tests" / "firmware_protocol" / "c" / "gf_harness.c"),
    ]
    subprocess.run(
        ["gcc", "-std=c99", "-O2", "-I", str(CORE), *sources, "-o", str(program)],
        check=True,
        timeout=120,
    )
    return program


def in_c(program: Path, wire: bytes) -> tuple[list[Frame], Ledger]:
    done = subprocess.run(
        [str(program), "decode"],
        input=struct.pack("<I", len(wire)) + wire,
        capture_output=True,
        check=True,
        timeout=120,
    )
    text = done.stdout.decode()
    return c_frames(text), ledger_of(text, len(wire))


def in_python(wire: bytes) -> tuple[list[Frame], Ledger]:
    _, ledger, events = receive(wire)
    return [event for event in events if isinstance(event, Frame)], ledger


def report(language: str, seed: int, truth: Truth, frames: list[Frame], ledger: Ledger) -> None:
    wrong = sum(frame[:6] != Deframer().feed(truth.sent[frame.seq])[0][:6] for frame in frames)
    print(
        json.dumps(
            {
                "bench": "conformance",
                "language": language,
                "seed": seed,
                "frames": N_FRAMES,
                "damages": N_DAMAGES,
                "lost_counted": ledger.lost_frames,
                "lost_truly": N_FRAMES - len(frames),
                "dropped_by_device": ledger.device_dropped,
                "bad_chunks": ledger.bad_chunks,
                "wrongly_accepted": wrong,
            }
        ),
        flush=True,
    )


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        program = harness(Path(folder))
        for seed in SEEDS:
            truth = damaged_truth(seed, N_FRAMES, N_DAMAGES, N_DROPS)
            began = time.perf_counter()
            from_c, from_python = in_c(program, truth.wire), in_python(truth.wire)
            report("C", seed, truth, *from_c)
            report("Python", seed, truth, *from_python)
            same = from_c[1] == from_python[1]
            print(
                json.dumps(
                    {
                        "bench": "conformance",
                        "seed": seed,
                        "same_ledger": same,
                        "same_frames": from_c[0] == from_python[0],
                        "seconds": round(time.perf_counter() - began, 1),
                    }
                ),
                flush=True,
            )


if __name__ == "__main__":
    main()
