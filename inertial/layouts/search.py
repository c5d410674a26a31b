"""Search for better layouts under mounting constraints. Deterministic by seed.

Every element of F = [J Q] is linear in the position (r, 1) and in the direction theta of its axis:

    F_ik = sum_ab T_kab (r_i, 1)_a theta_ib                                                  (L-7)

so the gradient of any function of F follows without differences. Minimised, lengths in units of the
region's scale:

    trace((J^T J)^-1) + w_12 trace of the products' block of (F^T F)^-1 + w_q |J^T Q|^2      (L-8)

the first term is GDOP^2; w_12 > 0 keeps all twelve unknowns seen; w_q grows until S Q = 0. Triads:
J^T J, F^T F and J^T Q do not depend on how a triad is turned, so only positions are searched and
triads point along the body axes.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from inertial.layouts.layout import SENSORS, GeometryError, Layout, products_matrix

Array = NDArray[np.float64]
Progress = Callable[[float, str], None]

WEIGHTS_FREE = (1.0, 1e2, 1e4, 1e7)  # of |J^T Q|^2, one after the other
WEIGHT_FIELD = 0.02  # of the products' noise, when all twelve unknowns are wanted
WELL_SEEN = 0.02  # of the largest singular value: what a search calls seen
RIDGE = 1e-9  # keeps the trace finite on the way


@dataclass(frozen=True)
class Region:
    """Where axes may sit, m: in a box of these half sides, in a sphere, or at given points only."""

    half_sides_m: tuple[float, float, float] = (0.05, 0.05, 0.05)
    radius_m: float | None = None
    points_m: tuple[tuple[float, float, float], ...] = ()

    @property
    def scale_m(self) -> float:
        """The length that counts as 1."""
        if self.points_m:
            return float(np.abs(np.array(self.points_m)).max()) or 1.0
        return self.radius_m or max(self.half_sides_m)


@dataclass(frozen=True)
class Wish:
    """What is looked for."""

    axes: int = 12
    triads: bool = False
    rank: int = 6  # 12: all unknowns of the field must be seen
    no_feedback: bool = False  # S Q = 0
    region: Region = field(default_factory=Region)
    starts: int = 16
    seed: int = 1
    sensor: str = "adxl345"


@dataclass(frozen=True)
class Found:
    """The best layout of a search and what was tried."""

    layout: Layout
    starts: int
    agreeing: int  # starts that ended within 0.1 % of the best
    gdops: tuple[float, ...]  # of all starts that met the wish, rising
    bound: float  # no layout of so many axes in this region is below (L-9)


def _tensor() -> Array:
    """T (12, 4, 3) of L-7."""
    T = np.zeros((12, 4, 3))
    for b, theta in enumerate(np.eye(3)):
        T[3:6, 3, b] = theta
        for a, r in enumerate(np.eye(3)):
            T[0:3, a, b] = np.cross(r, theta)
            T[6:12, a, b] = products_matrix(r[None], theta[None])[0]
    return T


T = _tensor().reshape(12, 12)  # k by (a, b)


class _Problem:
    """Variables: positions in units of the scale unless they are given, then directions unless they
    are triads'.
    """

    def __init__(self, wish: Wish) -> None:
        region = wish.region
        self.scale = region.scale_m
        self.places = wish.axes // 3 if wish.triads else wish.axes
        self.points = np.array(region.points_m) / self.scale if region.points_m else None
        self.box = np.array(region.half_sides_m) / self.scale
        self.sphere = region.radius_m is not None
        self.triads = wish.triads
        self.held = wish.rank == 12
        self.moving = self.points is None

    def start(self, draw: np.random.Generator) -> Array:
        """Random variables; every second draw puts the places in turn at the corners of the
        region.
        """
        parts = []
        if self.moving:
            at_corners = draw.random() < 0.5
            place = draw.uniform(-1.0, 1.0, (self.places, 3))
            if at_corners:
                corners = np.array(
                    [[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=np.float64
                )
                chosen = corners[np.prod(corners, axis=1) > 0] if draw.random() < 0.5 else corners
                place = 0.98 * chosen[np.arange(self.places) % len(chosen)] + 0.02 * place
            parts.append((place * (3.0**-0.5 if self.sphere else self.box)).ravel())
        if not self.triads:
            parts.append(draw.normal(size=self.places * 3))
        return np.concatenate(parts)

    def bounds(self) -> list[tuple[float | None, float | None]]:
        """Box of the positions; directions are free and normalised."""
        found: list[tuple[float | None, float | None]] = []
        if self.moving:
            found += (
                [(None, None)] * (3 * self.places)
                if self.sphere
                else [(-b, b) for b in self.box] * self.places
            )
        return found if self.triads else found + [(None, None)] * (3 * self.places)

    def geometry(self, v: Array) -> tuple[Array, Array]:
        """Positions and directions (N, 3) of the variables, unit scale."""
        n = 3 * self.places
        place = (
            v[:n].reshape(-1, 3)
            if self.moving
            else self.points[np.arange(self.places) % len(self.points)]
        )
        if self.moving and self.sphere:
            place = place / np.maximum(1.0, np.linalg.norm(place, axis=1))[:, None]
        if self.triads:
            return np.repeat(place, 3, axis=0), np.tile(np.eye(3), (self.places, 1))
        d = v[n if self.moving else 0 :].reshape(-1, 3)
        return place, d / np.linalg.norm(d, axis=1)[:, None]

    def value(self, v: Array, w_q: float) -> tuple[float, Array]:
        """L-8 and its gradient."""
        r, theta = self.geometry(v)
        r1 = np.column_stack([r, np.ones(len(r))])
        pairs = (r1[:, :, None] * theta[:, None, :]).reshape(-1, 12)
        cost, G = _cost(pairs @ T.T, self.held, w_q)
        G = (G @ T).reshape(-1, 4, 3)
        parts = []
        if self.moving:
            g = np.sum(G * theta[:, None, :], axis=2)[:, :3]
            if self.triads:
                g = g.reshape(self.places, 3, 3).sum(axis=1)
            if self.sphere:
                raw = v[: 3 * self.places].reshape(-1, 3)
                length = np.linalg.norm(raw, axis=1)[:, None]
                u = raw / np.maximum(length, 1e-12)
                g = np.where(
                    length > 1.0,
                    (g - u * np.sum(u * g, axis=1)[:, None]) / np.maximum(length, 1.0),
                    g,
                )
            parts.append(g.ravel())
        if not self.triads:
            g = np.sum(G * r1[:, :, None], axis=1)
            d = v[-3 * self.places :].reshape(-1, 3)
            g = (g - theta * np.sum(theta * g, axis=1)[:, None]) / np.linalg.norm(d, axis=1)[
                :, None
            ]
            parts.append(g.ravel())
        return cost, np.concatenate(parts)


def _cost(F: Array, held: bool, w_q: float) -> tuple[float, Array]:
    """L-8 of F (N, 12) and its derivative (N, 12)."""
    J, Q, G = F[:, :6], F[:, 6:], np.zeros_like(F)
    M = np.linalg.inv(J.T @ J + RIDGE * np.eye(6))
    cost = float(np.trace(M))
    G[:, :6] = -2.0 * J @ M @ M
    if held:
        M = np.linalg.inv(F.T @ F + RIDGE * np.eye(12))
        cost += WEIGHT_FIELD * float(np.trace(M[6:, 6:]))
        G += -2.0 * WEIGHT_FIELD * F @ M[:, 6:] @ M[6:, :]
    if w_q:
        C = J.T @ Q
        cost += w_q * float(np.sum(C**2))
        G[:, :6] += 2.0 * w_q * Q @ C.T
        G[:, 6:] += 2.0 * w_q * J @ C
    return cost, G


def check(wish: Wish) -> None:
    """Raises GeometryError for a wish that no layout can meet."""
    if not 6 <= wish.axes <= 64 or (wish.triads and wish.axes % 3):
        raise GeometryError(
            f"{wish.axes} axes: want 6 to 64"
            + (", a multiple of 3 for triads" if wish.triads else "")
        )
    if wish.rank not in (6, 8, 12) and not 6 <= wish.rank <= 12:
        raise GeometryError(
            f"rank {wish.rank}: want 6 (angular acceleration and force) or 12 (the products too)"
        )
    if wish.rank > wish.axes:
        raise GeometryError(
            f"rank {wish.rank} of {wish.axes} axes: want at least as many axes as unknowns"
        )
    if wish.sensor not in SENSORS:
        raise GeometryError(f"sensor {wish.sensor!r}: want one of {', '.join(SENSORS)}")
    region = wish.region
    sizes = (*region.half_sides_m, region.radius_m if region.radius_m is not None else 1.0)
    if not all(np.isfinite(s) and s >= 0.0 for s in sizes) or not region.scale_m > 0.0:
        raise GeometryError(f"region {region}: want sizes above 0 m")


def search(wish: Wish, progress: Progress = lambda done, what: None) -> Found:
    """The layout of smallest GDOP that meets the wish; raises GeometryError when none was found."""
    check(wish)
    problem = _Problem(wish)
    met: list[tuple[float, Layout]] = []
    weights = WEIGHTS_FREE if wish.no_feedback else (0.0,)
    for k in range(wish.starts):
        v = problem.start(np.random.default_rng([wish.seed, k]))
        for w_q in weights:
            v = minimize(
                problem.value,
                v,
                args=(w_q,),
                jac=True,
                method="L-BFGS-B",
                bounds=problem.bounds(),
                options={"maxiter": 400, "ftol": 1e-15, "gtol": 1e-10},
            ).x
        layout = _layout(problem, v, wish)
        if _meets(layout, wish):
            met.append((layout.gdop, layout))
        best = min((g for g, _ in met), default=np.inf)
        progress((k + 1) / wish.starts, f"start {k + 1} of {wish.starts}, best GDOP {best:.4f}")
    if not met:
        wanted = f"rank {wish.rank}" + (", no feedback" if wish.no_feedback else "")
        raise GeometryError(
            f"no layout of {wish.axes} axes with {wanted} in this region after {wish.starts}"
            " starts: allow more axes, more room, or try more --starts"
        )
    met.sort(key=lambda item: item[0])
    gdops = tuple(round(g, 6) for g, _ in met)
    agreeing = sum(g <= met[0][0] * 1.001 for g in gdops)
    return Found(met[0][1], wish.starts, agreeing, gdops, lower_bound(wish))


def _layout(problem: _Problem, v: Array, wish: Wish) -> Layout:
    r, theta = problem.geometry(v)
    snapped = np.where(np.abs(np.abs(r) - 1.0) < 1e-7, np.sign(r), r)
    return Layout(
        "found",
        problem.scale * snapped,
        theta,
        problem.scale,
        sensors=(SENSORS[wish.sensor],) * len(r),
        text=f"found by search: seed {wish.seed}, rank {wish.rank}"
        + (", no feedback" if wish.no_feedback else ""),
    )


def _meets(layout: Layout, wish: Wish) -> bool:
    if not np.isfinite(layout.gdop):
        return False
    if wish.no_feedback and np.abs((layout.S @ layout.Q)[:3]).max() > 1e-4:
        return False
    if wish.no_feedback and np.abs((layout.S @ layout.Q)[3:]).max() > 1e-4 * layout.scale_m:
        return False
    sigma = np.linalg.svd(layout._scaled(layout.field_matrix), compute_uv=False)
    return int(np.sum(sigma > WELL_SEEN * sigma[0])) >= wish.rank


def lower_bound(wish: Wish) -> float:
    """GDOP below which no layout of N axes can be (L-9).

    trace(sum theta theta^T) = N and trace(sum (r x theta)(r x theta)^T) <= sum |r|^2 <= N rho^2,
    rho the farthest place, so by the mean inequality GDOP^2 >= 9 / N + 9 / (N rho^2); triads feel
    only 2/3 of it: |r x theta|^2 of a triad sums to 2 |r|^2.
    """
    region, scale = wish.region, wish.region.scale_m
    if region.points_m:
        rho2 = max(float(np.sum(np.square(p))) for p in region.points_m) / scale**2
    else:
        rho2 = (
            1.0
            if region.radius_m is not None
            else float(np.sum(np.square(region.half_sides_m))) / scale**2
        )
    turning = wish.axes * rho2 * (2.0 / 3.0 if wish.triads else 1.0)
    return float(np.sqrt(9.0 / wish.axes + 9.0 / turning))
