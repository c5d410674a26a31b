"""Small factorisations of the core against numpy's."""

import numpy as np
import pytest

from inertial.core import native

RNG = np.random.default_rng(3)


@pytest.mark.parametrize("shape", [(12, 6), (6, 6), (24, 6), (4, 6), (9, 3)])
def test_singular_values_and_vectors_give_the_matrix_back(shape):
    A = RNG.normal(size=shape)
    U, sigma, V = native.svd(A)
    expected = np.linalg.svd(A, compute_uv=False)
    n = len(expected)
    np.testing.assert_allclose(sigma[:n], expected, rtol=1e-12)
    np.testing.assert_allclose(sigma[n:], 0.0, atol=1e-12)
    np.testing.assert_allclose((U * sigma) @ V.T, A, atol=1e-12)
    np.testing.assert_allclose(V.T @ V, np.eye(shape[1]), atol=1e-12)
    np.testing.assert_allclose(U[:, :n].T @ U[:, :n], np.eye(n), atol=1e-10)


def test_a_direction_that_is_not_there_has_no_size():
    A = RNG.normal(size=(12, 6))
    A[:, 5] = A[:, 0] - 2.0 * A[:, 1]
    _, sigma, V = native.svd(A)
    assert sigma[5] < 1e-13 * sigma[0]
    np.testing.assert_allclose(A @ V[:, 5], 0.0, atol=1e-12)


@pytest.mark.parametrize("n", [1, 3, 9])
def test_eigenvalues_and_vectors_of_a_symmetric_matrix(n):
    root = RNG.normal(size=(n, n))
    A = root + root.T
    values, vectors = native.eigh(A)
    np.testing.assert_allclose(values, np.linalg.eigvalsh(A), atol=1e-12)
    np.testing.assert_allclose((vectors * values) @ vectors.T, A, atol=1e-12)


def test_equal_eigenvalues_keep_their_directions():
    values, vectors = native.eigh(2.0 * np.eye(4))
    assert (values == 2.0).all() and (vectors == np.eye(4)).all()
