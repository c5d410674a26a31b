"""The tables of a report, each made of what was analysed; empty ones are left out."""

import math
import re
from dataclasses import dataclass, replace

import numpy as np

from logs.figures.names import estimator_title
from logs.figures.numbers import with_half_width
from sessions.recording.manifest import Manifest
from sessions.report.analysis import Analysis

AXES = "xyz"
HYPHEN = re.compile(r"(?<![\w.-])-(?=\.?\d)")  # before a number, and part of nothing else


@dataclass(frozen=True)
class Grid:
    """A table with its title and a remark below."""

    title: str
    head: tuple[str, ...]
    rows: list[tuple[str, ...]]
    remark: str = ""


def number(value: float | None, digits: int = 3) -> str:
    """For people: significant digits, an en dash where nothing is known."""
    if value is None or not math.isfinite(value):
        return "–"
    return f"{value:.{digits}g}" if abs(value) < 1e3 else f"{value:,.0f}"


def deg(value: float | None, places: int = 3) -> str:
    """rad or rad/s as degrees."""
    return "–" if value is None or not math.isfinite(value) else f"{math.degrees(value):.{places}f}"


def percent(share: float) -> str:
    return f"{100.0 * share:.0f} %"


def spelt(grid: Grid) -> Grid:
    """With a minus that is one; hyphens of names and dates stay."""
    rows = [tuple(HYPHEN.sub("−", cell) for cell in row) for row in grid.rows]
    return replace(grid, rows=rows)


def plateaus(found: Analysis) -> Grid | None:
    rows = [
        (
            estimator_title(rate.name),
            f"{part.segment.begin:.2f}–{part.segment.end:.2f}",
            f"{part.segment.settle:.2f}",
            deg(part.segment.omega),
            str(part.samples),
            percent(part.vouched),
            deg(part.mean[2]) if part.vouched else "–",
            deg(part.error[2]),
            deg(part.standard_error[2]),
            " ".join(deg(value, 2) for value in part.rms),
        )
        for rate in found.rates
        for part in rate.plateaus
    ]
    head = (
        "estimator",
        "time, s",
        "settling, s",
        "reference",
        "n",
        "valid",
        "mean ω_z",
        "error",
        "std. error",
        "RMS x y z",
    )
    remark = (
        "Rates in °/s. Plateaus are found from the tachometer alone; 0.25 s at both ends are left"
        " out. Valid: share for which the estimator vouches."
    )
    return Grid("Rate error on every plateau", head, rows, remark)


def scale_factors(found: Analysis) -> Grid | None:
    rows = []
    for rate in found.rates:
        fit = rate.fit
        if fit is None:
            continue
        asymmetry = "–" if fit.asymmetry_ppm is None else f"{fit.asymmetry_ppm:,.0f}"
        rows.append(
            (
                estimator_title(rate.name),
                with_half_width(fit.scale_factor, 2 * fit.scale_factor_sigma, 7),
                f"{fit.linearity_ppm:,.0f}",
                asymmetry,
                with_half_width(math.degrees(fit.bias), math.degrees(2 * fit.bias_sigma)),
                f"{fit.cross_axis[0] * 1e3:.2f}, {fit.cross_axis[1] * 1e3:.2f}",
                " ".join(deg(value, 2) for value in rate.rms) if rate.rms is not None else "–",
                deg(rate.angle_error, 2),
            )
        )
    head = (
        "estimator",
        "scale factor",
        "linearity, ppm",
        "asymmetry, ppm",
        "bias, °/s",
        "cross-axis x, y, mrad",
        "RMS x y z, °/s",
        "angle error, °",
    )
    remark = (
        "indicated = bias + scale factor × reference, weighted least squares over all plateaus and"
        " standstills; ± is two standard errors. Linearity: largest residual over full scale. RMS:"
        " where the tachometer measures or the table stands; angle error: end of the run."
    )
    return Grid("Scale factor, linearity, asymmetry, bias (IEEE Std 836, 1293)", head, rows, remark)


def biases(found: Analysis) -> Grid | None:
    if found.cube is None or found.cube.bias_b is None:
        return None
    row = tuple(f"{value / found.gravity * 1e3:.2f}" for value in found.cube.bias_b)
    remark = (
        "From standstills at different headings: the table turns gravity's horizontal part, not the"
        " bias."
    )
    return Grid("Equivalent accelerometer bias, mg", ("x", "y", "z"), [row], remark)


def positions(found: Analysis) -> Grid | None:
    rows = [
        (
            estimator_title(rate.name),
            f"{p.seconds:.1f}",
            " ".join(number(value) for value in p.error),
            number(float(np.linalg.norm(p.error))),
            number(p.closed_form),
            number(math.degrees(p.drift) * 3600.0),
        )
        for rate in found.rates
        if (p := rate.position) is not None
    ]
    head = (
        "estimator",
        "after, s",
        "error N E D, m",
        "norm, m",
        "bias left in by (27), m",
        "equivalent drift, °/h",
    )
    remark = "The cube stays in its place, so all of its unaided position is error."
    return Grid("Unaided inertial position", head, rows, remark)


def stability(found: Analysis) -> Grid | None:
    rows = [
        (
            one.name,
            number(one.random_walk),
            number(one.bias_instability),
            f"{one.slope:.2f}",
            f"{one.tau[-1]:.2f}",
        )
        for one in found.allan_axes
    ]
    head = (
        "axis",
        "random walk N, m/s²·√s",
        "bias instability B, m/s²",
        "slope of first decade",
        "longest τ, s",
    )
    seconds = f"{found.rest.seconds:.1f} s" if found.rest is not None else ""
    remark = (
        f"Over the longest standstill, {seconds}; B only where the minimum is inside. White noise:"
        " slope −0.5."
    )
    return Grid("Stability at rest (IEEE Std 952, 1293)", head, rows, remark)


def consistency(found: Analysis) -> Grid | None:
    every = [one.nis for one in (*found.rates, *found.navigation) if one.nis is not None]
    rows = [
        (
            estimator_title(one.name),
            f"{one.count:,}",
            f"{one.mean:.3f}",
            f"{one.low:.3f}–{one.high:.3f}",
            f"{100 * one.beyond:.1f} %",
            one.verdict,
        )
        for one in every
    ]
    head = (
        "filter",
        "corrections",
        "NIS / dof",
        "95 % band, white",
        "beyond their 95 %",
        "the filter is",
    )
    remark = "1 is consistent; below, the filter is too careful; above, too sure."
    return Grid("Consistency of the filters", head, rows, remark)


def navigation(found: Analysis) -> Grid | None:
    rows = [
        (
            estimator_title(nav.name),
            str(nav.fixes),
            f"{nav.distance_m:,.0f}",
            number(nav.sigma_end_m),
            f"{100 * nav.rejected:.1f} %",
        )
        for nav in found.navigation
    ]
    return Grid(
        "Navigation", ("filter", "fixes", "way, m", "σ at the end, m", "fixes rejected"), rows
    )


def completeness(manifest: Manifest | None, found: Analysis) -> Grid | None:
    if manifest is None:
        return None
    rows = [
        (
            "/".join(key.split("/")[2:]),
            f"{count.messages + count.lost:,}",
            f"{count.messages:,}",
            f"{count.lost:,}",
        )
        for key, count in sorted(manifest.keys.items())
        if f"/{found.run.device}/" in key
    ]
    link = found.run.link
    remark = ""
    if link:
        remark = (
            f"Line: {link['good_frames']:,.0f} good frames, {link['lost_frames']:,.0f} lost,"
            f" {link['bad_bytes']:,.0f} bad bytes of {link['bytes_in']:,.0f};"
            f" {link['lost_samples']:,.0f} samples lost."
        )
    return Grid("Completeness", ("topic", "expected", "recorded", "lost"), rows, remark)
