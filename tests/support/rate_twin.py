"""The products filter's equations by whole matrices: twins of inertial/core/rate, for a reader.

Model and Jacobians: inertial/rate/products_model.py. Everything is dense and in the order of the
equations; nothing is left out because it is zero.
"""

import numpy as np

from inertial.rate import products_model as model
from inertial.rotation import from_rotation_vector, to_matrix

SPREAD = 3.0  # of the sigma points
ROUNDS, ENOUGH = 14, 0.2  # of the fit of a start while turning
GRAVITY = 9.80665


def SQ(s):
    """(6, 6): what the products add to the measured [omega'; p]."""
    return np.vstack([s.SQ_alpha, s.SQ_force])


def predict(x, P, alpha_m, s, dt, turning, fixed=False):
    """E-31 and E-32, on a fixed axis E-45; without noise."""
    y = model.transition(x, alpha_m, SQ(s), dt, turning)
    F = model.transition_jacobian(x, y, SQ(s), dt, turning)
    if fixed:
        omega = x[model.OMEGA]
        N = np.outer(omega, omega) / (omega @ omega)
        alpha = (y[model.OMEGA] - omega) / dt
        new = y.copy()
        new[model.OMEGA] = omega + dt * N @ alpha
        middle = 0.5 * (omega + new[model.OMEGA])
        C = to_matrix(from_rotation_vector(-dt * middle))
        new[model.U], new[model.TURNED] = C @ x[model.U], x[model.TURNED] + dt * middle[2]
        F = model.transition_jacobian(x, new, SQ(s), dt, turning)
        across = np.eye(3) - N
        F[model.OMEGA, model.OMEGA] += dt * (alpha @ omega) / (omega @ omega) * across
        F[model.OMEGA, model.B_ALPHA] = -dt * N
        y = new
    return y, F @ P @ F.T


def correct(x, P, H, C, e):
    """Kalman correction by the innovation e of covariance C: x, P, NIS, 1 / sqrt(det C)."""
    gain = P @ H.T @ np.linalg.inv(C)
    nis, density = e @ np.linalg.solve(C, e), np.exp(-0.5 * np.linalg.slogdet(C)[1])
    return x + gain @ e, P - gain @ H @ P, nis, density


def by_products(x, P, c_m, s):
    """E-33 and E-34, of a layout that sees all six combinations."""
    mean, spread = model.products_spread(P)
    H = model.measured_products_jacobian(x, s.M)
    e = c_m - model.measured_products(x, s.M) - s.M @ mean
    return correct(x, P, H, H @ P @ H.T + s.R_c + s.M @ spread @ s.M.T, e)


def by_force(x, P, p, alpha, late, s, t):
    """E-35 while turning: Jacobian by the mean omega' of late, prediction by that of now."""
    H = model.measured_force_jacobian(x, late, SQ(s))
    r, doubt, news = x[model.PIVOT], np.trace(P[model.PIVOT, model.PIVOT]), alpha - late
    noise = (r @ r + doubt) * s.R_alpha[0, 0] + doubt * (news @ news)
    C = H @ P @ H.T + s.R_p + (t.centre + noise) * np.eye(3)
    return correct(x, P, H, C, p - model.measured_force(x, alpha, SQ(s)))


def by_standstill(x, P, alpha_m, s, t):
    """E-38."""
    H, R = np.eye(6, model.STATES), np.zeros((6, 6))
    R[:3, :3], R[3:, 3:] = t.still_rate * np.eye(3), s.R_alpha
    e = np.concatenate([-x[model.OMEGA], alpha_m - x[model.B_ALPHA]])
    return correct(x, P, H, H @ P @ H.T + R, e)


# --- sigma points


def points(x, P, first):
    """Sigma points (45, 22) of all states; the root of P begins with the states `first`."""
    order = np.concatenate([first, np.setdiff1d(np.arange(len(x)), first)])
    L = np.zeros_like(P)
    L[order] = np.linalg.cholesky(P[np.ix_(order, order)])
    return np.vstack([x, x + np.sqrt(SPREAD) * L.T, x - np.sqrt(SPREAD) * L.T])


def moments(values, weights):
    """Mean and covariance of weighted points."""
    mean = weights @ values
    d = values - mean
    return mean, (weights[:, None] * d).T @ d


def weights(n):
    """Of 2 n + 1 points."""
    return np.concatenate([[1.0 - n / SPREAD], np.full(2 * n, 0.5 / SPREAD)])


def predict_unscented(x, P, alpha_m, s, dt):
    """E-31 through sigma points of all 22 states, turning (E-44)."""
    inside = np.array([0, 1, 2, 12, 13, 14, 3, 4, 5, 21])
    moved = [model.transition(p, alpha_m, SQ(s), dt, True) for p in points(x, P, inside)]
    return moments(np.array(moved), weights(model.STATES))


def by_products_unscented(x, P, c_m, s):
    """Correction by the products through sigma points of all 22 states (E-44)."""
    X = points(x, P, np.arange(3))
    Z, w = np.array([model.measured_products(p, s.M) for p in X]), weights(model.STATES)
    mean, C = moments(Z, w)
    C = C + s.R_c
    cross = (w[:, None] * (X - x)).T @ (Z - mean)
    gain, e = cross @ np.linalg.inv(C), c_m - mean
    nis, density = e @ np.linalg.solve(C, e), np.exp(-0.5 * np.linalg.slogdet(C)[1])
    return x + gain @ e, P - gain @ C @ gain.T, nis, density


# --- start while turning


class StartFit:
    """Most probable first state of samples y (n, 12), dt s apart, of a body that turns (E-46)."""

    def __init__(self, y, dt, s, t, prior, P):
        """prior (22,) and P (22, 22): what is known before any sample."""
        self.y, self.dt, self.s, self.t, self.prior = y, dt, s, t, prior
        self.know, self.alpha = np.linalg.inv(P), y[:, :3].mean(axis=0)

    def about(self, start):
        """Normal equations about a first state: N, g, misfit; the last state, its derivative."""
        s, t, n = self.s, self.t, len(self.y)
        u, away = start[model.U], start - self.prior
        N, g, misfit = self.know.copy(), -self.know @ away, away @ self.know @ away
        off, up = GRAVITY - np.linalg.norm(u), u / np.linalg.norm(u)
        misfit += off**2 / t.gravity
        g[model.U] += up * off / t.gravity
        N[model.U, model.U] += np.outer(up, up) / t.gravity
        R, arm = np.zeros((9, 9)), start[model.PIVOT] @ start[model.PIVOT]
        R[:6, :6] = s.R_c
        R[6:, 6:] = s.R_p + (t.centre + arm * s.R_alpha[0, 0] / n) * np.eye(3)
        x, moved = start, np.eye(model.STATES)
        for k, y in enumerate(self.y):
            if k:
                alpha, before = 0.5 * (y[:3] + self.y[k - 1, :3]), x
                x = model.transition(before, alpha, SQ(s), self.dt, True)
                moved = model.transition_jacobian(before, x, SQ(s), self.dt, True) @ moved
            free = self.alpha - x[model.B_ALPHA]
            H = np.vstack(
                [
                    model.measured_products_jacobian(x, s.M),
                    model.measured_force_jacobian(x, free, SQ(s)),
                ]
            )
            said = [model.measured_products(x, s.M), model.measured_force(x, free, SQ(s))]
            r, G = y[3:] - np.concatenate(said), H @ moved
            N += G.T @ np.linalg.solve(R, G)
            g += G.T @ np.linalg.solve(R, r)
            misfit += r @ np.linalg.solve(R, r)
        return N, g, misfit, x, moved

    def solve(self, first):
        """Damped rounds from `first`: the last state, its covariance before noise, log evidence."""
        start, best, damp, lowest = first, self.prior, 1e-3, np.inf
        size, pull = self.know, self.prior
        for round_ in range(1, ROUNDS + 1):
            N, g, misfit, x, moved = self.about(start)
            if misfit < lowest or round_ == ROUNDS:
                better, best, lowest, damp = lowest - misfit, start, misfit, 0.1 * damp
                if better < ENOUGH or round_ == ROUNDS:
                    break
                size, pull = N, g
            else:
                damp *= 10.0
            start = best + np.linalg.solve(size + damp * np.diag(np.diag(size)), pull)
            if round_ == ROUNDS - 1:
                start = best
        P = moved @ np.linalg.inv(N) @ moved.T
        return x, P, -0.5 * (misfit + np.linalg.slogdet(N)[1])
