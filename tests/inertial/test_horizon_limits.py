"""Limits of the predictive estimator: no and all trust in its own past, and the published recursion
(25).
"""

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.inertial.test_horizon import epochs, filled, n, newest

Array = NDArray[np.float64]
__all__ = ["epochs"]  # the fixture of the tests beside


def measured(e: dict[str, Array], k: int) -> tuple[Array, Array, Array]:
    """H (6, n), R^-1 (6, 6) and y (6,) of fix k."""
    return e["H"][k][:6], np.linalg.inv(e["R"][k][:6, :6]), e["y"][k][:6]


def test_with_no_doubt_of_the_past_the_gain_is_l1_of_the_disturbance(epochs) -> None:  # noqa: F811
    """P -> 0, N = 1: x = A x + L1 (y - C A x), L1 = (Q^-1 + Sigma_0)^-1 C' R^-1; A x is 0 in the
    closed loop.
    """
    window = filled(epochs, 12)
    window.forward(1, 1e-14 * np.eye(n))
    end = newest(window)
    H, W, y = measured(epochs, 11)
    L1 = np.linalg.solve(np.linalg.inv(epochs["Q"][11]) + H.T @ W @ H, H.T @ W)
    np.testing.assert_allclose(end.after, L1 @ y, atol=1e-10)


@pytest.mark.parametrize("N", [2, 4])
def test_with_no_doubt_of_the_past_a_longer_horizon_starts_from_the_old_estimate(
    epochs, N: int
) -> None:  # noqa: F811
    """P -> 0: the state N fixes ago is 0 for sure, only the disturbances are free."""
    window = filled(epochs, 12)
    window.forward(N, 1e-14 * np.eye(n))
    end = newest(window)
    x, P = np.zeros(n), np.zeros((n, n))
    for k in range(12 - N, 12):
        x, P = epochs["Phi"][k] @ x, epochs["Phi"][k] @ P @ epochs["Phi"][k].T + epochs["Q"][k]
        H, W, y = measured(epochs, k)
        K = P @ H.T @ np.linalg.inv(H @ P @ H.T + np.linalg.inv(W))
        x, P = x + K @ (y - H @ x), P - K @ H @ P
        x = x - (epochs["c"][k] if k < 11 else 0.0)
    np.testing.assert_allclose(end.after, x, atol=1e-9)


@pytest.mark.parametrize("N", [5, 10])
def test_with_no_trust_in_the_past_only_the_horizon_counts(epochs, N: int) -> None:  # noqa: F811
    """P -> infinity: the finite-memory (FIR) estimate, least squares without an arrival term."""
    window = filled(epochs, 12)
    window.forward(N, 1e8 * np.eye(n))
    end = newest(window)
    size, ks = n * (N + 1), range(12 - N, 12)
    T, d, rows, right = np.hstack([np.eye(n), np.zeros((n, n * N))]), np.zeros(n), [], []
    for j, k in enumerate(ks):
        pick = np.zeros((n, size))
        pick[:, n * (j + 1) : n * (j + 2)] = np.eye(n)
        d = epochs["Phi"][k] @ (d - (epochs["c"][k - 1] if j else 0.0))
        T = epochs["Phi"][k] @ T + pick
        H, W, y = measured(epochs, k)
        white, root = np.linalg.cholesky(W).T, np.linalg.inv(np.linalg.cholesky(epochs["Q"][k]))
        rows += [root @ pick, white @ H @ T]
        right += [np.zeros(n), white @ (y - H @ d)]
    z, _, rank, _ = np.linalg.lstsq(np.vstack(rows), np.concatenate(right), rcond=None)
    assert rank == size  # so many fixes determine all states
    sigma = np.sqrt(np.diag(end.P_after))
    assert np.abs((end.after - (T @ z + d)) / sigma).max() < 1e-5


@pytest.mark.parametrize("N", [1, 3, 10])
def test_the_published_recursion_is_the_one_without_inverses(epochs, N: int) -> None:  # noqa: F811
    """(25) with Q^-1, backwards over the horizon with all corrections zero, then (24) forwards,
    gives `forward`.
    """
    e = dict(epochs) | {"c": np.zeros_like(epochs["c"])}
    window = filled(e, 12)
    window.forward(N, e["P"])
    end = newest(window)
    S, s, kept = np.zeros((n, n)), np.zeros(n), []
    for k in range(11, 11 - N, -1):
        H, W, y = measured(e, k)
        S, s = S + H.T @ W @ H, s + H.T @ W @ y
        gain = np.linalg.inv(np.linalg.inv(e["Q"][k]) + S)
        kept.append((gain, S, s))
        A, rest = e["Phi"][k], np.eye(n) - S @ gain
        np.testing.assert_allclose(
            rest @ S, np.linalg.solve(np.eye(n) + S @ e["Q"][k], S), rtol=1e-7, atol=1e-9
        )
        S, s = A.T @ (S - S @ gain @ S) @ A, A.T @ rest @ s
    hat = np.linalg.solve(np.linalg.inv(e["P"]) + S, s)
    for k, (gain, Sk, sk) in zip(range(12 - N, 12), reversed(kept), strict=True):
        carried = e["Phi"][k] @ hat
        hat = carried + gain @ (sk - Sk @ carried)
    sigma = np.sqrt(np.diag(end.P_after))
    assert np.abs((end.after - hat) / sigma).max() < 1e-8
