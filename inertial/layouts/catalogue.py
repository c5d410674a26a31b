"""Layouts as TOML files: the built-in ones beside this module, and the user's own.

name = "mine"
scale_m = 0.05                      # length that counts as 1 in kappa and GDOP; default: the
largest coordinate [[axes]] name = "left-x"                     # default a1, a2, ... position_m =
[0.05, 0.0, 0.0]       # from the body's centre, body frame direction = [0, 1, -1]              #
any length sensor = "adxl345"                  # adxl345, mpu9150 or a table [sensors.NAME] of this
file scale = 1.0                         # true m/s^2 per m/s^2 of the board's nominal scale channel
= 0                         # column of the board's samples; default: the order of the file
"""

import difflib
import math
import tomllib
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from inertial.layouts.layout import SENSORS, GeometryError, Layout, Sensor
from inertial.toml_file import parsed, text_of

HERE = Path(__file__).resolve().parent
MOST_AXES = 64
TOP = {"name", "text", "scale_m", "fixed_size", "axes", "sensors"}
AXIS = {"name", "position_m", "direction", "sensor", "scale", "channel"}
SENSOR = {
    "noise_mps2": "noise",
    "bias_mps2": "bias",
    "scale_error": "scale_error",
    "limit_mps2": "limit",
}


def find(name_or_file: str | Path, half_side_m: float | None = None) -> Layout:
    """A built-in layout by name, or the one in a TOML file. half_side_m (m) sizes built-in layouts,
    not files.

    Raises GeometryError with file, axis and remedy.
    """
    name = str(name_or_file)
    if name in LAYOUTS:
        return built_in(name, half_side_m)
    if not name.endswith(".toml"):
        near = difflib.get_close_matches(name, LAYOUTS, 1)
        hint = f" (did you mean {near[0]}?)" if near else ""
        raise GeometryError(
            f"no layout {name!r}{hint}; want one of {', '.join(LAYOUTS)} or a file FILE.toml"
        )
    return load(Path(name))


def built_in(name: str, half_side_m: float | None = None) -> Layout:
    """A layout of this folder, with its lengths in the ratio half_side_m / scale_m."""
    layout, fixed = _read_built_in(name)
    if half_side_m is None or fixed:
        return layout
    size = half_side_m / layout.scale_m
    return Layout(
        layout.name,
        layout.r_b * size,
        layout.theta_b,
        half_side_m,
        layout.axis_names,
        layout.channels,
        layout.gain,
        layout.sensors,
        layout.text,
    )


@lru_cache(maxsize=32)
def _read_built_in(name: str) -> tuple[Layout, bool]:
    values = tomllib.loads((HERE / f"{name}.toml").read_text(encoding="utf-8"))
    return parse(values, f"{name}.toml"), bool(values.get("fixed_size", False))


def load(path: Path) -> Layout:
    """Layout of a file; raises GeometryError."""
    try:
        values = parsed(text_of(path))
    except OSError as error:
        raise GeometryError(
            f"{path}: {error.strerror}; want a layout file, docs/layouts.md describes it"
        ) from None
    except tomllib.TOMLDecodeError as error:
        raise GeometryError(f"{path}: not TOML: {error}") from None
    return parse(values, str(path))


def parse(values: dict[str, Any], where: str) -> Layout:
    """Layout of the values of a file; `where` names the file in errors. Raises GeometryError."""
    _known(values, TOP, where)
    axes = values.get("axes")
    if (
        not isinstance(axes, list)
        or not 1 <= len(axes) <= MOST_AXES
        or not all(isinstance(a, dict) for a in axes)
    ):
        raise GeometryError(f"{where}: want 1 to {MOST_AXES} tables [[axes]]")
    sensors = SENSORS | _sensors(values.get("sensors", {}), where)
    said = [axis.get("name", f"a{i + 1}") for i, axis in enumerate(axes)]
    places = [f"{where}: axis {i + 1} ({said[i]})" for i in range(len(axes))]
    for axis, place in zip(axes, places, strict=True):
        _known(axis, AXIS, place)
    names = [str(name) for name in said]
    channels = [
        _channel(axis, i, place) for i, (axis, place) in enumerate(zip(axes, places, strict=True))
    ]
    for what, column in (("name", names), ("channel", channels)):
        for i, value in enumerate(column):
            if value in column[:i]:
                raise GeometryError(
                    f"{places[i]}: {what} {value} is axis {column.index(value) + 1}'s already"
                )
    r = np.array([_vector(axis, "position_m", p) for axis, p in zip(axes, places, strict=True)])
    directions = [_direction(axis, place) for axis, place in zip(axes, places, strict=True)]
    scale = _number(values, "scale_m", float(np.abs(r).max()) or 1.0, where)
    gain = [_number(axis, "scale", 1.0, place) for axis, place in zip(axes, places, strict=True)]
    models = []
    for axis, place in zip(axes, places, strict=True):
        model = axis.get("sensor", "adxl345")
        if model not in sensors:
            raise GeometryError(
                f"{place}: sensor {model!r}, want one of {', '.join(sensors)} or a table"
                f" [sensors.{model}]"
            )
        models.append(sensors[model])
    return Layout(
        str(values.get("name", Path(where).stem)),
        r,
        np.array(directions),
        scale,
        tuple(names),
        tuple(channels),
        tuple(gain),
        tuple(models),
        str(values.get("text", "")),
    )


def as_toml(layout: Layout) -> str:
    """The file of a layout; parse() gives it back. Positions to 1e-9 m, directions to 1e-12."""
    axes = []
    for i in range(layout.axes):
        axis = {
            "name": layout.axis_names[i],
            "position_m": [round(float(v), 9) + 0.0 for v in layout.r_b[i]],
            "direction": [round(float(v), 12) + 0.0 for v in layout.theta_b[i]],
            "sensor": layout.sensors[i].name,
            "scale": layout.gain[i],
            "channel": layout.channels[i],
        }
        axes.append(axis)
    values: dict[str, Any] = {"name": layout.name, "text": layout.text, "scale_m": layout.scale_m}
    own = {s.name: s for s in layout.sensors if SENSORS.get(s.name) != s}
    if own:
        values["sensors"] = {
            n: {key: getattr(s, f) for key, f in SENSOR.items()} for n, s in own.items()
        }
    return tomli_w.dumps(values | {"axes": axes})


def _known(values: dict[str, Any], allowed: set[str], where: str) -> None:
    for key in values:
        if key not in allowed:
            near = difflib.get_close_matches(key, allowed, 1)
            hint = (
                f"did you mean {near[0]}?" if near else f"want some of {', '.join(sorted(allowed))}"
            )
            raise GeometryError(f"{where}: unknown key {key!r}: {hint}")


def _finite(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def _number(values: dict[str, Any], key: str, default: float, where: str) -> float:
    value = values.get(key, default)
    if not _finite(value) or not value > 0.0:
        raise GeometryError(f"{where}: {key} = {value!r}, want a number above 0")
    return float(value)


def _vector(axis: dict[str, Any], key: str, where: str) -> list[float]:
    value = axis.get(key)
    if not isinstance(value, list) or len(value) != 3 or not all(_finite(v) for v in value):
        raise GeometryError(
            f"{where}: {key} = {value!r}, want three numbers [x, y, z] in body axes"
        )
    return [float(v) for v in value]


def _direction(axis: dict[str, Any], where: str) -> np.ndarray:
    direction = np.array(_vector(axis, "direction", where))
    length = float(np.linalg.norm(direction))
    if length < 1e-6:
        raise GeometryError(
            f"{where}: direction {direction.tolist()} has no length, want where the sensor points"
        )
    return direction / length


def _channel(axis: dict[str, Any], default: int, where: str) -> int:
    value = axis.get("channel", default)
    if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value < MOST_AXES:
        raise GeometryError(
            f"{where}: channel = {value!r}, want the column of the board's samples, 0 to"
            f" {MOST_AXES - 1}"
        )
    return value


def _sensors(tables: Any, where: str) -> dict[str, Sensor]:
    if not isinstance(tables, dict) or not all(isinstance(t, dict) for t in tables.values()):
        raise GeometryError(f"{where}: sensors, want tables [sensors.NAME]")
    found = {}
    for name, table in tables.items():
        _known(table, set(SENSOR), f"{where}: [sensors.{name}]")
        base = SENSORS["adxl345"]
        found[name] = Sensor(
            name,
            *(
                _number(table, key, getattr(base, field), f"{where}: [sensors.{name}]")
                for key, field in SENSOR.items()
            ),
        )
    return found


def _sized(name: str) -> Callable[[float], Layout]:
    def make(half_side: float) -> Layout:
        return built_in(name, half_side)

    make.__doc__ = f"inertial/layouts/{name}.toml with half_side = L/2 in m."
    return make


CUBE = _sized("cube")  # the paper's cube: four triads, axes a11 a12 a13 a21 ... a43

# Built-in layouts by name; array-24 has a size of its own, whatever half side is asked for.
LAYOUTS: dict[str, Callable[[float], Layout]] = {
    name: _sized(name) for name in ("cube", "chen-6", "nine", "edges-12", "stars-12", "array-24")
}
