"""Every number of a report that a limit can be set on: one flat table, name -> value in the unit of
its name.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from inertial.constants import MILLI_G
from sessions.report.analysis import Analysis


@dataclass(frozen=True)
class Metric:
    """A figure, ready for people."""

    name: str
    value: float | None  # None: this session cannot tell
    text: str  # what it is


def metrics(found: Analysis, estimator: str) -> list[Metric]:
    """The figures of one estimator, and of the session."""
    rows: list[tuple[str, Any, str]] = [
        (
            "completeness",
            found.completeness,
            "share of the messages known to have been sent that is recorded",
        ),
        (
            "lost_samples",
            found.run.link.get("lost_samples"),
            "samples lost between board and gateway",
        ),
        (
            "bad_bytes",
            found.run.link.get("bad_bytes"),
            "bytes of the line that belong to no good frame",
        ),
    ]
    rows += _rate_rows(found, estimator)
    bias = found.cube.bias_b if found.cube is not None else None
    for k, axis in enumerate("xyz"):
        rows.append(
            (
                f"accel_bias_{axis}_mg",
                None if bias is None else bias[k] / MILLI_G,
                f"equivalent bias of p_{axis}",
            )
        )
    for one in found.allan_axes:
        rows.append(
            (
                f"{one.name}_random_walk_mps_sqrt_s",
                one.random_walk,
                f"velocity random walk of {one.name}",
            )
        )
    for nav in found.navigation:
        rows += [
            (
                f"{nav.name}_nis_per_dof",
                nav.nis_mean,
                f"NIS of {nav.name} over its degrees of freedom",
            ),
            (
                f"{nav.name}_rejected_share",
                nav.rejected,
                f"share of fixes that {nav.name} did not accept",
            ),
        ]
    return [
        Metric(name, None if value is None else float(value), text) for name, value, text in rows
    ]


def _rate_rows(found: Analysis, estimator: str) -> list[tuple[str, Any, str]]:
    rate = found.rate(estimator)
    if rate is None:
        return []
    rows: list[tuple[str, Any, str]] = []
    degrees = None if rate.rms is None else np.degrees(rate.rms)
    for k, axis in enumerate("xyz"):
        rows.append(
            (
                f"rate_rms_{axis}_dps",
                None if degrees is None else degrees[k],
                f"RMS error of omega_{axis}",
            )
        )
    fit = rate.fit
    rows += [
        (
            "scale_factor_error_ppm",
            fit and (fit.scale_factor - 1.0) * 1e6,
            "scale factor of omega_z minus 1",
        ),
        ("scale_factor_sigma_ppm", fit and fit.scale_factor_sigma * 1e6, "its standard error"),
        ("linearity_ppm", fit and fit.linearity_ppm, "largest residual of the fit over full scale"),
        (
            "asymmetry_ppm",
            fit and fit.asymmetry_ppm,
            "scale factor counter-clockwise minus clockwise",
        ),
        ("rate_bias_dps", fit and np.degrees(fit.bias), "bias of omega_z from the fit"),
        (
            "cross_axis_x_mrad",
            fit and fit.cross_axis[0] * 1e3,
            "slope of omega_x over the table's rate",
        ),
        (
            "cross_axis_y_mrad",
            fit and fit.cross_axis[1] * 1e3,
            "slope of omega_y over the table's rate",
        ),
        (
            "angle_error_deg",
            None if rate.angle_error is None else np.degrees(rate.angle_error),
            "angle at the end",
        ),
        ("nis_per_dof", rate.nis and rate.nis.mean, "NIS over its degrees of freedom"),
    ]
    position = rate.position
    rows.append(
        (
            "position_error_m",
            position and float(np.linalg.norm(position.error)),
            "inertial position, end",
        )
    )
    drift = position and np.degrees(position.drift) * 3600.0
    rows.append(("equivalent_drift_dph", drift, "rate drift that explains it, (27)"))
    return rows
