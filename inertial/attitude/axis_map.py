"""Which column of a board's samples is which body axis, with which sign: a file that the estimator
applies live.

Forces and rates of b (forward-right-down) from the columns of ImuBatch (SI) or of AdcBatch (V):
`value_b = sign (column - zero) scale` (E-79b of docs/equations-attitude.md).
"""

import hashlib
import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inertial.attitude.axes import Assignment, Input
from inertial.toml_file import read_versioned, write_whole

Array = NDArray[np.float64]

VERSION = 1
AXES = ("force x", "force y", "force z", "rate x", "rate y", "rate z")
ABSENT = -1  # column of an axis that no input carries: a board with two gyroscopes has no rate z
IMU = (
    "force x",
    "force y",
    "force z",
    "rate x",
    "rate y",
    "rate z",
)  # columns of ImuBatch, as the board calls them
SOURCES = ("imu", "adc")


class MapError(ValueError):
    """An axis map that cannot be used: what was found, what was wanted."""


@dataclass(frozen=True)
class Figures:
    """What the sensors behind a converter's inputs are, in V; for columns that are SI already see
    SI.
    """

    zero_force: float  # V at 0 g
    force: float  # V per m/s^2
    zero_rate: float  # V at rest
    rate: float  # V per rad/s


SI = Figures(0.0, 1.0, 0.0, 1.0)


@dataclass(frozen=True)
class AxisMap:
    """Six axes of b, in the order of AXES, from the columns of one board."""

    source: str  # one of SOURCES
    inputs: tuple[str, ...]  # name of every column the board sends
    column: tuple[int, ...]  # (6,); ABSENT reads 0
    sign: tuple[int, ...]  # (6,) +1 or -1
    zero: tuple[float, ...]  # (6,) in the column's unit
    scale: tuple[float, ...]  # (6,) m/s^2 or rad/s per unit of the column
    id: str = ""
    device: str = ""
    date: str = ""

    def apply(self, values: Array) -> tuple[Array, Array]:
        """Specific force (n, 3) m/s^2 and rate (n, 3) rad/s in b, of columns (n, len(inputs)).

        Raises MapError for another number of columns.
        """
        if values.shape[1] != len(self.inputs):
            raise MapError(
                f"axis map {self.id or 'without id'} is for {len(self.inputs)} columns, the board"
                f" sends {values.shape[1]}: detect the axes again"
            )
        out = np.zeros((len(values), 6))
        for k, column in enumerate(self.column):
            if column != ABSENT:
                out[:, k] = (values[:, column] - self.zero[k]) * (self.sign[k] * self.scale[k])
        return out[:, :3], out[:, 3:]

    @property
    def mirrored(self) -> bool:
        """A three-axis sensor whose axes come out left-handed: one is really inverted, or a turn
        went the wrong way.

        Only of columns that a board sends as x, y, z; inputs of a converter have no such order.
        """
        if self.source != "imu":
            return False
        for part in (slice(0, 3), slice(3, 6)):
            column = self.column[part]
            if ABSENT in column:
                continue
            M = np.zeros((3, 3))
            M[range(3), np.argsort(np.argsort(column))] = self.sign[part]
            if np.linalg.det(M) < 0.0:
                return True
        return False

    def named(self, device: str, date: str) -> "AxisMap":
        """The same map with an id that follows from its contents."""
        plain = replace(self, id="", device=device, date=date)
        digest = hashlib.sha256(json.dumps(as_dict(plain), sort_keys=True).encode()).hexdigest()[:8]
        return replace(plain, id=f"{device}-axes-{date[:10].replace('-', '')}-{digest}")

    def gateway_toml(self) -> str:
        """The wiring as [gateway.devices.analogue] of gyrofree.toml wants it; empty for a board
        without a converter.
        """
        if self.source != "adc":
            return ""

        def one(k: int, article: int) -> Input:
            return Input(int(self.inputs[self.column[k]].split()[1]), self.sign[k] * article < 0)

        found = Assignment(one(0, 1), one(1, -1), one(2, -1), one(4, 1), one(3, 1))
        third = one(5, 1) if self.column[5] != ABSENT else None
        lines = [found.toml()]
        if third is not None:
            lines.append(
                f"gyro_z = {{ channel = {third.channel}, invert = {str(third.invert).lower()} }}"
            )
        return "\n".join(lines)


def as_dict(m: AxisMap) -> dict[str, Any]:
    """The map as its file has it."""
    axes = [
        {
            "axis": AXES[k],
            "input": m.inputs[m.column[k]],
            "column": m.column[k],
            "sign": m.sign[k],
            "zero": m.zero[k],
            "scale": m.scale[k],
        }
        for k in range(6)
        if m.column[k] != ABSENT
    ]
    return {
        "version": VERSION,
        "id": m.id,
        "device": m.device,
        "date": m.date,
        "source": m.source,
        "inputs": list(m.inputs),
        "axes": axes,
    }


def write_map(m: AxisMap, path: Path) -> None:
    """Write a map whole or not at all; raises OSError."""
    write_whole(as_dict(m), path)


def read_map(path: Path) -> AxisMap:
    """Read a map; raises MapError for a file that is none, OSError for one that cannot be read."""
    return read_versioned(path, "axis map", VERSION, _map, MapError)


def _map(table: dict[str, Any]) -> AxisMap:
    inputs = tuple(str(name) for name in table["inputs"])
    column, sign, zero, scale = [ABSENT] * 6, [1] * 6, [0.0] * 6, [1.0] * 6
    for axis in table["axes"]:
        k = AXES.index(axis["axis"])
        column[k], sign[k] = int(axis["column"]), int(axis["sign"])
        zero[k], scale[k] = float(axis["zero"]), float(axis["scale"])
        if (
            not 0 <= column[k] < len(inputs)
            or sign[k] not in (-1, 1)
            or not np.isfinite([zero[k], scale[k]]).all()
        ):
            raise ValueError(f"{axis['axis']}: column {column[k]} of {len(inputs)}, sign {sign[k]}")
    used = [c for c in column if c != ABSENT]
    if ABSENT in column[:5] or len(set(used)) != len(used):
        raise ValueError("want a column of its own for every axis; only rate z may be absent")
    if table["source"] not in SOURCES:
        raise ValueError(f"source {table['source']!r}, want one of {', '.join(SOURCES)}")
    return AxisMap(
        table["source"],
        inputs,
        tuple(column),
        tuple(sign),
        tuple(zero),
        tuple(scale),
        str(table["id"]),
        str(table["device"]),
        str(table["date"]),
    )
