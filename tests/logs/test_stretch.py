"""What two cursors measure, against the definitions and a line that is known."""

import numpy as np
import pytest

from logs.figures.stretch import stretch


def test_a_line_gives_its_slope_and_its_ends():
    t = np.arange(0.0, 10.0, 0.01)
    found = stretch(t, 3.0 * t - 2.0, 2.0, 4.0)
    assert found["n"] == 201 and found["slope"] == pytest.approx(3.0)
    assert found["mean"] == pytest.approx(7.0) and found["p2p"] == pytest.approx(6.0)


def test_the_figures_are_those_of_numpy_and_holes_do_not_count():
    rng = np.random.default_rng(3)
    t, y = np.sort(rng.uniform(0, 10, 500)), rng.normal(2.0, 0.5, 500)
    y[::7] = np.nan
    at = (t >= 1.0) & (t <= 9.0) & np.isfinite(y)
    found = stretch(t, y, 1.0, 9.0)
    assert found["n"] == at.sum()
    assert found["mean"] == pytest.approx(y[at].mean())
    assert found["sigma"] == pytest.approx(y[at].std(ddof=1))
    assert found["rms"] == pytest.approx(np.sqrt(np.mean(y[at] ** 2)))
    assert found["slope"] == pytest.approx(np.polyfit(t[at], y[at], 1)[0])


@pytest.mark.parametrize("n", [0, 1, 2])
def test_what_few_samples_do_not_tell_is_not_said(n):
    found = stretch(np.zeros(n), np.ones(n), -1.0, 1.0)
    assert found["n"] == n and found["slope"] is None  # at one moment
    assert (found["mean"] is None) == (n == 0) and (found["sigma"] is None) == (n < 2)
