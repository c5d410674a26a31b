"""The published table test of the gyro-free cube: its figures and its table, each beside ours.

Source: Hoseini and Moradi 2017, section 5: raw data of the triads, p by (25), equivalent biases
(Table 1), omega'_z by (26), omega_z by Runge-Kutta over the tachometer, the angle, and the position
error after 30 s with the closed form (27)

    [x y z]^T = 1/2 b t^2 + 1/6 [d x] (0, 0, -g)^T t^3

solved for the drift d. Runs on a simulated session (the paper's motion, its sensors, a seed) or on
the CSV of a recorded one. The paper's curves are not printed as numbers; what it does print stands
beside ours.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inertial.constants import GRAVITY, MILLI_G
from inertial.layouts.catalogue import find
from inertial.layouts.layout import Layout
from inertial.rotation import to_matrix
from inertial.simulation.table import BLOCK, TableTest
from inertial.timing import sample_timing
from logs.cube import run_log
from logs.cube_log import CubeLog, read_log
from logs.cube_run import EstimatorRun, Reference, reference

Array = NDArray[np.float64]
Progress = Callable[[float, str], None]

DEG = 180.0 / np.pi
PER_HOUR = DEG * 3600.0  # deg/h per rad/s
PAPER_BIAS_MG = (4.2, 2.5, 5.4)  # Table 1
PAPER_DRIFT = 30.0  # deg/h, of (27)
SECONDS = 30.0  # s of navigation, as published
PAPERS_WAY, OURS = "least-squares", "products-ekf"
TURNING = 0.02  # rad/s of the tachometer; below it the table stands
SHORTEST_STILL_S, GUARD_S = 1.0, 0.3


@dataclass(frozen=True)
class Study:
    """A run with everything the figures need. Arrays over samples (n)."""

    log: CubeLog
    layout: Layout
    truth: Reference
    tracks: dict[str, EstimatorRun]
    alpha_b: Array  # (n, 3) by (26), rad/s^2
    f_b: Array  # (n, 3) by (25), m/s^2
    still: NDArray[np.bool_]  # (n,)
    true_bias: Array | None  # (3,) m/s^2 of p, simulated sessions only


def simulated(seed: int, progress: Progress = lambda done, what: None) -> Study:
    """The paper's motion with its sensors, long enough for 30 s after the first standstill."""
    test = TableTest(seed=seed, profile="published")
    n = round((5.0 + SECONDS + 0.5) / test.period_s)
    cut = [test.block(k) for k in range(-(-n // BLOCK))]
    t = np.concatenate([block.t_s for block in cut])[:n]
    counts = np.vstack([block.counts for block in cut])[:n]
    log = CubeLog(
        path=Path(f"simulated, seed {seed}"),
        sha256="",
        names=test.layout.axis_names,
        t_s=t,
        f_axis=counts * test.sensor.count,
        lsb_mps2=test.sensor.count,
        index=np.arange(n),
        timing=sample_timing(t),
        gaps=(),
        tacho=pulse_rate(test, t),
        omega_b=np.vstack([block.omega_b for block in cut])[:n],
        q_nb=np.vstack([block.q_nb for block in cut])[:n],
    )
    # What constant errors of the axes add to p at rest: offsets, and scale errors of the gravity
    # they read.
    rest = test.layout.theta_b[:, 2] * GRAVITY
    true_bias = test.layout.S[3:] @ (test.bias + (test.scale - 1.0) * rest)
    return replace(_run(log, test.layout, progress), true_bias=true_bias)


def recorded(path: Path, progress: Progress = lambda done, what: None) -> Study:
    """A recorded run of the cube; its tachometer or its truth says when it stood still."""
    layout = find("cube", 0.05)
    return _run(read_log(path, layout.axis_names), layout, progress)


def _run(log: CubeLog, layout: Layout, progress: Progress) -> Study:
    tracks, _, _ = run_log(
        log, layout, None, [PAPERS_WAY, OURS], lambda done, what: progress(0.7 * done, what)
    )
    x = log.f_axis @ layout.S.T
    rate = (
        log.tacho if log.tacho is not None else None if log.omega_b is None else log.omega_b[:, 2]
    )
    still = np.abs(rate) < TURNING if rate is not None else tracks[OURS].still
    return Study(log, layout, reference(log), tracks, x[:, :3], x[:, 3:], still, None)


def pulse_rate(test: TableTest, t_s: Array) -> Array:
    """Rate (n,) rad/s of the newest two tachometer edges at times t_s; zero after 0.2 s without
    one.
    """
    pulses = test.pulses(0.0, float(t_s[-1]))
    at = np.array([pulse.t_s for pulse in pulses])
    way = np.array([pulse.direction for pulse in pulses])
    pitch = 2.0 * np.pi / test.pulses_per_rev
    rate = np.where(way[1:] == way[:-1], way[1:] * pitch / np.diff(at), 0.0)
    newest = np.searchsorted(at, t_s, side="right") - 1
    known = (newest >= 1) & (t_s - at[np.maximum(newest, 0)] < 0.2)
    return np.where(known, rate[np.maximum(newest - 1, 0)], 0.0)


def intervals(still: NDArray[np.bool_], period_s: float) -> list[slice]:
    """Standstills of at least a second, their ends cut."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], still.astype(np.int8), [0]]))).reshape(
        -1, 2
    )
    guard = round(GUARD_S / period_s)
    return [
        slice(a + guard, b - guard)
        for a, b in edges.tolist()
        if (b - a) * period_s >= SHORTEST_STILL_S
    ]


def equivalent_bias(s: Study) -> tuple[Array, bool]:
    """Equivalent bias of p (3,), m/s^2, from the still intervals, and whether it was told apart
    from the tilt.

    At rest p = b + C(angle)^T u with gravity's reaction u. One attitude cannot tell b from a tilt
    in x and y; two that differ in the table's angle can: least squares over all of them.
    """
    parts = intervals(s.still, s.log.period_s)
    if not parts:
        raise ValueError(
            f"{s.log.path}: the cube never stands still for {SHORTEST_STILL_S:g} s: no bias to take"
            " from it"
        )
    mean = np.array([s.f_b[part].mean(axis=0) for part in parts])
    weight = np.sqrt([part.stop - part.start for part in parts])
    angle = s.truth.angle_z if np.isfinite(s.truth.angle_z).all() else s.tracks[OURS].angle_z
    turned = np.array([angle[part].mean() for part in parts])
    rows, values = [], []
    for (x, y, _), phi, w in zip(mean, turned, weight, strict=True):
        c, n = np.cos(phi), np.sin(phi)
        rows += [[w, 0.0, w * c, w * n], [0.0, w, -w * n, w * c]]
        values += [w * x, w * y]
    H = np.array(rows)
    apart = bool(
        np.linalg.svd(H, compute_uv=False)[-1] > 0.2 * np.sqrt(np.sum(weight**2)) / len(parts)
    )
    if not apart:
        b = np.average(mean, axis=0, weights=weight**2)
        return np.array([b[0], b[1], b[2] - GRAVITY]), False
    bx, by, ux, uy = np.linalg.lstsq(H, np.array(values), rcond=None)[0]
    up = np.sqrt(GRAVITY**2 - ux**2 - uy**2)
    return np.array([bx, by, np.average(mean[:, 2], weights=weight**2) - up]), True


def closed_form(bias: Array, drift: Array, t: Array) -> Array:
    """Position error (n, 3), m, of biases (3,) m/s^2 and rate drift (3,) rad/s at times t (n,), s:
    (27).
    """
    sideways = np.cross(drift, [0.0, 0.0, -GRAVITY])
    return 0.5 * np.outer(t**2, bias) + np.outer(t**3, sideways) / 6.0


def drift_of(error: Array, bias: Array, seconds: float) -> float:
    """Size of the drift across z, rad/s, that (27) needs beside the bias for this position error
    (3,), m.
    """
    rest = (error - 0.5 * bias * seconds**2) * 6.0 / seconds**3
    return float(np.hypot(rest[0], rest[1]) / GRAVITY)


def navigation_error(s: Study, name: str) -> tuple[Array, Array]:
    """Times (n,), s since navigation began, and position error (n, 3), m, in the body axes of that
    moment.

    The cube turns about a fixed point: whatever it navigates to is error.
    """
    track = s.tracks[name]
    parts = intervals(s.still, s.log.period_s)
    start = parts[0].stop if parts else 0
    end = min(len(s.log.t_s), start + round(SECONDS / s.log.period_s) + 1)
    C_bn = to_matrix(track.q_nb[start]).T
    return (
        s.log.t_s[start:end] - s.log.t_s[start],
        (track.p_n[start:end] - track.p_n[start]) @ C_bn.T,
    )


def evaluate(s: Study) -> dict[str, Any]:
    """Every number, the paper's beside ours; what cannot be known is None."""
    bias, apart = equivalent_bias(s)
    result: dict[str, Any] = {
        "session": str(s.log.path),
        "samples": len(s.log.t_s),
        "rate_hz": round(1.0 / s.log.period_s, 3),
        "reference": s.truth.name or None,
        "table_1_bias_mg": {
            "paper": list(PAPER_BIAS_MG),
            "ours": (bias / MILLI_G).tolist(),
            "true": None if s.true_bias is None else (s.true_bias / MILLI_G).tolist(),
            "told_apart_from_tilt": apart,
        },
        "estimators": {},
        "drift_deg_per_h": {"paper": PAPER_DRIFT},
        "position_27_m": {
            "paper": (
                closed_form(np.array(PAPER_BIAS_MG) * MILLI_G, paper_drift(), np.array([SECONDS]))[
                    0
                ].tolist()
            ),
            "our_biases_alone": closed_form(bias, np.zeros(3), np.array([SECONDS]))[0].tolist(),
        },
    }
    for name, track in s.tracks.items():
        t, error = navigation_error(s, name)
        rate = (track.omega_b[:, 2] - s.truth.omega_b[:, 2]) * DEG
        angle = float((track.angle_z[-1] - s.truth.angle_z[-1]) * DEG)
        known = bool(np.isfinite(rate).all())
        result["estimators"][name] = {
            "omega_z_rms_deg_per_s": float(np.sqrt(np.mean(rate**2))) if known else None,
            "omega_z_worst_deg_per_s": float(np.abs(rate).max()) if known else None,
            "angle_error_deg": angle if known else None,
            "navigated_s": float(t[-1]),
            "position_error_m": error[-1].tolist(),
        }
        # Each estimator has taken its biases out at the start: what is left of the error is laid on
        # the drift.
        result["drift_deg_per_h"][name] = drift_of(error[-1], np.zeros(3), float(t[-1])) * PER_HOUR
    return result


def paper_drift() -> Array:
    """The paper's drift as a vector, rad/s; it gives only its size, so it is laid where it moves
    x.
    """
    return np.array([0.0, -PAPER_DRIFT / PER_HOUR, 0.0])
