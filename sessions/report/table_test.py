"""A rate table's figures in the terms of IEEE Std 1293, 836 and 952: scale factor, linearity,
asymmetry, bias.

The model of the plateaus, by weighted least squares over all of them:

    indicated_k = bias + scale_factor * reference_k + residual_k
    (R-1) linearity   = max_k |residual_k| / full_scale * 1e6 ppm,  full_scale = max_k |reference_k|
    (R-2) asymmetry   = (SF+ - SF-) / mean(SF+, SF-) * 1e6 ppm, from one fit with a slope for each
    direction     (R-3) cross-axis  = slope of omega_x, omega_y over the reference
    (R-4)

Standard errors of means are of batch means (0.5 s), since an estimate's errors are correlated in
time.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sessions.report.data import Rate, Tacho
from sessions.report.segments import Segment, reference

Array = NDArray[np.float64]
BATCH = 0.5  # s
FLOOR = np.radians(0.001)  # rad/s, least standard error: a perfect plateau is no infinite weight


@dataclass(frozen=True)
class Plateau:
    """One estimator on one segment; rad/s, body axes x y z."""

    segment: Segment
    samples: int
    mean: Array  # (3,)
    scatter: Array  # (3,) standard deviation
    error: Array  # (3,) mean minus reference (0, 0, omega)
    standard_error: Array  # (3,) of the mean
    rms: Array  # (3,) RMS of estimate minus reference within the segment
    vouched: float = 1.0  # share of the samples whose rate about z the estimator vouches for


@dataclass(frozen=True)
class ScaleFactor:
    """(R-1) to (R-4); None where the run has too few levels to tell."""

    scale_factor: float
    scale_factor_sigma: float
    bias: float  # rad/s
    bias_sigma: float
    linearity_ppm: float
    asymmetry_ppm: float | None
    cross_axis: Array  # (2,) rad, slopes of x and y
    residual: Array  # (k,) rad/s, per plateau


def plateaus(rate: Rate, segments: list[Segment], tacho: Tacho) -> list[Plateau]:
    """The estimator on every segment that it has samples in."""
    found = []
    for part in segments:
        at = part.holds(rate.t)
        if at.sum() < 10:
            continue
        omega, t = rate.omega_b[at], rate.t[at]
        truth = np.column_stack([np.zeros((len(t), 2)), reference(tacho, t)])
        error = omega - truth
        found.append(
            Plateau(
                segment=part,
                samples=int(at.sum()),
                mean=omega.mean(axis=0),
                scatter=omega.std(axis=0),
                error=error.mean(axis=0),
                standard_error=batch_error(t, error),
                rms=np.sqrt((error**2).mean(axis=0)),
                vouched=1.0 if rate.sight is None else float(1.0 - (rate.sight[at, 2] > 0).mean()),
            )
        )
    return found


def batch_error(t: Array, values: Array) -> Array:
    """Standard error of the mean of correlated values (n, k), from the means of BATCH long
    pieces.
    """
    piece = ((t - t[0]) / BATCH).astype(int)
    means = np.array([values[piece == k].mean(axis=0) for k in np.unique(piece)])
    if len(means) < 3:
        return np.full(values.shape[1], np.nan)
    return means.std(axis=0, ddof=1) / np.sqrt(len(means))


def scale_factor(found: list[Plateau]) -> ScaleFactor | None:
    """The fit over plateaus and standstills; None with fewer than two different levels."""
    levels = np.array([p.segment.omega for p in found])
    if len(found) < 2 or np.ptp(levels) < np.radians(5.0):
        return None
    indicated = np.array([p.mean[2] for p in found])
    sigma = np.array([np.hypot(np.nan_to_num(p.standard_error[2], nan=0.05), FLOOR) for p in found])
    design = np.column_stack([np.ones_like(levels), levels])
    weighted = design / sigma[:, None]
    inverse = np.linalg.inv(weighted.T @ weighted)
    bias, slope = inverse @ weighted.T @ (indicated / sigma)
    residual = indicated - design @ [bias, slope]
    # The scatter of the residuals, where they say more than the standard errors do.
    spread = max(1.0, float(np.sqrt((residual**2 / sigma**2).sum() / max(1, len(found) - 2))))
    cross = np.array([np.polyfit(levels, [p.mean[k] for p in found], 1)[0] for k in (0, 1)])
    return ScaleFactor(
        scale_factor=float(slope),
        scale_factor_sigma=float(np.sqrt(inverse[1, 1]) * spread),
        bias=float(bias),
        bias_sigma=float(np.sqrt(inverse[0, 0]) * spread),
        linearity_ppm=float(np.abs(residual).max() / np.abs(levels).max() * 1e6),
        asymmetry_ppm=_asymmetry(levels, indicated, sigma),
        cross_axis=cross,
        residual=residual,
    )


def _asymmetry(levels: Array, indicated: Array, sigma: Array) -> float | None:
    """(R-3) from indicated = bias + s w + c |w|: SF+ = s + c, SF- = s - c; None where three levels
    do not tell.
    """
    design = np.column_stack([np.ones_like(levels), levels, np.abs(levels)]) / sigma[:, None]
    both = levels.max() > np.radians(5.0) and levels.min() < -np.radians(5.0)
    if not both or np.linalg.matrix_rank(design, tol=1e-6 * np.abs(design).max()) < 3:
        return None
    _, slope, uneven = np.linalg.lstsq(design, indicated / sigma, rcond=None)[0]
    return float(2.0 * uneven / slope * 1e6)
