"""Copying and filling inside compiled code: plain loops, because slices cost seconds of compile
time each.
"""

from numba import njit
from numpy.typing import NDArray


@njit(cache=True)
def copy1(source: NDArray, target: NDArray) -> None:
    """target := source, vectors of one length."""
    for i in range(source.shape[0]):
        target[i] = source[i]


@njit(cache=True)
def copy2(source: NDArray, target: NDArray) -> None:
    """target := source, matrices of one shape."""
    for i in range(source.shape[0]):
        for j in range(source.shape[1]):
            target[i, j] = source[i, j]


@njit(cache=True)
def fill1(a: NDArray, value: float) -> None:
    """a := value everywhere."""
    for i in range(a.shape[0]):
        a[i] = value


@njit(cache=True)
def fill2(a: NDArray, value: float) -> None:
    """a := value everywhere."""
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            a[i, j] = value


@njit(cache=True)
def identity(a: NDArray) -> None:
    """a := unit matrix."""
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            a[i, j] = 0.0
        a[i, i] = 1.0


@njit(cache=True)
def add(target: NDArray, source: NDArray, n: int) -> None:
    """Add the first n rows and columns of a matrix to those of target."""
    for i in range(n):
        for j in range(n):
            target[i, j] += source[i, j]
