"""What a layout measures directly, sample by sample, and how noisy that is: the constants of every
rate filter.

    [alpha_m; p_m] = S a = [omega'; p] + S Q z + S bias         z: the six products w_i w_j
    (E-40) c_m            = B a = M z + B bias,   B J = 0              what the axes say of z
    without integration     (E-41)

B spans what is left of the axes once omega' and p are taken out, so its noise is not correlated
with theirs. Layouts that see all twelve unknowns of the field have M = I: c_m is the products.
Others see fewer rows, down to none. An axis that is excluded has a column of zeros; the rest is
solved anew.
"""

import numpy as np
from numpy.typing import NDArray

from inertial.core import native
from inertial.layouts.layout import RANK_TOLERANCE, GeometryError, Layout

Array = NDArray[np.float64]

UNKNOWNS = ("ω'x", "ω'y", "ω'z", "px", "py", "pz")


MOST_AXES: int = native.RATE_MOST_AXES
Sensor = native.RateSensor
"""Constants of a layout with a noise, n axes, of which m combinations c see the products.

    W         (12, n)  axes, and their biases, to [omega', c, p]; rows of c beyond m are zero
    M         (6, 6)   c = M z + bias
    SQ_alpha  (3, 6)   what z adds to the measured omega'; zero for the paper's cube
    SQ_force  (3, 6)   and to the measured p
    R_alpha   (3, 3)   (rad/s)^2)^2, one sample; R_p (m/s^2)^2
    R_c       (6, 6)   (rad/s)^4; identity where not used
    known     (6, 6)   M^T R_c^-1 M: information of one sample on the products, (rad/s)^-4
    drift     (12, 12) W W^T
    Q         (n, 6)   z of every axis, m; theta_b (n, 3), r_b (n, 3), m
    used      (n,)     0 for an excluded axis, else 1; limit (n,) largest reading, m/s^2
    basis     (9, 9)   rows turn [alpha_m, c_m] into uncorrelated numbers of variances spread (9,)
    feedback           SQ is not zero
    plain              M is the identity
"""


LEAST_NOISE = 1e-4  # m/s^2; a layout that says less has no noise by oversight


def axis_noise(layout: Layout) -> float:
    """Noise of one sample of one axis as the layout says it, m/s^2, RMS over its axes."""
    return max(LEAST_NOISE, float(np.sqrt(np.mean(layout.noise**2))))


def sensor(layout: Layout, sigma_axis: float | None = None, excluded: int = 0) -> Sensor:
    """Constants for noise sigma_axis (m/s^2, one sample of one axis; None: what the layout says);
    bit k of `excluded` takes axis k out.

    Raises GeometryError when the axes left do not see angular acceleration and specific force,
    naming what is unseen.
    """
    if layout.axes > MOST_AXES:
        raise GeometryError(f"layout {layout.name}: {layout.axes} axes, want at most {MOST_AXES}")
    sigma_axis = axis_noise(layout) if sigma_axis is None else sigma_axis
    used = np.array([0.0 if excluded >> k & 1 else 1.0 for k in range(layout.axes)])
    keep = np.nonzero(used)[0]
    S, B = np.zeros((6, layout.axes)), np.zeros((6, layout.axes))
    S[:, keep], b = _solve(layout, keep)
    m = len(b)
    B[:m, keep] = b
    M = _product(B, layout.Q)
    M[np.abs(M) < 1e-12] = 0.0
    plain = m == 6 and bool(np.abs(M - np.eye(6)).max() < 1e-9)
    SQ = _product(S, layout.Q)
    scale = np.abs(S).max() * np.abs(layout.Q).max(initial=0.0)
    W = np.vstack([S[:3], B, S[3:]])
    drift = _product(W, W.T)
    R = sigma_axis**2 * drift
    R_c = np.eye(6)
    R_c[:m, :m] = R[3 : 3 + m, 3 : 3 + m]
    quiet = R[:9, :9].copy()
    for k in range(3 + m, 9):
        quiet[k, k] = 1.0
    out = Sensor()
    out.n, out.m, out.plain = layout.axes, m, plain
    out.feedback = bool(np.abs(SQ).max(initial=0.0) > 1e-9 * scale)
    out.W, out.M, out.drift = W, np.eye(6) if plain else M, drift
    out.SQ_alpha, out.SQ_force = SQ[:3], SQ[3:]
    out.R_alpha, out.R_p, out.R_c = R[:3, :3], R[9:, 9:], R_c
    out.known = _product(M.T, native.solve_positive(R_c, M))
    out.Q, out.theta_b, out.r_b, out.used = layout.Q, layout.theta_b, layout.r_b, used
    out.limit = np.array([one.limit for one in layout.sensors])
    spread, directions = native.eigh(quiet)
    out.basis, out.spread = directions.T, spread
    return out


def _product(A: Array, B: Array) -> Array:
    """A B with the same bits on every processor."""
    return native.product(A, B)


def _solve(layout: Layout, keep: NDArray[np.int64]) -> tuple[Array, Array]:
    """S (6, n) and the rows of B (m, n) of the kept axes, solved with lengths in units of the
    layout's scale.
    """
    if not len(keep):
        raise GeometryError("no axis can be believed: check the wiring, the layout and the board")
    unit = np.array([layout.scale_m] * 3 + [1.0] * 3)
    J, Q = layout.J[keep] / unit, layout.Q[keep] / layout.scale_m
    left, sigma, right = native.svd(J)
    rank = int(np.sum(sigma > RANK_TOLERANCE * sigma.max(initial=0.0)))
    if rank < 6:
        raise GeometryError(
            f"layout {layout.name}: {len(keep)} accelerometer axes observe only {rank} of the 6"
            " unknowns (angular acceleration 3, specific force 3); unseen:"
            f" {_unseen(right.T[rank:])}: place axes off one plane and one line, four triads at"
            " corners that span a tetrahedron see everything"
        )
    S = _product(right / sigma, left.T) / unit[:, None]
    rest = Q - _product(left, _product(left.T, Q))  # what of z no omega' and p can explain
    U, s, V = native.svd(rest)
    m = int(np.sum(s > 1e-6))
    B = (U[:, :m] / s[:m]).T / layout.scale_m
    return S, _product(V, B) if m == 6 else B


def _unseen(directions: Array) -> str:
    """The combinations of omega' and p that no axis sees, in words."""
    said = []
    for row in directions:
        row = row / np.abs(row).max()
        said.append(
            " ".join(
                f"{v:+.2g} {name}" for v, name in zip(row, UNKNOWNS, strict=True) if abs(v) > 1e-6
            )
        )
    return "; ".join(said)


def carry_biases(old: Sensor, new: Sensor, bias: float) -> tuple[Array, Array]:
    """T (12, 12) and covariance (12, 12) with b_new = T b_old + what was not known of the axes
    (E-42).

    Axis biases of sigma `bias` (m/s^2), given what the old combinations say of them.
    """
    before, after = old.W, new.W
    U, sigma, V = native.svd(before.T)
    rank = int(np.sum(sigma > 1e-9 * sigma[0]))
    inverse = _product(U[:, :rank] / sigma[:rank], V[:, :rank].T)
    free = np.eye(old.n) - _product(inverse, before)
    return _product(after, inverse), bias**2 * _product(_product(after, free), after.T)
