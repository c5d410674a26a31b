"""What `gyrofree setup` was told, as settings and as a file beside which the old one is kept."""

import os
import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path

from gyrofree.config import Settings, check
from gyrofree.setup.written import as_toml
from inertial.layouts.catalogue import LAYOUTS
from inertial.whole_file import put_in_place

NAMES = {"cube": "cube", "imu": "imu", "analogue": "tilt-board"}
HEAD = (
    "Written by `gyrofree setup`; edit it as you like: docs/configuration.md has every key."
    " `gyrofree config check` reads it as the services do, `gyrofree up` starts them."
)


@dataclass(frozen=True)
class Answers:
    """Of one board."""

    port: str
    name: str = "cube"
    baud: int = 921600  # bit/s
    board: str = "cube"  # cube, imu or analogue: what its samples are
    layout: str = "cube"  # name of a layout, or a TOML file of one; of a cube
    half_side_m: float = 0.05
    pulses_per_rev: int = 360
    gnss_port: str = ""
    gnss_baud: int = 38400  # bit/s
    dashboard_port: int | None = None  # None: as it was
    bus_port: int | None = None


def layouts_for(axes: int) -> list[str]:
    """Layouts of so many axes, the cube first; all of them where there is none or axes is 0."""
    fitting = [name for name, make in LAYOUTS.items() if make(0.05).axes == axes]
    return sorted(fitting or LAYOUTS, key=lambda name: (name != "cube", name))


def free_name(wanted: str, taken: set[str]) -> str:
    """`wanted`, or with the first number behind it that makes it another."""
    numbered = (f"{wanted}-{n}" for n in range(2, len(taken) + 3))
    return next(n for n in (wanted, *numbered) if n not in taken)


def settings_with(before: Settings, a: Answers) -> Settings:
    """The settings with this board in them; a board of its name is replaced. Raises ConfigError."""
    data = before.model_dump(mode="json", exclude_unset=True)
    gateway = data.setdefault("gateway", {})
    others = [d for d in gateway.get("devices", []) if d["name"] != a.name]
    old = next((d for d in gateway.get("devices", []) if d["name"] == a.name), {})
    device = old | {"name": a.name, "port": a.port, "baud": a.baud, "layout": a.board}
    device["tacho_pulses_per_rev"] = a.pulses_per_rev
    device.pop("gnss_port", None)
    if a.gnss_port:
        device |= {"gnss_port": a.gnss_port, "gnss_baud": a.gnss_baud}
    gateway["devices"] = [*others, device]
    if a.board == "cube":
        _set_layout(data.setdefault("estimator", {}), a, alone=not others)
    if a.dashboard_port:
        data.setdefault("dashboard", {})["port"] = a.dashboard_port
    if a.bus_port:
        endpoint = f"tcp/127.0.0.1:{a.bus_port}"
        data.setdefault("bus", {}).update(router=endpoint, listen=[endpoint])
    return check(data, "the answers")


def _set_layout(estimator: dict, a: Answers, alone: bool) -> None:
    """The only board's layout is that of all; of several each has its own."""
    own = a.layout.endswith(".toml")
    layout = {"file": a.layout} if own else {"kind": a.layout, "half_side_m": a.half_side_m}
    if alone and not estimator.get("layouts"):
        estimator["layout"] = layout
    else:
        estimator.setdefault("layouts", {})[a.name] = layout


def write(path: Path, settings: Settings) -> Path | None:
    """Write the file as a whole; the one that was there is kept under the name returned. Raises
    OSError.
    """
    kept = None
    if path.exists():
        names = (path.with_name(f"{path.name}.{n}.bak") for n in range(1, 10_000))
        kept = next(name for name in names if not name.exists())
        shutil.copy2(path, kept)
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as stream:
            stream.write(as_toml(settings, HEAD))
            os.fchmod(stream.fileno(), 0o644)
        put_in_place(Path(name), path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise
    return kept
