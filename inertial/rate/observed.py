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

from inertial.layouts.layout import RANK_TOLERANCE, GeometryError, Layout

Array = NDArray[np.float64]

UNKNOWNS = ("ω'x", "ω'y", "ω'z", "px", "py", "pz")


MOST_AXES = 32

# Constants of a layout with a noise; a record, which compiled functions take by reference. n axes
# are in use.
SENSOR = np.dtype(
    (
        np.record,
        [
            ("S", "f8", (6, MOST_AXES)),  # [omega'; p] of the axes
            ("B", "f8", (6, MOST_AXES)),  # the m observed combinations of the products, then zeros
            ("M", "f8", (6, 6)),  # those combinations of z
            ("SQ", "f8", (6, 6)),  # what z adds to S a; zero for the paper's cube
            ("W", "f8", (12, MOST_AXES)),  # axis biases to [b_alpha, b_c, b_f]
            ("R_alpha", "f8", (3, 3)),  # (rad/s^2)^2, one sample
            ("R_p", "f8", (3, 3)),  # (m/s^2)^2
            ("R_c", "f8", (6, 6)),  # (rad/s)^4; identity where not used
            (
                "known",
                "f8",
                (6, 6),
            ),  # M^T R_c^-1 M: information of one sample on the products, (rad/s)^-4
            ("drift", "f8", (12, 12)),  # W W^T
            ("Q", "f8", (MOST_AXES, 6)),  # z of every axis, m
            ("theta_b", "f8", (MOST_AXES, 3)),
            ("used", "f8", (MOST_AXES,)),  # 0 for an excluded axis, else 1
            ("basis", "f8", (9, 9)),  # rows turn [alpha_m, c_m] into uncorrelated numbers
            ("spread", "f8", (9,)),  # their variances
            ("n", "i8"),
            ("m", "i8"),
            ("feedback", "i8"),  # SQ is not zero
            ("plain", "i8"),  # M is the identity
        ],
    )
)
Sensor = np.record


def sensor(layout: Layout, sigma_axis: float, excluded: int = 0) -> Sensor:
    """Constants for noise sigma_axis (m/s^2, one sample of one axis); bit k of `excluded` takes
    axis k out.

    Raises GeometryError when the axes left do not see angular acceleration and specific force,
    naming what is unseen.
    """
    if layout.axes > MOST_AXES:
        raise GeometryError(f"layout {layout.name}: {layout.axes} axes, want at most {MOST_AXES}")
    used = np.array([0.0 if excluded >> k & 1 else 1.0 for k in range(layout.axes)])
    keep = np.nonzero(used)[0]
    S, B = np.zeros((6, layout.axes)), np.zeros((6, layout.axes))
    S[:, keep], b = _solve(layout, keep)
    m = len(b)
    B[:m, keep] = b
    M = B @ layout.Q
    M[np.abs(M) < 1e-12] = 0.0
    plain = m == 6 and bool(np.abs(M - np.eye(6)).max() < 1e-9)
    SQ = S @ layout.Q
    scale = np.abs(S).max() * np.abs(layout.Q).max(initial=0.0)
    feedback = bool(np.abs(SQ).max(initial=0.0) > 1e-9 * scale)
    W = np.vstack([S[:3], B, S[3:]])
    R = sigma_axis**2 * (W @ W.T)
    R_c = np.eye(6)
    R_c[:m, :m] = R[3 : 3 + m, 3 : 3 + m]
    whole = np.zeros((6, 6))
    whole[: len(M)] = M
    known = whole.T @ np.linalg.solve(R_c, whole)
    quiet = R[:9, :9].copy()
    for k in range(3 + m, 9):
        quiet[k, k] = 1.0
    spread, basis = np.linalg.eigh(quiet)
    out = np.zeros(1, SENSOR)[0]
    n = layout.axes
    for name, value in (("S", S), ("B", B), ("W", W)):
        out[name][:, :n] = value
    for name, value in (("Q", layout.Q), ("theta_b", layout.theta_b), ("used", used)):
        out[name][:n] = value
    for name, value in (
        ("M", np.eye(6) if plain else M),
        ("SQ", SQ),
        ("R_alpha", R[:3, :3]),
        ("R_p", R[9:, 9:]),
        ("R_c", R_c),
        ("known", known),
        ("drift", W @ W.T),
        ("basis", basis.T),
        ("spread", spread),
    ):
        out[name][:] = value
    out["n"], out["m"], out["feedback"], out["plain"] = n, m, feedback, plain
    return out


def _solve(layout: Layout, keep: NDArray[np.int64]) -> tuple[Array, Array]:
    """S (6, n) and the rows of B (m, n) of the kept axes, solved with lengths in units of the
    layout's scale.
    """
    unit = np.array([layout.scale_m] * 3 + [1.0] * 3)
    J, Q = layout.J[keep] / unit, layout.Q[keep] / layout.scale_m
    left, sigma, right = np.linalg.svd(J, full_matrices=True)
    rank = int(np.sum(sigma > RANK_TOLERANCE * sigma.max(initial=0.0)))
    if rank < 6:
        raise GeometryError(
            f"layout {layout.name}: {len(keep)} accelerometer axes observe only {rank} of the 6"
            " unknowns (angular acceleration 3, specific force 3); unseen:"
            f" {_unseen(right[rank:])}: place axes off one plane and one line, four triads at"
            " corners that span a tetrahedron see everything"
        )
    S = (right.T / sigma) @ left[:, :6].T / unit[:, None]
    rest = left[:, 6:].T
    U, s, V = np.linalg.svd(rest @ Q, full_matrices=False)
    m = int(np.sum(s > 1e-6)) if s.size else 0
    B = (U[:, :m] / s[:m]).T @ rest / layout.scale_m
    return S, V[:m].T @ B if m == 6 else B


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
    before, after = old.W[:, : old.n], new.W[:, : new.n]
    inverse = np.linalg.pinv(before, rcond=1e-9)
    free = np.eye(old.n) - inverse @ before
    return after @ inverse, bias**2 * after @ free @ after.T
