"""The Cramer-Rao bound: more knowledge lowers it, the filter does not beat it, the live one follows
it.
"""

import numpy as np
import pytest

from inertial.layouts.catalogue import CUBE
from inertial.rate.bound import (
    IN_USE,
    SOURCE,
    SOURCE_STILL,
    Along,
    Knowledge,
    plot_bound,
    rate_bound,
    rms,
)
from inertial.rate.estimators import ProductsRate
from inertial.rate.products_ekf import Config
from inertial.simulation.table import SensorModel, TableTest

SECONDS = 20


@pytest.fixture(scope="module")
def truth():
    """20 s of the published test with calibrated sensors."""
    table = TableTest(1, sensor=SensorModel(bias=0.02, scale_error=0.0))
    blocks = [table.block(k) for k in range(SECONDS // 10)]
    names = ("t_s", "q_nb", "omega_b", "alpha_b", "readings")
    return table, {name: np.concatenate([getattr(b, name) for b in blocks]) for name in names}


def bound(truth, what):
    """Sigma (n, 3)."""
    table, data = truth
    return rate_bound(
        table.layout, data["t_s"], data["q_nb"], data["omega_b"], data["alpha_b"], what
    )


@pytest.fixture(scope="module")
def in_use(truth):
    return bound(truth, IN_USE)


def test_more_knowledge_lowers_the_bound(truth, in_use):
    by_knowledge = [
        rms(bound(truth, what)) for what in (SOURCE, SOURCE_STILL, Knowledge(gravity=True))
    ] + [rms(in_use)]
    for less, more in zip(by_knowledge, by_knowledge[1:], strict=False):
        assert (more <= less * 1.001).all()
    assert by_knowledge[0][2] > 2 * by_knowledge[1][2]  # when it stands is worth most


def test_published_figures_are_met_within_their_unknown_ramps(truth):
    """0.78 and 0.56 deg/s over 30 s with the knowledge of stillness; this is their first 20 s."""
    x, y, z = np.degrees(rms(bound(truth, SOURCE_STILL)))
    assert x == pytest.approx(y, rel=1e-6) and 0.6 < x < 1.1 and 0.4 < z < 0.8


def test_the_filter_comes_near_and_is_honest(truth, in_use):
    table, data = truth
    track = ProductsRate(table.layout, Config(scale=5e-4)).run_batch(data["t_s"], data["readings"])
    error = track.omega_b - data["omega_b"]
    over = np.sqrt(np.sum(np.mean(error**2, axis=0)) / np.sum(rms(in_use) ** 2))
    assert 0.5 < over < 2.0


def test_the_live_bound_follows_the_bound_along_the_truth(truth, in_use):
    table, data = truth
    live, seen = Along(table.layout), []
    assert live.sigma is None
    for k in range(1200):
        still = not data["omega_b"][k].any()
        live.step(data["omega_b"][k], data["alpha_b"][k], data["q_nb"][k], still, 0.01)
        seen.append(np.full(3, np.nan) if live.sigma is None else live.sigma)
    np.testing.assert_allclose(
        np.array(seen)[700:1200].mean(axis=0), in_use[700:1200].mean(axis=0), rtol=0.3
    )


def test_the_picture_is_drawn(truth, in_use, tmp_path):
    plot_bound(tmp_path / "bound.png", truth[1]["t_s"], in_use, np.zeros_like(in_use), "published")
    assert (tmp_path / "bound.png").read_bytes().startswith(b"\x89PNG")


def test_a_larger_cube_sees_better():
    table = TableTest(1, half_side=0.1)
    block = table.block(0)
    data = (block.t_s[400:800], block.q_nb[400:800], block.omega_b[400:800], block.alpha_b[400:800])
    large, small = (rms(rate_bound(CUBE(half), *data, SOURCE_STILL)) for half in (0.1, 0.05))
    assert (large < 0.7 * small).all()
