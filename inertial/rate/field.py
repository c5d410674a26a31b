"""The acceleration field of a turning rigid body, from its accelerometers.

    a(r) = p + A r,   A = W' + W W,   W = [omega x], W' = [omega' x]                         (E-4)

Twelve axes that see all of it give omega', p and the six products w_i w_j linearly. The paper's
cube (25), (26) is written out beside the general solution. SI; body frame b.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inertial.layouts.layout import PRODUCTS, Layout

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Field:
    """One sample's field."""

    alpha_b: Array  # omega', rad/s^2, (3,)
    f_b: Array  # specific force p of the centre, m/s^2, (3,)
    products: Array  # w_i w_j, (rad/s)^2, (6,): xx xy xz yy yz zz

    @property
    def gradient(self) -> Array:
        """A = W' + W W, 1/s^2, (3, 3) (E-4)."""
        x, y, z = self.alpha_b
        outer = outer_product(self.products)
        return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]) + outer - np.trace(outer) * np.eye(3)


def solve(layout: Layout, f_axis: Array) -> Field:
    """Least-squares field of axis readings (N,), m/s^2 (E-4).

    Raises GeometryError when the layout does not see all twelve unknowns, ValueError for readings
    that are not N finite numbers.
    """
    x = layout.field_inverse @ checked(layout, f_axis)
    return Field(x[:3], x[3:6], x[6:])


def checked(layout: Layout, f_axis: Array) -> Array:
    """Axis readings as a float array (N,); ValueError names what is wrong."""
    f_axis = np.ascontiguousarray(f_axis, dtype=np.float64)
    if f_axis.shape != (layout.axes,):
        raise ValueError(
            f"axis readings {f_axis.shape}, want ({layout.axes},) of layout {layout.name}"
        )
    finite = np.isfinite(f_axis)
    if not finite.all():
        axis = int(np.argmin(finite))
        raise ValueError(
            f"axis {axis + 1} of layout {layout.name} reads {f_axis[axis]}, want a finite number"
        )
    return f_axis


def outer_product(six: Array) -> Array:
    """omega omega^T (3, 3) of the six products."""
    outer = np.zeros((3, 3))
    outer[PRODUCTS] = six
    outer.T[PRODUCTS] = six
    return outer


def cube_specific_force(a: Array) -> Array:
    """p of the paper's cube from a11 a12 a13 a21 ... a43, (12,), the paper's (25)."""
    a11, a12, a13, a21, a22, a23, a31, a32, a33, a41, a42, a43 = a
    return np.array([-a12 + a22 + a32 - a42, a11 - a21 + a31 - a41, a13 + a23 - a33 - a43]) / 4.0


def cube_angular_acceleration(a: Array, side: float) -> Array:
    """omega' of the paper's cube of side L (m), the paper's (26)."""
    a11, a12, a13, a21, a22, a23, a31, a32, a33, a41, a42, a43 = a
    return np.array(
        [
            -a11 - a13 + a21 + a23 + a31 + a33 - a41 - a43,
            -a12 - a13 + a22 + a23 - a32 - a33 + a42 + a43,
            a11 - a12 + a21 - a22 - a31 + a32 - a41 + a42,
        ]
    ) / (4.0 * side)


def field_from_triads(r_b: Array, a_b: Array) -> Field:
    """The field of four or more triads at r_b (n, 3) that read a_b (n, 3), both in b, by section 6
    of the source:

    A = (sum a r^T) (sum r r^T)^-1, W' its skew part, omega omega^T = WW - trace(WW)/2 I. For
    positions that sum to zero.
    """
    A = (a_b.T @ r_b) @ np.linalg.inv(r_b.T @ r_b)
    WW = 0.5 * (A + A.T)
    outer = WW - 0.5 * np.trace(WW) * np.eye(3)
    alpha_b = 0.5 * np.array([A[2, 1] - A[1, 2], A[0, 2] - A[2, 0], A[1, 0] - A[0, 1]])
    return Field(alpha_b, a_b.mean(axis=0), outer[PRODUCTS])
