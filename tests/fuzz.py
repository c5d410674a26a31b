"""libFuzzer on the C decoder and on a whole board that is sent commands.

    python tests/fuzz.py [--seconds 60] [decoder|command ...]

Inputs that break something are written to build/fuzz/ and printed; the corpus grows there from run
to run.
"""

import argparse
import subprocess
import sys
from pathlib import Path

from support.firmware_support import COMMANDS, INCLUDES, SOURCES
from support.protocol_support import ROOT, stream_bytes, vectors

TARGETS = ("decoder", "command")
FLAGS = [
    "-std=c99",
    "-g",
    "-O1",
    "-Wall",
    "-Wextra",
    "-Wconversion",
    "-pedantic",
    "-Werror",
    "-fsanitize=fuzzer,address,undefined",
    "-fno-sanitize-recover=all",
]


def build(target: str, folder: Path) -> Path:
    """The fuzzer, compiled by clang."""
    folder.mkdir(parents=True, exist_ok=True)
    program = folder / f"gf_fuzz_{target}"
    source = ROOT / "tests" / "firmware_protocol" / "c" / f"gf_fuzz_{target}.c"
    subprocess.run(
        ["clang", *FLAGS, *INCLUDES, *map(str, [*SOURCES, source]), "-o", str(program)],
        check=True,
        timeout=120,
    )
    return program


def seeds(target: str) -> list[bytes]:
    """Where the fuzzer begins: all vectors, or one record per command and setting with time between
    them.
    """
    if target == "decoder":
        return [bytes.fromhex(v["wire"]) for v in vectors()["frame"]] + [
            stream_bytes(v) for v in vectors()["stream"]
        ]
    made = []
    for number in COMMANDS.values():
        for value in (b"", b"\x64\0\0\0", b"\x02\0\0\0", b"\0\x10\x0e\0"):
            body = number.to_bytes(2, "little") + b"\1\0" + value
            made.append(bytes([0, len(body)]) + body + bytes([255, 0]))
    stop, test = (COMMANDS[name].to_bytes(2, "little") for name in ("stop", "self_test"))
    made.append(b"\0\4" + stop + b"\1\0" + b"\0\4" + test + b"\2\0" + bytes([255, 0]) * 3)
    return made


def run(target: str, program: Path, folder: Path, *limits: str) -> subprocess.CompletedProcess:
    """Run it on the seeds and what earlier runs found."""
    corpus = folder / f"corpus_{target}"
    corpus.mkdir(parents=True, exist_ok=True)
    for i, seed in enumerate(seeds(target)):
        (corpus / f"seed_{i:03}").write_bytes(seed)
    return subprocess.run(
        [
            str(program),
            str(corpus),
            "-max_len=2048",
            f"-artifact_prefix={folder}/{target}_",
            "-print_final_stats=1",
            *limits,
        ],
        capture_output=True,
        text=True,
        timeout=7200,
    )


def main() -> int:
    parser = argparse.ArgumentParser(
        description="Fuzz the board's decoder and command handling with libFuzzer."
    )
    parser.add_argument(
        "targets", nargs="*", default=TARGETS, metavar="decoder|command", help="default: both"
    )
    parser.add_argument("--seconds", type=int, default=60, help="for each (default: 60)")
    options = parser.parse_args()
    folder = ROOT / "build" / "fuzz"
    failed = False
    for target in options.targets:
        print(f"{target}: {options.seconds} s ...", flush=True)
        done = run(target, build(target, folder), folder, f"-max_total_time={options.seconds}")
        failed = failed or done.returncode != 0
        told = ("stat::", "SUMMARY", "==", "Test unit")
        print("\n".join(line for line in done.stderr.splitlines() if line.startswith(told)))
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
