"""What a report needs of a recording, as arrays. SI, body frame b; times in s from the first sample
of the run, by the board's clock (times.py).
"""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from messages.contract.topics import ACCEL, AXES, GNSS, INNOVATION, LINK, NAV, RATE, TACHO, parse
from sessions.export.table import Files, Progress, Selection, Table, files, silent, tables
from sessions.recording.mcap_damage import Damage
from sessions.report.times import Times

Array = NDArray[np.float64]
XYZ = ("x", "y", "z")


class ReportError(ValueError):
    """A recording that no report can be made of; the text says what is missing."""


@dataclass(frozen=True)
class Accel:
    """Readings of all axes."""

    t: Array  # (n,) s
    f_axis: Array  # (n, axes) m/s^2
    period_s: float


@dataclass(frozen=True)
class Tacho:
    """The reference."""

    t: Array  # (m,) s
    omega: Array  # rad/s, signed where the direction is known
    sigma: Array  # rad/s


@dataclass(frozen=True)
class Rate:
    """One estimator's rotation."""

    name: str
    t: Array  # (n,) s
    omega_b: Array  # (n, 3) rad/s
    sigma: Array  # (n, 3) rad/s
    alpha_b: Array  # (n, 3) rad/s^2
    f_b: Array  # (n, 3) m/s^2
    angle_z: Array  # rad
    p_n: Array  # (n, 3) m
    nis: Array
    nis_dof: Array
    still: Array  # bool
    calibration: str
    sight: Array | None = None  # (n, 3) RateEstimate.Sight; None where nobody says


@dataclass(frozen=True)
class Navigation:
    """One filter's navigation."""

    name: str
    t: Array
    p_ned: Array  # (n, 3) m
    v_n: Array  # (n, 3) m/s
    sigma: Array  # (n, 15)


@dataclass(frozen=True)
class Corrections:
    """One filter's corrections by fixes."""

    name: str
    t: Array
    nis: Array
    dof: Array
    accepted: Array


@dataclass(frozen=True)
class Run:
    """One boot of one device within a session."""

    device: str
    epoch: int  # boot counter of the board
    boots: tuple[int, ...]  # all that the session holds
    start_utc_s: float
    start_board_s: float | None  # the same by the board's clock; None: times go by UTC
    seconds: float
    accel: Accel | None
    tacho: Tacho | None
    rates: list[Rate] = field(default_factory=list)
    navigation: list[Navigation] = field(default_factory=list)
    corrections: list[Corrections] = field(default_factory=list)
    fixes: Array = field(
        default_factory=lambda: np.zeros((0, 4))
    )  # t, latitude rad, longitude rad, height m
    link: dict[str, float] = field(default_factory=dict)  # last ledger of the line
    states: list[tuple[float, str, str]] = field(default_factory=list)  # s, axis, its new state
    said: tuple[str, ...] = ()  # sentences about damage of the recording
    whole: bool = True  # nothing of the recording is missing or unreadable


FIELDS = {  # of long tables: what a report is made of
    ACCEL.name: ("epoch", "device_us", "period_s", "f_mps2"),
    TACHO.name: ("epoch", "device_us", "omega_radps", "sigma_radps"),
    RATE.name: (
        "epoch",
        "device_us",
        "omega_ib_b_radps",
        "omega_covariance",
        "alpha_b_radps2",
        "f_b_mps2",
        "angle_z_rad",
        "p_n_m",
        "nis",
        "nis_dof",
        "still",
        "calibration",
        "sight",
    ),
    NAV.name: ("epoch", "device_us", "p_ned_m", "v_n_mps", "sigma"),
    INNOVATION.name: ("epoch", "device_us", "nis", "dof", "accepted"),
    AXES.name: ("epoch", "device_us", "axes"),
}
WANTED = frozenset(topic.name for topic in (ACCEL, TACHO, RATE, NAV, INNOVATION, GNSS, LINK, AXES))


def load_run(
    path: Files, device: str = "", boot: int | None = None, progress: Progress = silent
) -> Run:
    """The longest boot (or the named one) of a device (default: the one with most samples) of a
    recording, also of one that goes on from file to file.

    Raises ReportError when there is no such device or boot, or no estimate at all; OSError.
    """
    damage, last = Damage(), files(path)[-1]
    found = tables(path, Selection(WANTED, fields=FIELDS), progress, damage)
    devices: dict[str, int] = {}
    for key, table in found.items():
        address = parse(key)
        if address.topic in (ACCEL, RATE, NAV):
            devices[address.device] = devices.get(address.device, 0) + len(table)
    if not devices:
        why = "".join(f"; {text}" for text in damage.said())
        raise ReportError(
            f"{last}: no samples and no estimates of any device; nothing to report on{why}"
        )
    device = device or max(sorted(devices), key=lambda name: devices[name])
    if device not in devices:
        raise ReportError(f"{last}: no device {device!r}; there is {', '.join(sorted(devices))}")
    mine = {key: table for key, table in found.items() if parse(key).device == device}
    timed = [table for key, table in mine.items() if parse(key).topic in (ACCEL, RATE, NAV)]
    lengths = _boots(timed)
    if boot is not None and boot not in lengths:
        raise ReportError(
            f"{last}: no boot {boot} of {device}; there are {', '.join(map(str, sorted(lengths)))}"
        )
    epoch = boot if boot is not None else max(sorted(lengths), key=lambda b: round(lengths[b], 1))
    run = _run(mine, device, epoch, tuple(sorted(lengths)))
    return replace(run, said=tuple(damage.said()), whole=damage.whole)


def _boots(timed: list[Table]) -> dict[int, float]:
    """Boot -> its length, s."""
    lengths: dict[int, float] = {}
    for table in timed:
        for epoch in np.unique(table.data["epoch"]):
            seconds = Times([_of_boot(table, epoch)]).seconds
            lengths[int(epoch)] = max(lengths.get(int(epoch), 0.0), seconds)
    return lengths


def _of_boot(table: Table, epoch: int) -> Table:
    """Its rows of one boot; all of a table that tells none."""
    at = table.data.get("epoch", np.full(len(table), epoch)) == epoch
    data = table.data if at.all() else {n: column[at] for n, column in table.data.items()}
    return Table(table.columns, data)


def _run(mine: dict[str, Table], device: str, epoch: int, boots: tuple[int, ...]) -> Run:
    by_topic: dict[str, list[tuple[str, Table]]] = {}
    for key, table in sorted(mine.items()):
        address = parse(key)
        part = _of_boot(table, epoch)
        if len(part):
            by_topic.setdefault(address.topic.name, []).append((address.estimator, part))
    times = Times(
        [part for topic in (ACCEL, RATE, NAV) for _, part in by_topic.get(topic.name, [])]
    )

    def only(topic: str) -> Table | None:
        return by_topic[topic][0][1] if topic in by_topic else None

    link = only(LINK.name)
    return Run(
        device=device,
        epoch=epoch,
        boots=boots,
        start_utc_s=times.first_utc_s,
        start_board_s=times.first if times.by_board else None,
        seconds=times.seconds,
        accel=_accel(only(ACCEL.name), times),
        tacho=_tacho(only(TACHO.name), times),
        rates=[_rate(name, table, times) for name, table in by_topic.get(RATE.name, [])],
        navigation=[_navigation(name, table, times) for name, table in by_topic.get(NAV.name, [])],
        corrections=[
            _corrections(name, table, times) for name, table in by_topic.get(INNOVATION.name, [])
        ],
        fixes=_fixes(only(GNSS.name), times),
        states=_states(only(AXES.name), times),
        link={name: float(link.data[name][-1]) for name in LEDGER} if link else {},
    )


LEDGER = (
    "bytes_in",
    "good_frames",
    "bad_chunks",
    "bad_bytes",
    "lost_frames",
    "lost_samples",
    "device_dropped",
    "latency_p99_s",
    "clock_skew_ppm",
)


def _accel(table: Table | None, times: Times) -> Accel | None:
    if table is None:
        return None
    names = [column.name for column in table.columns if column.name.endswith("_mps2")]
    return Accel(times.of(table), table.vector(*names), float(np.median(table.data["period_s"])))


def _tacho(table: Table | None, times: Times) -> Tacho | None:
    if table is None or len(table) < 2:
        return None
    return Tacho(times.of(table), table.data["omega_radps"], table.data["sigma_radps"])


def _states(table: Table | None, times: Times) -> list[tuple[float, str, str]]:
    """When an axis began to be called something else, "STUCK", and which."""
    if table is None:
        return []
    t, found = times.of(table), []
    for name, column in table.data.items():
        if not (name.startswith("axes_") and name.endswith("_state")):
            continue
        axis = name.removeprefix("axes_").removesuffix("_state")
        changed = np.flatnonzero(np.r_[True, column[1:] != column[:-1]])
        found += [(float(t[k]), axis, str(column[k]).removeprefix("STATE_")) for k in changed]
    return sorted(found)


def _xyz(table: Table, name: str, ends: tuple[str, ...] = XYZ) -> Array:
    return table.vector(*(f"{name}_{end}" for end in ends))


def _rate(name: str, table: Table, times: Times) -> Rate:
    diagonal = table.vector("omega_covariance_0", "omega_covariance_4", "omega_covariance_8")
    cards = table.data.get("calibration")
    return Rate(
        name=name,
        t=times.of(table),
        omega_b=_xyz(table, "omega_ib_b_radps"),
        sigma=np.sqrt(np.maximum(diagonal, 0.0)),
        alpha_b=_xyz(table, "alpha_b_radps2"),
        f_b=_xyz(table, "f_b_mps2"),
        angle_z=table.data["angle_z_rad"],
        p_n=_xyz(table, "p_n_m", ("n", "e", "d"))
        if "p_n_m_n" in table.data
        else np.zeros((len(table), 3)),
        nis=table.data["nis"],
        nis_dof=table.data["nis_dof"],
        still=table.data["still"] > 0,
        calibration=str(cards[-1]) if cards is not None else "",
        sight=_sight(table),
    )


def _sight(table: Table) -> Array | None:
    """What the estimator says of x, y, z (n, 3); None in recordings where none says it."""
    said = [f"sight_{axis}" for axis in XYZ]
    return table.vector(*said) if set(said) <= table.data.keys() else None


def _navigation(name: str, table: Table, times: Times) -> Navigation:
    sigma = [column.name for column in table.columns if column.name.startswith("sigma_")]
    at = (
        np.isfinite(table.data["p_ned_m_n"])
        if "p_ned_m_n" in table.data
        else np.zeros(len(table), dtype=bool)
    )
    position = _xyz(table, "p_ned_m", ("n", "e", "d"))[at] if at.any() else np.zeros((0, 3))
    velocity = _xyz(table, "v_n_mps", ("n", "e", "d"))[at] if at.any() else np.zeros((0, 3))
    spread = table.vector(*sigma)[at] if sigma and at.any() else np.zeros((int(at.sum()), 15))
    return Navigation(name, (times.of(table))[at], position, velocity, spread)


def _corrections(name: str, table: Table, times: Times) -> Corrections:
    data = table.data
    return Corrections(name, times.of(table), data["nis"], data["dof"], data["accepted"] > 0)


def _fixes(table: Table | None, times: Times) -> Array:
    if table is None:
        return np.zeros((0, 4))
    data = table.data
    at = data["quality"] > 0
    columns = (
        times.of(table),
        np.radians(data["latitude_deg"]),
        np.radians(data["longitude_deg"]),
        data["height_m"],
    )
    return np.column_stack(columns)[at]
