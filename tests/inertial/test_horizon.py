"""The predictive estimator against its other two forms, its limits, and the fuzzy rules
(inmotion-alignment, 12).
"""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from inertial.core import navigation as core
from inertial.navigation import fuzzy
from inertial.navigation.filters import ARRIVALS

Array = NDArray[np.float64]
n, MOVING = 15, 9


@pytest.fixture(scope="module")
def epochs() -> dict[str, Array]:
    """Twelve legs between fixes of a filter-like size: Phi near one, small Q, position and velocity
    measured.
    """
    draw = np.random.default_rng(7)
    k = 12
    Phi = np.eye(n) + 0.1 * draw.normal(size=(k, n, n)) * (draw.random((k, n, n)) < 0.3)
    Phi[:, MOVING:] = 0.0  # biases only decay
    Phi[:, range(MOVING, n), range(MOVING, n)] = draw.uniform(0.8, 1.0, size=(k, n - MOVING))
    root = 0.05 * draw.normal(size=(k, n, n))
    H = np.zeros((k, 7, n))
    H[:, 0:3, 6:9] = np.eye(3)
    H[:, 3:6, 3:6] = np.eye(3)
    R = np.zeros((k, 7, 7))
    R[:, range(6), range(6)] = [0.5, 0.5, 1.0, 0.1, 0.1, 0.2]
    y = np.zeros((k, 7))
    y[:, :6] = draw.normal(size=(k, 6))
    start = 0.3 * draw.normal(size=(n, n))
    return {
        "Phi": Phi,
        "Q": root @ root.transpose(0, 2, 1) + 1e-4 * np.eye(n),
        "H": H,
        "R": R,
        "y": y,
        "P": start @ start.T + 0.1 * np.eye(n),
        "c": 0.1 * draw.normal(size=(k, n)),
    }


def filled(e: dict[str, Array], count: int):
    """The core's window with the first fixes of e in it."""
    window = core.new_window(n, core.CAPACITY)
    window.P0 = window.kalman = e["P"]
    for k in range(count):
        Phi = core.Transition(upper=e["Phi"][k][:MOVING], decay=np.diag(e["Phi"][k]))
        z = core.Measurement(y=e["y"][k][:6], H=e["H"][k][:6], R=e["R"][k][:6, :6])
        window.push(Phi, e["Q"][k], z, window.kalman)
        newest(window).applied = e["c"][k]
        window.kalman_beside()
    return window


def newest(window):
    """The last fix of a window, and what the last pass made of it."""
    return window.of_last(1, 0)


def batch(e: dict[str, Array], last: int, N: int, P: Array) -> Array:
    """The horizon as one whitened least-squares problem, solved by QR."""
    ks = list(range(last - N + 1, last + 1))
    size = n * (N + 1)
    T, d = np.hstack([np.eye(n), np.zeros((n, n * N))]), np.zeros(n)
    rows, right = [np.linalg.inv(np.linalg.cholesky(P)) @ T], [np.zeros(n)]
    for j, k in enumerate(ks):
        pick = np.zeros((n, size))
        pick[:, n * (j + 1) : n * (j + 2)] = np.eye(n)
        if j:
            d = d - e["c"][ks[j - 1]]
        T, d = e["Phi"][k] @ T + pick, e["Phi"][k] @ d
        rows.append(np.linalg.inv(np.linalg.cholesky(e["Q"][k])) @ pick)
        right.append(np.zeros(n))
        white = np.linalg.inv(np.linalg.cholesky(e["R"][k][:6, :6])) @ e["H"][k][:6]
        rows.append(white @ T)
        right.append(
            np.linalg.inv(np.linalg.cholesky(e["R"][k][:6, :6]))
            @ (e["y"][k][:6] - e["H"][k][:6] @ d)
        )
    q, r = np.linalg.qr(np.vstack(rows))
    return T @ np.linalg.solve(r, q.T @ np.concatenate(right)) + d


def backward(e: dict[str, Array], last: int, N: int, P: Array) -> Array:
    """The dual form: an information-Riccati pass back, then the disturbances forward. Needs no
    inverse of P or Q.
    """
    ks = list(range(last - N + 1, last + 1))
    bar, before = [], np.zeros(n)
    for j, k in enumerate(ks):
        before = e["Phi"][k] @ (before - (e["c"][ks[j - 1]] if j else 0.0))
        bar.append(before)
    S, s, kept = np.zeros((n, n)), np.zeros(n), {}
    for j in reversed(range(N)):
        k = ks[j]
        H, R = e["H"][k][:6], e["R"][k][:6, :6]
        S = S + H.T @ np.linalg.solve(R, H)
        s = s + H.T @ np.linalg.solve(R, e["y"][k][:6] - H @ bar[j])
        A = np.linalg.inv(np.eye(n) + S @ e["Q"][k])
        kept[j] = A @ S, A @ s
        S, s = e["Phi"][k].T @ kept[j][0] @ e["Phi"][k], e["Phi"][k].T @ kept[j][1]
    hat = P @ np.linalg.solve(np.eye(n) + S @ P, s)
    for j, k in enumerate(ks):
        G, g = kept[j]
        w = e["Q"][k] @ (g - G @ e["Phi"][k] @ hat)
        hat = e["Phi"][k] @ hat + w
    return bar[-1] + hat


@pytest.mark.parametrize("N", [1, 2, 3, 5, 10])
def test_forward_backward_and_batch_are_one_estimate(epochs: dict[str, Array], N: int) -> None:
    window = filled(epochs, 12)
    window.forward(N, epochs["P"])
    end = newest(window)
    sigma = np.sqrt(np.diag(end.P_after))
    for other in (backward(epochs, 11, N, epochs["P"]), batch(epochs, 11, N, epochs["P"])):
        assert np.abs((end.after - other) / sigma).max() < 1e-9


@pytest.mark.parametrize("N", [1, 2, 5, 10])
def test_with_the_kalman_covariance_it_is_the_kalman_filter(
    epochs: dict[str, Array], N: int
) -> None:
    """Corrections are the filter's own, so that the states at the arrival have mean 0."""
    e = dict(epochs)
    e["c"] = np.zeros_like(epochs["c"])
    P = e["P"].copy()
    for k in range(12):
        P = e["Phi"][k] @ P @ e["Phi"][k].T + e["Q"][k]
        H, R = e["H"][k][:6], e["R"][k][:6, :6]
        K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
        e["c"][k] = K @ e["y"][k][:6]
        P = P - K @ H @ P
    window = filled(e, 12)
    assert np.allclose(window.kalman, P, atol=1e-10)
    window.forward(N, window.arrival(N, ARRIVALS["kf"], 1.0))
    end = newest(window)
    assert np.abs((end.after - e["c"][11]) / np.sqrt(np.diag(P))).max() < 1e-9
    assert np.allclose(end.P_after, P, atol=1e-9)


def test_one_fix_without_motion_is_the_published_gain(epochs: dict[str, Array]) -> None:
    e = {key: value.copy() for key, value in epochs.items()}
    e["Phi"][:], e["Q"][:] = np.eye(n), 0.0
    window = filled(e, 1)
    window.forward(1, e["P"])
    H, R = e["H"][0][:6], e["R"][0][:6, :6]
    L1 = np.linalg.solve(
        np.linalg.inv(e["P"]) + H.T @ np.linalg.solve(R, H), H.T @ np.linalg.inv(R)
    )
    assert np.allclose(newest(window).after, L1 @ e["y"][0][:6], atol=1e-12)


def test_a_robust_horizon_doubts_the_one_gross_fix(epochs: dict[str, Array]) -> None:
    e = {key: value.copy() for key, value in epochs.items()}
    e["y"] *= 0.3
    e["c"][:] = 0.0
    clean = filled(e, 10)
    clean.forward(10, e["P"])
    truth = newest(clean).after
    e["y"][6, 0] += 40.0
    window = filled(e, 10)
    window.forward(10, e["P"])
    wrong = np.abs(newest(window).after - truth).max()
    window.robust(10, e["P"], 2.5, 5)
    better = np.abs(newest(window).after - truth).max()
    assert better < 0.3 * wrong
    scale = np.array([window.of_last(10, j).scale for j in range(10)])
    assert scale[6, 0] < 0.1 and scale[[0, 1, 2, 9], 0].min() > 0.5


RULES = fuzzy.FuzzyRules()


@pytest.mark.parametrize(
    ("force", "rate", "N"),
    [(9.8, 0.0, 2), (9.8, 1.0, 4), (10.2, 0.2, 6), (12.0, 0.0, 8), (12.0, 1.0, 10)],
)
def test_corners_of_the_rules(force: float, rate: float, N: int) -> None:
    assert fuzzy.fixes(fuzzy.horizon(force, rate, RULES)) == N


@given(st.floats(9.0, 12.0), st.floats(0.0, 0.8), st.floats(0.0, 1.0), st.floats(0.0, 0.3))
def test_a_stronger_manoeuvre_never_shortens_the_horizon(
    force: float, rate: float, df: float, dw: float
) -> None:
    here = fuzzy.horizon(force, rate, RULES)
    assert 2.0 <= here <= 10.0
    assert fuzzy.horizon(force + df, rate, RULES) >= here - 1e-12
    assert fuzzy.horizon(force, rate + dw, RULES) >= here - 1e-12


def test_rules_file_is_the_default_and_faults_are_named(tmp_path: Path) -> None:
    assert fuzzy.read_rules() == fuzzy.FuzzyRules()
    for text, word in (
        ("force_mps2 = [1, 2]\nrate_radps = [1, 2, 3]", "force_mps2"),
        ("force_mps2 = [3, 2, 1]", "rising"),
        ("speed = 3", "speed"),
        (
            (
                "force_mps2 = [1, 2, 3]\nrate_radps = [1, 2, 3]\nrules = [[1, 2, 3], [4, 5, 6], [7,"
                " 8, 10]]"
            ),
            "0 to 9",
        ),
    ):
        file = tmp_path / "rules.toml"
        file.write_text(text)
        with pytest.raises(fuzzy.FuzzyError, match=word):
            fuzzy.read_rules(file)
