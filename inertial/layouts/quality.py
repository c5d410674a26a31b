"""What a layout can see, and how well: the figures a designer compares layouts by.

Source: Hoseini and Moradi 2017, (22)-(24); docs/layouts.md, L-1 to L-6. Body frame b, SI.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space, solve_discrete_are

from inertial.layouts.layout import PRODUCTS, Layout, products

Array = NDArray[np.float64]

ALPHA = ("w'x", "w'y", "w'z")
FORCE = ("px", "py", "pz")
PRODUCT = tuple(f"w{'xyz'[i]}w{'xyz'[j]}" for i, j in zip(*PRODUCTS, strict=True))
UNKNOWNS = ALPHA + FORCE + PRODUCT
SEEN = 1e-3  # how far an unknown may lie outside what the axes span
WEAK = 3.0  # times the noise of the paper's cube of the same scale and sensor: seen, but hardly
CUBE_NOISE = (8.0**-0.5,) * 3 + (0.5,) * 3  # of omega' and p, in units of sigma / scale and sigma
CUBE_PRODUCTS = 3.0**0.5 / 4.0  # of w_i^2, the worst of the six, in units of sigma / scale


@dataclass(frozen=True)
class Quality:
    """Figures of one layout. Lengths inside kappa, gdop and singular values are in units of its
    scale.
    """

    layout: Layout
    kappa: float
    gdop: float
    rank: int  # of the 12 unknowns
    condition: (
        float  # of what is seen of the 12: largest over smallest singular value that is not zero
    )
    singular: Array  # (12,), falling
    singular_products: Array  # (6,), what is left of the products when omega' and p are free
    seen: tuple[str, ...]  # by unknown: "yes", "weak", "no"
    mixtures: tuple[
        str, ...
    ]  # combinations of products that are seen although not each of them alone
    # (6, 6): S Q, what products add to [omega'; p] by least squares; rad^2/s^2 -> rad/s^2, m/s^2
    feedback: Array
    # (12,), of one sample with all 12 free: rad/s^2, m/s^2, (rad/s)^2; inf where not seen
    sigma_field: Array
    sigma_least_squares: (
        Array  # (6,), of one sample of [omega'; p] with the rate known: rad/s^2, m/s^2
    )
    walk: Array  # (3,), rad/s per root s: omega by integration alone
    sigma_rate: (
        Array  # (3,), rad/s: omega of a steady filter while turning at `rate`; inf where it drifts
    )
    rate: Array  # (3,), rad/s
    period_s: float

    @property
    def feedback_alpha(self) -> bool:
        """Least squares needs the rate to give omega'."""
        return bool(np.abs(self.feedback[:3]).max() > SEEN)

    @property
    def feedback_force(self) -> bool:
        """Least squares needs the rate to give p."""
        return bool(np.abs(self.feedback[3:]).max() > SEEN * self.layout.scale_m)

    def as_json(self) -> dict[str, Any]:
        """For --json; infinite figures are null."""
        layout = self.layout
        return {
            "name": layout.name,
            "text": layout.text,
            "axes": layout.axes,
            "scale_m": layout.scale_m,
            "kappa": _plain(self.kappa),
            "gdop": _plain(self.gdop),
            "feedback": {"alpha": self.feedback_alpha, "force": self.feedback_force},
            "rank": self.rank,
            "condition": _plain(self.condition),
            "singular_values": _plain(self.singular),
            "singular_values_products": _plain(self.singular_products),
            "observable": dict(zip(UNKNOWNS, self.seen, strict=True)),
            "mixtures": list(self.mixtures),
            "sigma_field": dict(zip(UNKNOWNS, _plain(self.sigma_field), strict=True)),
            "sigma_alpha_radps2": _plain(self.sigma_least_squares[:3]),
            "sigma_force_mps2": _plain(self.sigma_least_squares[3:]),
            "rate_walk_radps_per_root_s": _plain(self.walk),
            "rate_radps": _plain(self.rate),
            "sigma_rate_radps": _plain(self.sigma_rate),
            "period_s": self.period_s,
            "J": _plain(layout.J),
            "S": _plain(layout.S) if np.isfinite(self.gdop) else None,
        }


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return [_plain(v) for v in value]
    return float(value) if np.isfinite(value) else None


def analyse(layout: Layout, rate: Array | None = None, period_s: float = 0.01) -> Quality:
    """All figures of a layout; `rate` (3,) rad/s is the turn that sigma_rate is for, default 180
    deg/s about z.
    """
    rate = np.array([0.0, 0.0, np.pi]) if rate is None else np.asarray(rate, dtype=np.float64)
    F = layout._scaled(layout.field_matrix)
    left, sigma, right = np.linalg.svd(F)
    sigma = np.concatenate([sigma, np.zeros(12 - len(sigma))])
    rank = layout.rank
    spanned, lost = right[:rank], right[rank:]
    outside = np.linalg.norm(lost, axis=0) if len(lost) else np.zeros(12)
    unit = np.concatenate(
        [np.full(3, 1 / layout.scale_m), np.ones(3), np.full(6, 1 / layout.scale_m)]
    )
    with np.errstate(divide="ignore"):
        spread = (left[:, :rank].T * layout.noise) if rank else np.zeros((0, layout.axes))
        P = spanned.T / sigma[:rank] @ (spread @ spread.T) @ (spanned / sigma[:rank, None])
    noise = np.sqrt(np.diag(P)) * unit
    noise[outside > SEEN] = np.inf
    least, feedback = _least_squares(layout)
    return Quality(
        layout,
        layout.kappa,
        layout.gdop,
        rank,
        float(sigma[0] / sigma[rank - 1]) if rank else np.inf,
        sigma,
        _of_products(layout),
        _grades(layout, noise),
        _mixtures(layout, outside),
        feedback,
        noise,
        least,
        least[:3] * np.sqrt(period_s),
        _steady_rate(layout, rate, period_s),
        rate,
        period_s,
    )


def _least_squares(layout: Layout) -> tuple[Array, Array]:
    """Sigma (6,) of [omega'; p] by S, and S Q (6, 6) (L-2); infinite below rank 6."""
    if not np.isfinite(layout.gdop):
        return np.full(6, np.inf), np.full((6, 6), np.nan)
    S = layout.S
    return np.sqrt((S**2) @ layout.noise**2), S @ layout.Q


def _weighted(layout: Layout) -> tuple[Array, Array]:
    """J and Q by axis noise, one row per axis, without unit."""
    return layout.J / layout.noise[:, None], layout.Q / layout.noise[:, None]


def _of_products(layout: Layout) -> Array:
    """Singular values (6,) of the products, omega' and p eliminated (L-3)."""
    free = null_space(layout._scaled(layout.J).T, rcond=1e-9)
    if free.shape[1] == 0:
        return np.zeros(6)
    sigma = np.linalg.svd(free.T @ layout.Q / layout.scale_m, compute_uv=False)
    return np.concatenate([sigma, np.zeros(max(0, 6 - len(sigma)))])[:6]


def rate_information(layout: Layout, omega_b: Array) -> Array:
    """Information (3, 3), 1/(rad/s)^2, of one sample on omega_b through its products, omega' and p
    free (L-4).
    """
    J, Q = _weighted(layout)
    step = 1e-6
    H = np.column_stack(
        [
            (products(omega_b + step * e) - products(omega_b - step * e)) / (2 * step)
            for e in np.eye(3)
        ]
    )
    unit = np.linalg.norm(J, axis=0)
    J = J / np.where(unit > 0.0, unit, 1.0)
    projected = Q - J @ np.linalg.lstsq(J, Q, rcond=1e-9)[0]
    projected[np.abs(projected) < 1e-9 * np.abs(Q).max(initial=0.0)] = 0.0
    seen = projected @ H
    return seen.T @ seen


def _steady_rate(layout: Layout, omega_b: Array, dt: float) -> Array:
    """Sigma (3,) of omega in the steady state: integrated omega' corrected by products (L-5); inf
    where unbounded.
    """
    if not np.isfinite(layout.gdop):
        return np.full(3, np.inf)
    information = rate_information(layout, omega_b)
    S = layout.S
    walk = dt**2 * (S[:3] * layout.noise**2) @ S[:3].T
    values, vectors = np.linalg.eigh(information)
    good = values > 1e-7 * max(values.max(), 1e-12)
    basis = vectors[:, good]
    sigma = np.full(3, np.inf)
    if not good.any():
        return sigma
    R = np.diag(1.0 / values[good])
    inside = basis.T @ walk @ basis
    P = solve_discrete_are(np.eye(good.sum()), np.eye(good.sum()), inside, R)
    P = np.linalg.inv(np.linalg.inv(P) + np.linalg.inv(R))
    outside = np.linalg.norm(vectors[:, ~good], axis=1) if (~good).any() else np.zeros(3)
    held = outside < SEEN
    sigma[held] = np.sqrt(np.diag(basis @ P @ basis.T))[held]
    return sigma


def _grades(layout: Layout, noise: Array) -> tuple[str, ...]:
    """Each unknown: "yes", "weak" above WEAK times the cube's noise, "no"."""
    one = float(np.median(layout.noise))
    best = np.array(
        [v * one / layout.scale_m for v in CUBE_NOISE[:3]] + [v * one for v in CUBE_NOISE[3:]]
    )
    best = np.concatenate([best, np.full(6, CUBE_PRODUCTS * one / layout.scale_m)])
    return tuple(
        "no" if not np.isfinite(n) else "weak" if n > WEAK * b else "yes"
        for n, b in zip(noise, best, strict=True)
    )


def _mixtures(layout: Layout, outside: Array) -> tuple[str, ...]:
    """Combinations of products seen without omega' and p, where the single ones are not (reduced
    rows, L-3).
    """
    if (outside[6:] <= SEEN).all():
        return ()
    free = null_space(layout._scaled(layout.J).T, rcond=1e-9)
    if free.shape[1] == 0:
        return ()
    rows = _echelon(free.T @ layout.Q / layout.scale_m)
    found = []
    for row in rows:
        terms = [(c, name) for c, name in zip(row, PRODUCT, strict=True) if abs(c) > SEEN]
        if len(terms) > 1:
            text = " ".join(
                f"{'+' if c > 0 else '-'} {'' if abs(abs(c) - 1) < SEEN else f'{abs(c):.3g} '}{n}"
                for c, n in terms
            )
            found.append(text.removeprefix("+ "))
    return tuple(found)


def _echelon(matrix: Array) -> Array:
    """Reduced row echelon form, rows that are not zero."""
    rows, pivot = matrix.copy(), 0
    for column in range(rows.shape[1]):
        if pivot >= len(rows):
            break
        best = pivot + int(np.abs(rows[pivot:, column]).argmax())
        if abs(rows[best, column]) < SEEN:
            continue
        rows[[pivot, best]] = rows[[best, pivot]]
        rows[pivot] /= rows[pivot, column]
        others = np.arange(len(rows)) != pivot
        rows[others] -= np.outer(rows[others, column], rows[pivot])
        pivot += 1
    return rows[:pivot]
