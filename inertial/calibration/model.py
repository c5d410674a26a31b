"""What an uncalibrated axis reads at rest and on a turning table, with the Jacobian of all unknowns
(E-150 to E-153).

    m_i = c_i . f(r_i) + b_i            c_i = scale_i times sensing direction, b_i bias
    (E-150) pose j:   f = g u_j                 u_j unit vector up, in b
    (E-151) table k:  f = g U(t) + w' a x (r + d) + w^2 a x (a x (r + d))
    (E-152)
              U = C up - S (a x up) + (1 - C) a (a . up),   C, S = mean cos, sin of the angle turned

a: table axis in b, up: upward at angle 0, d: from the axis to the body's centre. Axes at one place
share r. A common turn of all c, r, u, a changes nothing that is measured, nor does a common shift
of r against d: the frame is the one in which sum theta0 x c = 0, the centre the one in which sum (r
- r0) = 0 (E-153). SI, body frame b.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from inertial.layouts.layout import Layout

Array = NDArray[np.float64]

MOUNTING = 7  # unknowns of one mounting: axis 2, up 2, d 3
STEP = 1e-6  # of the differences by which the seven are differentiated


@dataclass(frozen=True)
class Parameters:
    """All unknowns. N axes at S places, M poses, K mountings on the table."""

    b: Array  # (N,) m/s^2
    c: Array  # (N, 3), scale times direction
    r: Array  # (S, 3) m
    u: Array  # (M, 3) unit vectors
    a: Array  # (K, 3) unit vectors
    up: Array  # (K, 3) unit vectors
    d: Array  # (K, 3) m

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return 4 * len(self.b) + 3 * len(self.r) + 2 * len(self.u) + MOUNTING * len(self.a)


@dataclass(frozen=True)
class Steps:
    """One mounting of the body on the turning table: means over blocks (n) of samples."""

    mean: Array  # (n, N) m/s^2
    samples: NDArray[np.int64]  # (n,)
    cos: Array  # (n,) mean cosine of the angle turned
    sin: Array
    rate2: Array  # (n,) mean of w^2, (rad/s)^2
    alpha: Array  # (n,) mean of w', rad/s^2
    alpha_sigma: Array  # (n,) its uncertainty


@dataclass(frozen=True)
class Poses:
    """Means of M standstills."""

    mean: Array  # (M, N) m/s^2
    samples: NDArray[np.int64]  # (M,)
    scatter: Array  # (M,) m/s^2, RMS over the axes


def places(layout: Layout) -> tuple[NDArray[np.int64], Array]:
    """Place of every axis (N,) and the nominal position of every place (S, 3), m: axes of a triad
    share theirs.
    """
    rounded = np.round(layout.r_b, 9) + 0.0
    _, first, place = np.unique(rounded, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty(len(order), dtype=np.int64)
    rank[order] = np.arange(len(order))
    return rank[place.ravel()], layout.r_b[first[order]]


def tangent(u: Array) -> Array:
    """Two unit vectors across u, as columns (3, 2)."""
    other = np.eye(3)[np.argmin(np.abs(u))]
    first = np.cross(u, other)
    first /= np.linalg.norm(first)
    return np.column_stack([first, np.cross(u, first)])


def moved(u: Array, delta: Array) -> Array:
    """Unit vector u moved by delta (2,) rad in its tangent plane."""
    v = u + tangent(u) @ delta
    return v / np.linalg.norm(v)


def apply(p: Parameters, x: Array) -> Parameters:
    """Parameters after the step x (size,), in the order b, c, r, u, mountings."""
    n, s, m = len(p.b), len(p.r), len(p.u)
    parts = np.split(x, np.cumsum([n, 3 * n, 3 * s, 2 * m]))
    u = np.array([moved(v, d) for v, d in zip(p.u, parts[3].reshape(-1, 2), strict=True)]).reshape(
        -1, 3
    )
    new = replace(
        p, b=p.b + parts[0], c=p.c + parts[1].reshape(-1, 3), r=p.r + parts[2].reshape(-1, 3), u=u
    )
    for k, seven in enumerate(parts[4].reshape(-1, MOUNTING)):
        new = _mounted(new, k, seven)
    return new


def _mounted(p: Parameters, k: int, seven: Array) -> Parameters:
    a, up, d = p.a.copy(), p.up.copy(), p.d.copy()
    a[k], up[k], d[k] = moved(p.a[k], seven[:2]), moved(p.up[k], seven[2:4]), p.d[k] + seven[4:]
    return replace(p, a=a, up=up, d=d)


def read_poses(p: Parameters, gravity: float) -> Array:
    """(M, N) m/s^2 (E-151)."""
    return gravity * p.u @ p.c.T + p.b


def pose_jacobian(p: Parameters, j: int, gravity: float) -> Array:
    """d readings of pose j / d unknowns, (N, size)."""
    n = len(p.b)
    H = np.zeros((n, p.size))
    rows = np.arange(n)
    H[rows, rows] = 1.0
    for axis in range(3):
        H[rows, n + 3 * rows + axis] = gravity * p.u[j, axis]
    first = 4 * n + 3 * len(p.r) + 2 * j
    H[:, first : first + 2] = gravity * p.c @ tangent(p.u[j])
    return H


def field(p: Parameters, k: int, steps: Steps, gravity: float) -> Array:
    """Mean specific force at every place of mounting k, (n, S, 3) m/s^2 (E-152)."""
    a, up = p.a[k], p.up[k]
    U = (
        np.outer(steps.cos, up)
        - np.outer(steps.sin, np.cross(a, up))
        + np.outer(1.0 - steps.cos, a * (a @ up))
    )
    across = np.cross(a, p.r + p.d[k])
    inward = np.cross(a, across)
    return (
        gravity * U[:, None, :]
        + steps.alpha[:, None, None] * across[None, :, :]
        + steps.rate2[:, None, None] * inward[None, :, :]
    )


def read_steps(p: Parameters, k: int, steps: Steps, place: Array, gravity: float) -> Array:
    """(n, N) m/s^2 (E-150, E-152)."""
    return np.einsum("ni,tni->tn", p.c, field(p, k, steps, gravity)[:, place, :]) + p.b


def steps_jacobian(p: Parameters, k: int, steps: Steps, place: Array, gravity: float) -> Array:
    """d readings of mounting k / d unknowns, (n, N, size)."""
    n, axes, s = len(steps.mean), len(p.b), len(p.r)
    H = np.zeros((n, axes, p.size))
    f = field(p, k, steps, gravity)
    a = p.a[k]
    A = np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])
    for i in range(axes):
        H[:, i, i] = 1.0
        H[:, i, axes + 3 * i : axes + 3 * i + 3] = f[:, place[i], :]
        first = 4 * axes + 3 * place[i]
        H[:, i, first : first + 3] = np.outer(steps.alpha, p.c[i] @ A) + np.outer(
            steps.rate2, p.c[i] @ A @ A
        )
    first = 4 * axes + 3 * s + 2 * len(p.u) + MOUNTING * k
    for column in range(MOUNTING):
        e = STEP * np.eye(MOUNTING)[column]
        ahead, back = _mounted(p, k, e), _mounted(p, k, -e)
        difference = read_steps(ahead, k, steps, place, gravity) - read_steps(
            back, k, steps, place, gravity
        )
        H[:, :, first + column] = difference / (2.0 * STEP)
    return H


def gauge(p: Parameters, theta0: Array, r0: Array) -> tuple[Array, Array]:
    """What must be zero, (6,), and its Jacobian (6, size): frame and centre are those of the
    nominal layout (E-153).
    """
    n = len(p.b)
    H = np.zeros((6, p.size))
    for i in range(n):
        x, y, z = theta0[i]
        H[0:3, n + 3 * i : n + 3 * i + 3] = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]) / n
    for s in range(len(r0)):
        H[3:6, 4 * n + 3 * s : 4 * n + 3 * s + 3] = np.eye(3) / len(r0)
    value = np.concatenate([np.cross(theta0, p.c).mean(axis=0), (p.r - r0).mean(axis=0)])
    return value, H
