"""How fast the emulated board is, and how busy the image keeps its processor.

Speed is emulated seconds per second of processor time on one core (and of wall time, which other
programs slow down).
"""

import hashlib
import json
import subprocess
import tempfile
import time
from dataclasses import asdict
from pathlib import Path

from emulator.board import Board
from emulator.load import load
from firmware_protocol.codec import encode
from firmware_protocol.frames import Command
from firmware_protocol.spec import SPEC

ROOT = Path(__file__).resolve().parents[2]
SETTINGS = {entry["name"]: entry["id"] for entry in SPEC.raw["setting"]}


def setting(name: str, value: int, token: int = 1) -> bytes:
    """The bytes of a CMD that sets something."""
    return encode(
        Command(SETTINGS[name], token, value.to_bytes(4, "little")), epoch=0, seq=token, t_us=0
    )


def speed(image: Path, rate_hz: int, seconds: float) -> dict:
    """Emulate at a sample rate; the digest is of everything that was sent."""
    board = Board(image)
    board.run(0.1)
    board.feed(setting("rate_hz", rate_hz))
    board.run(0.5)
    cpu, wall, digest = time.process_time(), time.monotonic(), hashlib.sha256()
    digest.update(board.run(0.5 + seconds))
    cpu, wall = time.process_time() - cpu, time.monotonic() - wall
    return {
        "figure": "emulated seconds per second",
        "rate_hz": rate_hz,
        "of_cpu": round(seconds / cpu, 2),
        "of_wall": round(seconds / wall, 2),
        "sent": digest.hexdigest()[:16],
    }


def main() -> None:
    """One JSON line per figure."""
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(
            ["make", "-s", "-C", ROOT / "firmware_protocol/port/lpc1768", f"OUT={folder}"],
            check=True,
            stdout=subprocess.DEVNULL,
        )
        image = Path(folder) / "gyrofree.bin"
        speed(image, 100, 0.5)  # compiles
        runs = [speed(image, 100, 10.0), speed(image, 1000, 3.0), speed(image, 1000, 3.0)]
        for run in runs:
            print(json.dumps(run), flush=True)
        print(
            json.dumps(
                {"figure": "two runs byte-identical", "value": runs[1]["sent"] == runs[2]["sent"]}
            )
        )
        for rate, baud in ((100, 921600), (1000, 921600), (3200, 3_000_000)):
            found = load(
                image,
                commands=setting("baud", baud),
                settle_s=0.5,
                seconds=0.5,
                follow_up=lambda board, rate=rate: (
                    board.run(0.2),
                    board.feed(setting("rate_hz", rate, 2)),
                ),
            )
            rounded = {name: float(f"{value:.4g}") for name, value in asdict(found).items()}
            print(
                json.dumps({"figure": "processor load", "rate_hz": rate, "baud": baud, **rounded}),
                flush=True,
            )


if __name__ == "__main__":
    main()
