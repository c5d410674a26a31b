"""spec.toml is the authority: natural alignment, the sizes everybody relies on, and nothing made
from it behind it.
"""

import struct

import pytest
from support.protocol_support import ROOT

from firmware_protocol import document, frames, spec
from firmware_protocol.codec import HEADER, MAX_BODY, MAX_FRAME
from firmware_protocol.payloads import length_rules
from firmware_protocol.spec import FORMATS, SPEC, SpecError

SIZES = {
    "HELLO": 92,
    "STATUS": 112,
    "ACC12": 12,
    "ADC": 12,
    "TACHO": 8,
    "PPS": 12,
    "GPS": 0,
    "IMU6": 20,
    "CMD": 4,
    "ACK": 6,
}


def test_sizes_are_those_of_the_firmware():
    assert {layout.name: layout.size for layout in SPEC.layouts.values()} == SIZES
    assert (HEADER.size, HEADER.format) == (16, "<BBBBIQ")


def test_a_full_payload_fills_the_wire_exactly():
    assert MAX_FRAME == 508 and MAX_BODY == MAX_FRAME + 2 and SPEC.max_wire == 512


def test_every_field_is_naturally_aligned():
    for fields in [SPEC.header, *(layout.fields for layout in SPEC.layouts.values())]:
        little = struct.calcsize("<" + "".join(field.format for field in fields))
        native = struct.calcsize("@" + "".join(field.format for field in fields))
        assert little == native, [field.name for field in fields]
    for layout in SPEC.layouts.values():
        if layout.tail and not layout.tail.raw:
            assert layout.size % struct.calcsize(FORMATS[layout.tail.type]) == 0, layout.name


def test_every_payload_class_has_a_frame_and_every_frame_a_rule():
    assert {layout.payload_class for layout in SPEC.layouts.values()} == set(frames.CLASSES)
    assert {t for t, rule in enumerate(length_rules()) if rule is not None} == set(SPEC.layouts)


def test_every_entry_says_what_it_is():
    raw = SPEC.raw
    entries = [
        *raw["header"],
        *raw["flag"],
        *raw["reason"],
        *raw["board"],
        *raw["frame"],
        *(field for entry in raw["frame"] + raw["struct"] for field in entry.get("field", [])),
        *(entry["tail"] for entry in raw["frame"] if "tail" in entry),
    ]
    assert all(entry["text"] for entry in entries)


@pytest.mark.parametrize(
    ("path", "made", "command"),
    [
        (
            "docs/protocol.md",
            document.page,
            "python -m firmware_protocol.document > docs/protocol.md",
        ),
        (
            "firmware_protocol/core/gf_spec.h",
            document.header,
            "python -m firmware_protocol.document header > firmware_protocol/core/gf_spec.h",
        ),
    ],
)
def test_what_is_made_from_the_spec_is_current(path, made, command):
    assert (ROOT / path).read_text(encoding="utf-8") == made(), (
        f"{path} is behind spec.toml: run {command}"
    )


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('name = "stale_mask"', 'name = "old_mask"', "frames.py has"),
        ('type = "sensor[4]"', 'type = "sensors[4]"', "known: u8"),
        ("type = 0x13", "type = 0x17", "PPS"),
    ],
)
def test_a_spec_that_contradicts_the_classes_is_refused(tmp_path, old, new, message):
    text = spec.SPEC_PATH.read_text(encoding="utf-8")
    assert old in text
    changed = tmp_path / "spec.toml"
    changed.write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(SpecError, match=message):
        spec.load(changed)
