"""Elementary functions and products with the same bits on every processor; numbers or arrays.

numpy's own sin, its kin, `@`, dot and linalg choose their code by what the processor can do, and
the variants differ in the last bit. What is published live or replayed uses these instead: the
core's functions, and sums whose order is written here. numpy's + - * / and sqrt are safe.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from inertial.core import native

Array = NDArray[np.float64]


def sin(x: ArrayLike) -> Array:
    """Sine of x, rad."""
    return _applied(native.sin, x)


def cos(x: ArrayLike) -> Array:
    """Cosine of x, rad."""
    return _applied(native.cos, x)


def tan(x: ArrayLike) -> Array:
    """Tangent of x, rad."""
    return _applied(native.tan, x)


def asin(x: ArrayLike) -> Array:
    """Inverse sine, rad; x beyond +-1 counts as +-1."""
    return _applied(native.asin, x)


def acos(x: ArrayLike) -> Array:
    """Inverse cosine, rad; x beyond +-1 counts as +-1."""
    return _applied(native.acos, x)


def exp(x: ArrayLike) -> Array:
    """e to the x."""
    return _applied(native.exp, x)


def log(x: ArrayLike) -> Array:
    """Natural logarithm."""
    return _applied(native.log, x)


def atan2(y: ArrayLike, x: ArrayLike) -> Array:
    """Angle of the point (x, y), rad, in (-pi, pi]; y and x of shapes that fit each other."""
    if isinstance(y, float | int) and isinstance(x, float | int):
        return native.atan2(float(y), float(x))
    return native.atan2(*np.broadcast_arrays(np.asarray(y, np.float64), np.asarray(x, np.float64)))


def dot(a: ArrayLike, b: ArrayLike) -> Array:
    """Sum of a_i b_i over the last axis, term 0 first."""
    terms = np.multiply(a, b)
    total = terms[..., 0]
    for i in range(1, terms.shape[-1]):
        total = total + terms[..., i]
    return total


def norm(a: ArrayLike) -> Array:
    """Length over the last axis."""
    return np.sqrt(dot(a, a))


def product(A: ArrayLike, B: ArrayLike) -> Array:
    """A B of matrices (..., n, k) and (..., k, m), the inner sum from term 0 on."""
    A, B = np.asarray(A, np.float64), np.asarray(B, np.float64)
    total = A[..., :, 0, None] * B[..., None, 0, :]
    for k in range(1, A.shape[-1]):
        total = total + A[..., :, k, None] * B[..., None, k, :]
    return total


def applied(A: ArrayLike, v: ArrayLike) -> Array:
    """A v of matrices (..., n, k) and vectors (..., k)."""
    return dot(A, np.asarray(v, np.float64)[..., None, :])


def _applied(function, x: ArrayLike) -> Array:
    if isinstance(x, float | int):
        return function(float(x))
    return function(np.asarray(x, dtype=np.float64))
