"""Add a frame to the wire: an entry of spec.toml and a class are all that the codec needs.

Shown: the entry for a frame with the temperatures of a board's sensors, the class with the same
fields, and the frame on its way through the codec: COBS, header and CRC around it, cut anywhere by
the line, with a damaged byte counted and passed over. In the product the entry goes into
firmware_protocol/spec.toml and the class into firmware_protocol/frames.py; CONTRIBUTING.md names
what else wants to know of it. Here both are added while the program runs.

    python examples/add_wire_frame.py
"""

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from firmware_protocol import frames, spec

ENTRY = """
[[frame]]
type = 0x1F
name = "TEMPERATURE"
class = "Temperature"
since = 1
text = "Temperatures of the sensors, once a second."
[[frame.field]]
name = "sensor_mask"
type = "u32"
text = "bit i: sensor i has a reading"
[[frame.field]]
name = "centi_kelvin"
type = "u16[4]"
unit = "0.01 K"
text = "one per sensor, 0 where there is none"
"""


@dataclass(frozen=True, slots=True)
class Temperature:
    """Temperatures of the sensors, once a second."""

    TYPE: ClassVar[int] = 0x1F

    sensor_mask: int
    centi_kelvin: tuple[int, int, int, int]


def register() -> None:
    """What editing spec.toml and frames.py does. Raises SpecError where the two disagree."""
    frames.Temperature = Temperature  # type: ignore[attr-defined]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "spec.toml"
        path.write_text(spec.SPEC_PATH.read_text(encoding="utf-8") + ENTRY, encoding="utf-8")
        spec.SPEC.layouts[Temperature.TYPE] = spec.load(path).layouts[Temperature.TYPE]


def main() -> list[Temperature]:
    """The frames that came through."""
    register()
    from firmware_protocol.codec import Damaged, Deframer, encode  # once the frame is known

    sent = [Temperature(0b1111, (29315 + k, 29400, 29510, 29290)) for k in range(3)]
    wire = [encode(frame, epoch=1, seq=k, t_us=k * 1_000_000) for k, frame in enumerate(sent)]
    print(f"{len(wire[0])} bytes on the wire: {wire[0].hex()}")
    wire[1] = wire[1][:20] + bytes([wire[1][20] ^ 0x04]) + wire[1][21:]  # a bit turned on the line

    deframer, received = Deframer(), []
    stream = b"".join(wire)
    for start in range(0, len(stream), 7):  # as a serial port hands it over
        for event in deframer.feed(stream[start : start + 7]):
            if isinstance(event, Damaged):
                print(f"damaged: {event.reason}, {event.wire_size} bytes")
            else:
                received.append(event.payload)
                celsius = [value / 100.0 - 273.15 for value in event.payload.centi_kelvin]
                print(f"frame {event.seq}: " + ", ".join(f"{value:.2f} C" for value in celsius))
    return received


if __name__ == "__main__":
    main()
