"""Shared by the tests of the firmware: building it, and its board logic in a world of models
(tests/c/gf_world.c).
"""

import subprocess
from functools import cache
from pathlib import Path

from firmware_protocol.codec import Damaged, Deframer, Frame, encode
from firmware_protocol.frames import Ack, Command, Payload
from firmware_protocol.ledger import Ledger
from firmware_protocol.spec import SPEC
from support.protocol_support import ROOT

FIRMWARE = ROOT / "firmware_protocol"
PARTS = [FIRMWARE / name for name in ("core", "drivers", "board")]
SOURCES = sorted(source for part in PARTS for source in part.glob("*.c"))
INCLUDES = [f"-I{part}" for part in PARTS]
STRICT = ["-std=c99", "-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror"]
SANITIZED = ["-g", "-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]

COMMANDS = {entry["name"]: entry["id"] for entry in SPEC.raw["command"] + SPEC.raw["setting"]}
RESULTS = {entry["name"]: entry["id"] for entry in SPEC.raw["result"]}


def compiled(program: Path, *sources: Path) -> Path:
    """Core, drivers and board with these sources, warnings as errors, with sanitizers."""
    subprocess.run(
        [
            "gcc",
            *STRICT,
            *SANITIZED,
            *INCLUDES,
            *map(str, [*SOURCES, *sources]),
            "-o",
            str(program),
        ],
        check=True,
        timeout=120,
    )
    return program


@cache
def firmware_image(out: Path) -> Path:
    """`make firmware` into a folder; the folder."""
    subprocess.run(
        ["make", "-j2", "-C", str(FIRMWARE / "port" / "lpc1768"), f"OUT={out}"],
        check=True,
        timeout=120,
        capture_output=True,
    )
    return out


class World:
    """A script for gf_world, and what the host received from it."""

    def __init__(self, program: Path) -> None:
        self.program, self.script, self.token = program, ["boot"], 0
        self.frames: list[Frame] = []
        self.ledger = Ledger()
        self.other: list[str] = []  # changes of rate, reboots

    def say(self, *lines: str) -> "World":
        self.script += lines
        return self

    def command(self, name: str | int, value: int | None = None, arguments: bytes = b"") -> "World":
        """Put a CMD on the line; tokens count from 1."""
        self.token += 1
        number = COMMANDS[name] if isinstance(name, str) else name
        data = arguments if value is None else value.to_bytes(4, "little")
        return self.say(
            "host " + encode(Command(number, self.token, data), epoch=0, seq=0, t_us=0).hex()
        )

    def play(self) -> "World":
        done = subprocess.run(
            [str(self.program)],
            input="\n".join(self.script) + "\n",
            capture_output=True,
            text=True,
            timeout=120,
        )
        assert done.returncode == 0, done.stderr
        deframer = Deframer()
        for line in done.stdout.splitlines():
            if not line.startswith("W "):
                self.other.append(line)
                continue
            wire = bytes.fromhex(line[2:])
            self.ledger.received(len(wire))
            for event in deframer.feed(wire):
                assert not isinstance(event, Damaged), event
                self.ledger.count(event)
                self.frames.append(event)
        assert self.ledger.unaccounted(deframer.pending) == 0
        return self

    def of(self, kind: type) -> list[Payload]:
        return [frame.payload for frame in self.frames if frame.type == kind.TYPE]

    def acks(self) -> list[Ack]:
        return self.of(Ack)
