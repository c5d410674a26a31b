"""What two cursors measure, against the definitions and a line that is known."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from logs.figures.numbers import with_half_width
from logs.figures.sight import WORDS, vouched, word
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


@given(hnp.arrays(float, 40, elements=st.sampled_from([0.0, 1.0, 2.0, 7.0, np.nan])), st.data())
def test_what_an_estimator_does_not_vouch_for_is_in_no_figure(sight, data):
    """Whatever stands at those samples, the figures are the same, and one says how many count."""
    t, y = np.arange(40.0), np.sin(np.arange(40.0))
    found = stretch(t, y, 0.0, 40.0, sight)
    unsure = sight > 0
    assert found["of"] == 40 and found["n"] == 40 - unsure.sum()
    assert (found["word"] in WORDS[1:]) == unsure.any()
    assert (found["mean"] is None) == unsure.all()
    wild = data.draw(st.sampled_from([np.nan, np.inf, 1e30, -5.0]))
    other = stretch(t, np.where(unsure, wild, y), 0.0, 40.0, sight)
    assert {k: v for k, v in other.items() if k != "of" and k != "word"} == {
        k: v for k, v in found.items() if k != "of" and k != "word"
    }
    assert np.isnan(vouched(y, sight)).tolist() == unsure.tolist()


def test_every_sight_has_a_word_and_what_is_not_said_has_none():
    assert [word(k) for k in (0, 1, 2, 3, np.nan)] == ["", "ambiguous", "blind", "blind", ""]


def test_a_number_has_no_digits_below_its_uncertainty():
    assert with_half_width(0.00201, 0.0014) == "0.0020 ± 0.0014"
    assert with_half_width(-0.1784, 0.192) == "−0.18 ± 0.19"
    assert with_half_width(171.03, 12.0) == "171 ± 12"
    assert with_half_width(4.358, np.nan) == "4.36"
