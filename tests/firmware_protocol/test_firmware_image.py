"""The image that would be flashed: its registers against the vendor's description, its vectors,
sizes and bytes.
"""

import os
import re
import shutil
import struct
import subprocess
import xml.etree.ElementTree as ElementTree
import zipfile
from pathlib import Path

import pytest
from support.firmware_support import FIRMWARE, firmware_image

PORT = FIRMWARE / "port" / "lpc1768"
LIMIT = 24 * 1024
PERIPHERALS = {
    "syscon": "SYSCON",
    "pincon": "PINCONNECT",
    "ssp": "SSP0",
    "uart": "UART0",
    "timer": "TIMER2",
    "adc": "ADC",
    "wdt": "WDT",
    "rtc": "RTC",
    "gpio": "GPIO",
}
BASES = {
    "WDT": "WDT",
    "UART0": "UART0",
    "RTC": "RTC",
    "PINCON": "PINCONNECT",
    "SSP1": "SSP1",
    "ADC": "ADC",
    "SSP0": "SSP0",
    "TIMER2": "TIMER2",
    "UART2": "UART2",
    "SYSCON": "SYSCON",
    "GPIO0": "GPIO",
}
SHARED = {
    ("uart", "DATA"): ("RBR", "THR", "DLL"),
    ("uart", "IER"): ("IER", "DLM"),
    ("uart", "FCR"): ("IIR", "FCR"),
}

needs_compiler = pytest.mark.skipif(
    not shutil.which("arm-none-eabi-gcc") and not os.environ.get("CI"),
    reason="no arm-none-eabi-gcc: run make system-packages",
)
pytestmark = needs_compiler


@pytest.fixture(scope="module")
def image(tmp_path_factory) -> Path:
    return firmware_image(tmp_path_factory.mktemp("image"))


@pytest.fixture(scope="module")
def svd() -> dict[str, ElementTree.Element]:
    """The vendor's peripherals by name, those derived from another with its registers."""
    import pyocd

    archive = zipfile.ZipFile(Path(pyocd.__file__).parent / "debug" / "svd" / "svd_data.zip")
    root = ElementTree.fromstring(archive.read("LPC176x5x_v0.2.svd"))
    return {p.findtext("name"): p for p in root.iter("peripheral")}


def registers(svd: dict, name: str) -> dict[str, tuple[int, str]]:
    """Offset and access of every register, indices as [i] or, where the file counts ports, of port
    0.
    """
    peripheral = svd[name]
    if peripheral.get("derivedFrom"):
        return registers(svd, peripheral.get("derivedFrom"))
    found = {}
    for register in peripheral.iter("register"):
        offset, access = int(register.findtext("addressOffset"), 16), register.findtext("access")
        found[register.findtext("name").replace("[%s]", "").replace("%s", "")] = (offset, access)
    return found


def test_registers_are_where_the_vendor_says(svd, tmp_path):
    text = (PORT / "lpc1768.h").read_text()
    lines = ["#include <stddef.h>", '#include "lpc1768.h"']
    for body, struct_name in re.findall(r"typedef struct \{(.*?)\} lpc_(\w+)_t;", text, re.S):
        known = registers(svd, PERIPHERALS[struct_name])
        for kind, member in re.findall(r"(reg_t|reg_read_t) (\w+)(?:\[\d+\])?;", body):
            for name in SHARED.get((struct_name, member), (member,)):
                offset, access = known[name]
                if (struct_name, member) not in SHARED:
                    assert (access == "read-only") == (kind == "reg_read_t"), (name, access)
                lines.append(
                    f"_Static_assert(offsetof(lpc_{struct_name}_t, {member}) == {offset}, "
                    f'"{struct_name} {name}");'
                )
    assert len(lines) > 55
    for name, peripheral in BASES.items():
        base = int(svd[peripheral].findtext("baseAddress"), 16)
        lines.append(f'_Static_assert((uint32_t)LPC_{name} == {base}u, "{name}");')
    stride = int(next(svd["GPIO"].iter("register")).findtext("dimIncrement"), 16)
    lines += [
        f'_Static_assert((uint32_t)LPC_GPIO{i} == 0x2009C000u + {i}u * {stride}u, "GPIO{i}");'
        for i in (1, 2)
    ]
    for irq in ("TIMER2", "UART0", "UART2"):
        lines.append(
            f'_Static_assert({irq}_IRQ == {svd[irq].find("interrupt").findtext("value")}, "{irq}");'
        )
    source = tmp_path / "check.c"
    source.write_text("\n".join(lines) + "\n")
    subprocess.run(
        [
            "arm-none-eabi-gcc",
            "-std=gnu11",
            "-mcpu=cortex-m3",
            "-mthumb",
            "-ffreestanding",
            "-fsyntax-only",
            f"-I{PORT}",
            str(source),
        ],
        check=True,
        timeout=60,
    )


def test_every_base_address_is_checked():
    defined = set(re.findall(r"#define LPC_(\w+) ", (PORT / "lpc1768.h").read_text()))
    assert defined == set(BASES) | {"GPIO1", "GPIO2"}


def test_the_boot_rom_starts_it(image):
    data = (image / "gyrofree.bin").read_bytes()
    vectors = struct.unpack_from("<51I", data)
    assert sum(vectors[:8]) % 2**32 == 0
    assert vectors[0] == 0x10000000 + 32 * 1024 - 32  # the boot ROM's IAP owns what lies above
    used = [v for i, v in enumerate(vectors) if v and i not in (0, 7)]
    assert all(v & 1 and v < len(data) for v in used)
    assert {i - 16 for i, v in enumerate(vectors) if v and i >= 16} == {3, 5, 7}
    assert struct.unpack_from("<I", data, 0x2FC) == (0xFFFFFFFF,)


def sizes(image: Path) -> dict[str, int]:
    text = subprocess.run(
        ["arm-none-eabi-size", "-A", str(image / "gyrofree.elf")],
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    ).stdout
    return {name: int(size) for name, size in re.findall(r"^(\.\S+)\s+(\d+)", text, re.M)}


def test_it_is_small(image):
    size = sizes(image)
    flash = (image / "gyrofree.bin").stat().st_size
    assert flash <= LIMIT and flash == size[".text"] + size.get(".data", 0) + size.get(
        ".ARM.exidx", 0
    )
    assert size[".bss"] + size.get(".data", 0) + deepest_stack(image) <= LIMIT


def deepest_stack(image: Path) -> int:
    """An upper bound: every function's frame, were they all on the stack at once."""
    lines = [
        line.split("\t") for file in image.glob("*.su") for line in file.read_text().splitlines()
    ]
    assert all(kind in ("static", "dynamic,bounded") for _, _, kind in lines), (
        "a stack frame without a bound"
    )
    return sum(int(size) for _, size, _ in lines)


def test_nothing_is_allocated_and_no_library_is_linked(image):
    symbols = subprocess.run(
        ["arm-none-eabi-nm", str(image / "gyrofree.elf")],
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    ).stdout
    names = {line.split()[-1] for line in symbols.splitlines()}
    assert not names & {"malloc", "free", "_sbrk", "printf", "_impure_ptr"}
    assert "port_main" in names and (image / "gyrofree.map").stat().st_size > 10_000


def test_two_builds_give_the_same_bytes(image, tmp_path):
    """Built once more from another folder, which has no commit to name: all other bytes are the
    same.
    """
    copy = tmp_path / "elsewhere" / "firmware_protocol"
    shutil.copytree(FIRMWARE, copy, ignore=shutil.ignore_patterns("__pycache__"))
    out = tmp_path / "out"
    subprocess.run(
        ["make", "-j2", "-C", str(copy / "port" / "lpc1768"), f"OUT={out}"],
        check=True,
        timeout=120,
        capture_output=True,
    )
    ours, other = ((folder / "gyrofree.bin").read_bytes() for folder in (image, out))
    at = ours.find(_identity(image))
    assert at > 0 and len(ours) == len(other) and _identity(out) == b"unversioned".ljust(20, b"\0")
    assert ours[:at] == other[:at] and ours[at + 20 :] == other[at + 20 :]


def _identity(out: Path) -> bytes:
    digits = re.findall(r"0x([0-9a-f]{2})\b", (out / "firmware_id.c").read_text())
    return bytes.fromhex("".join(digits)).ljust(20, b"\0")
