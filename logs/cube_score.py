"""How well an estimator did over a log of a cube: against truth or tachometer, and the bound."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inertial.calibration.card import Card
from inertial.layouts.layout import GeometryError, Layout
from inertial.rate.bound import IN_USE, rate_bound
from inertial.rate.tachometer import SUFFIX
from inertial.rotation import followed, level
from logs.cube_axes import Agreement
from logs.cube_log import CubeLog
from logs.cube_run import EstimatorRun, Reference

Array = NDArray[np.float64]

SURE = 5.0  # rad/s; an estimate less certain than that says "I do not know yet" and has no NEES
MOSTLY = 0.5  # share of the samples in which a rate is known, without which its integral is none
AT_REST = 2e-3  # rad/s; a truth below it stands for rest


def score(track: EstimatorRun | None, truth: Reference, bound: Array | None) -> dict[str, Any]:
    """RMS of the rate error per axis (rad/s) and NEES (3 degrees, so 3 is right) over what the
    estimator calls valid, the share of the samples that this is, and the error of the angle about z
    at the end, where that rate was known: at the end and over most of the log. Beside it the RMS of
    all that was said, also where the estimator itself called it unknown.
    """
    if track is None:
        nothing_known = dict.fromkeys(
            ("rate_rms_radps", "valid_share", "rate_rms_all_radps", "angle_error_final_rad")
        )
        more = dict.fromkeys(("bound_rate_rms_radps", "nees_mean", "us_per_sample"))
        return nothing_known | more
    circular = track.name.endswith(SUFFIX) and truth.name == "tachometer"
    valid = track.valid
    share = valid.mean(axis=0)
    said = track.omega_b - truth.omega_b + (np.nan if circular else 0.0)
    error = np.where(valid, said, np.nan)
    turned = valid[-1, 2] and share[2] >= MOSTLY and not circular
    return {
        "rate_rms_radps": [rms_known(column) for column in error.T],
        "valid_share": share.tolist(),
        "rate_rms_all_radps": [rms_known(column) for column in said[track.started].T],
        "angle_error_final_rad": (
            _known(abs(track.angle_z[-1] - truth.angle_z[-1])) if turned else None
        ),
        "bound_rate_rms_radps": [None] * 3 if bound is None else [_known(value) for value in bound],
        "nees_mean": nees_mean(error, track.P),
        "us_per_sample": track.us_per_sample,
    }


def rms_known(values: Array) -> float | None:
    """RMS of what is known of values (n,); None where nothing is."""
    there = values[np.isfinite(values)]
    return _known(np.sqrt(np.mean(there**2))) if len(there) else None


def nees_mean(error: Array, P: Array) -> float | None:
    """Mean of e^T P^-1 e over the samples at which the estimator knew something; None without all
    three errors.
    """
    sure = np.isfinite(error).all(axis=1) & (np.trace(P, axis1=1, axis2=2) < 3.0 * SURE**2)
    if not sure.any():
        return None
    e, V = error[sure], P[sure]
    try:
        return _known(np.mean(np.einsum("ni,ni->n", e, np.linalg.solve(V, e[:, :, None])[:, :, 0])))
    except np.linalg.LinAlgError:
        return (
            None  # it claims to know a component without any error: no NEES says how wrong that is
        )


def _known(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def bound_of(
    data: CubeLog, shape: Layout, truth: Reference, agree: Agreement | None = None
) -> Array | None:
    """RMS of the posterior Cramer-Rao bound (3,), rad/s, along the true motion, by the noise that
    the axes have where they can tell; None where the motion is not known.
    """
    if not np.isfinite(truth.omega_b).all():
        return None
    omega = np.where(np.abs(truth.omega_b) < AT_REST, 0.0, truth.omega_b)
    alpha = np.gradient(omega, data.t_s, axis=0)
    alpha[(omega == 0.0).all(axis=1)] = (
        0.0  # the difference across the first sample of a turn is not the table's
    )
    q_nb = data.q_nb if data.q_nb is not None else _turned(data, shape, omega)
    try:
        knows = replace(IN_USE, sigma_axis=agree.sigma_axis) if agree and agree.text else IN_USE
        sigma = rate_bound(shape, data.t_s, q_nb, omega, alpha, knows)
    except GeometryError:
        return None
    return np.sqrt(np.mean(sigma**2, axis=0))


def _turned(data: CubeLog, shape: Layout, omega_b: Array) -> Array:
    """Attitude (n, 4) of a motion from its rate: levelled on the first tenth of a second, then
    turned.
    """
    n = max(1, round(0.1 / data.period_s))
    first = level(np.linalg.pinv(shape.theta_b) @ data.f_axis[:n].mean(axis=0))
    dt = np.diff(data.t_s[: len(omega_b)])
    return followed(first, dt[:, None] * (0.5 * (omega_b[:-1] + omega_b[1:])))


def notes_of(data: CubeLog, truth: Reference, card: Card | None) -> list[str]:
    """What a person should know of how the scores came about."""
    found = [
        (
            f"calibration file {card.id}"
            if card
            else "no calibration file: nominal scale, positions and directions"
        )
    ]
    if truth.name == "tachometer":
        found.append("scored against the tachometer: only z is known")
    elif not truth.name:
        found.append("neither truth nor tachometer in the log: nothing to score against")
    return found
