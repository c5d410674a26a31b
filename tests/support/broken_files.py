"""Files as they come from outside: good ones, and many ways to spoil them. Seeded: the same every
time.
"""

import json
import os
import random
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import tomli_w

from gyrofree.running.simulate_csv import write
from inertial.layouts.catalogue import CUBE
from support.table_session import table_recording

CELLS = (
    "",
    "nan",
    "inf",
    "-inf",
    "1e308",
    "-1e308",
    "1e-308",
    "99999999999999999999",
    "2147483648",
    "-1",
    "0",
    "abc",
    "1,5",
    "0x10",
    "1_000",
    "=cmd|' /C calc'!A0",
    "é°",
    '"',
    "\x1b[31m",
    "\0",
    "1e",
    "true",
    "2026-01-01",
    "[]",
    "{}",
)
ENCODINGS = ("utf-16", "utf-16-be", "utf-32", "utf-8-sig", "cp1252", "cp037")
IMU_HEADER = "t_s,fx_mps2,fy_mps2,fz_mps2,wx_radps,wy_radps,wz_radps"
GNSS_HEADER = "t_s,lat_deg,lon_deg,height_m,quality,sd_n_m,sd_e_m,sd_u_m,vn_mps,ve_mps,vd_mps"


def good(folder: Path) -> dict[str, Path]:
    """One good file of each kind, by its name."""
    folder.mkdir(parents=True)
    rng = np.random.default_rng(1)
    whole = folder / "whole.csv"
    write(whole, "published", 3, "cube", 0.05)
    lines = whole.read_text().splitlines(keepends=True)
    (folder / "cube.csv").write_text("".join(lines[:700]))
    whole.unlink()
    n = 400
    t = np.arange(n) / 100.0
    f = np.column_stack([np.zeros((n, 2)), np.full(n, -9.81)]) + 0.01 * rng.standard_normal((n, 3))
    w = 0.001 * rng.standard_normal((n, 3))
    q = np.tile([1.0, 0, 0, 0], (n, 1))
    imu = np.column_stack([t, f, w])
    text(folder / "attitude.csv", IMU_HEADER + ",true_qw,true_qx,true_qy,true_qz", imu, q)
    drive = folder / "drive"
    drive.mkdir()
    text(drive / "imu.csv", IMU_HEADER, imu)
    k = np.arange(16)
    fixes = np.column_stack([k / 4.0, 49.0 + 1e-7 * k, 11.0 + 0.0 * k, 300.0 + 0.0 * k, 1 + 0 * k])
    text(drive / "gnss.csv", GNSS_HEADER, fixes, np.full((16, 3), 0.02), np.zeros((16, 3)))
    (drive / "drive.toml").write_text("lever_arm_b_m = [1.0, 0.0, -1.0]\n")
    counts = rng.integers(1000, 3000, (n, 6))
    text(
        folder / "adc.csv", "t_s," + ",".join(f"in{k}_counts" for k in range(6)), t[:, None], counts
    )
    layout = CUBE(0.05)
    (folder / "layout.toml").write_text(_layout_text(layout))
    root = Path(__file__).resolve().parents[2]
    shutil.copy(root / "gyrofree.toml", folder / "config.toml")
    shutil.copy(root / "sessions" / "report" / "acceptance.toml", folder / "spec.toml")
    (folder / "card.toml").write_text(
        tomli_w.dumps({"version": 1, "device": "cube", "axes": {"a11": {"scale": 1.0}}})
    )
    shutil.copy(table_recording(), folder / "session.mcap")
    shutil.copy(table_recording().parent / "session.json", folder / "session.json")
    users = {"version": 1, "users": {}}
    (folder / "users.json").write_text(json.dumps(users))
    kept = folder / "kept"
    shutil.copytree(table_recording().parent, kept / "sessions" / table_recording().parent.name)
    (kept / "users.json").write_text(json.dumps(users))
    for path in (kept, *kept.rglob("*")):
        path.chmod(0o755)
    return {path.name: path for path in folder.iterdir()}


def _layout_text(layout) -> str:
    root = Path(__file__).resolve().parents[2]
    return (root / "inertial" / "layouts" / f"{layout.name}.toml").read_text()


def text(path: Path, header: str, *columns) -> None:
    """A CSV file of arrays side by side."""
    np.savetxt(path, np.column_stack(columns), "%.9g", ",", header=header, comments="")


Spoil = Callable[[bytes, random.Random], bytes]


def cell(data: bytes, rng: random.Random) -> bytes:
    """A cell, or a value of TOML or JSON, replaced."""
    lines = data.split(b"\n")
    k = rng.randrange(len(lines))
    separator = b"=" if b"=" in lines[k] else b":" if b'":' in lines[k] else b","
    cells = lines[k].split(separator)
    cells[rng.randrange(len(cells))] = rng.choice(CELLS).encode()
    lines[k] = separator.join(cells)
    return b"\n".join(lines)


def column(data: bytes, rng: random.Random) -> bytes:
    """The same cell in every line."""
    lines = data.split(b"\n")
    place, value = rng.randrange(8), rng.choice(CELLS).encode()
    for k, line in enumerate(lines[1:], 1):
        cells = line.split(b",")
        if place < len(cells):
            cells[place] = value
            lines[k] = b",".join(cells)
    return b"\n".join(lines)


def scaled(data: bytes, rng: random.Random) -> bytes:
    """One column in another unit, or beyond all bounds."""
    lines = data.split(b"\n")
    place, factor = rng.randrange(8), rng.choice([0.0, -1.0, 1e-9, 1e3, 1e9, 1e150, 1e300])
    for k, line in enumerate(lines[1:], 1):
        cells = line.split(b",")
        try:
            cells[place] = repr(float(cells[place]) * factor).encode()
        except (ValueError, IndexError):
            continue
        lines[k] = b",".join(cells)
    return b"\n".join(lines)


def bytes_lost(data: bytes, rng: random.Random) -> bytes:
    a = rng.randrange(len(data) + 1)
    return data[:a] + data[a + rng.choice([1, 10, 1000, len(data)]) :]


def bytes_wrong(data: bytes, rng: random.Random) -> bytes:
    out = bytearray(data)
    for _ in range(rng.choice([1, 3, 50])):
        out[rng.randrange(len(out))] = rng.randrange(256)
    return bytes(out)


def lines_mixed(data: bytes, rng: random.Random) -> bytes:
    lines = data.split(b"\n")
    head, rest = lines[0], lines[1:]
    how = rng.randrange(4)
    if how == 0:
        rng.shuffle(rest)
    elif how == 1:
        rest = rest[:1] * len(rest)
    elif how == 2:
        rest = [head, *rest, head, *rest]
    else:
        rest = rest[: rng.randrange(5)]
    return b"\n".join([head, *rest])


def head_lost(data: bytes, rng: random.Random) -> bytes:
    return b"\n".join(data.split(b"\n")[1:])


def encoded(data: bytes, rng: random.Random) -> bytes:
    return data.decode("utf-8", "replace").encode(rng.choice(ENCODINGS), "replace")


def twice(data: bytes, rng: random.Random) -> bytes:
    return data + data


SPOILS: tuple[Spoil, ...] = (
    cell,
    cell,
    column,
    scaled,
    bytes_lost,
    bytes_wrong,
    lines_mixed,
    head_lost,
    encoded,
    twice,
)
WHOLE = {  # contents that are of no kind
    "empty": b"",
    "one byte": b"\xff",
    "zeros": bytes(5000),
    "newlines": b"\n" * 5000,
    "random": random.Random(2).randbytes(5000),
    "one line": b"x" * 300_000,
    "gzip": b"\x1f\x8b\x08" + bytes(50),
    "number": b"1\n",
    "json": b'{"a": [1, 2, {"b": null}]}',
    "deep": b"[" * 3000,
    "mcap head": b"\x89MCAP0\r\n",
}


def broken(seeds: dict[str, Path], place: Path, rng: random.Random) -> Path:
    """One broken file or folder below `place`."""
    place.mkdir(parents=True, exist_ok=True)
    how, name = rng.random(), rng.choice(["bad.csv", "Prüf (1) #2 50%.csv", "-x.toml", "a\nb.mcap"])
    target = place / name
    if how < 0.15:
        target.write_bytes(WHOLE[rng.choice(sorted(WHOLE))])
    elif how < 0.25:
        return _no_file(place, rng)
    elif how < 0.40:
        target = place / "folder"
        shutil.copytree(seeds["drive"], target)
        inner = target / rng.choice(["imu.csv", "gnss.csv", "drive.toml"])
        inner.write_bytes(rng.choice(SPOILS)(inner.read_bytes(), rng))
    else:
        seed = seeds[rng.choice([key for key, path in sorted(seeds.items()) if path.is_file()])]
        data = seed.read_bytes()
        for _ in range(rng.choice([1, 1, 2])):
            data = rng.choice(SPOILS)(data, rng) if data else data
        target = target.with_suffix(seed.suffix)
        target.write_bytes(data)
    return target


def _no_file(place: Path, rng: random.Random) -> Path:
    kind = rng.choice(["missing", "folder", "pipe", "null", "broken link", "long name", "full"])
    target = place / kind
    if kind == "folder":
        target.mkdir()
    elif kind == "pipe":
        os.mkfifo(target)
    elif kind == "null":
        return Path("/dev/null")
    elif kind == "full":
        return Path("/dev/zero")
    elif kind == "broken link":
        target.symlink_to("nowhere")
    elif kind == "long name":
        return place / ("x" * 300 + ".csv")
    return target
