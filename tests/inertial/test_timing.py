"""One answer to "is a sample missing?", whatever the stamps are like."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from inertial.timing import TimingError, sample_timing, straight

DRAWS = st.integers(0, 2**31)


def rows(draw, n=4000):
    return np.random.default_rng(draw), np.arange(n)


@settings(max_examples=60, deadline=None)
@given(DRAWS, st.sampled_from([25.0, 100.0, 400.0, 800.0, 900.0, 3200.0]), st.floats(-1e5, 1.7e9))
def test_nothing_is_missing_where_nothing_is(draw, rate, start):
    random, k = rows(draw)
    times = {
        "even": k / rate,
        "whole ms": np.floor(k / rate * 1e3) / 1e3 if rate < 950 else k / rate,
        "whole us": np.floor(k / rate * 1e6) / 1e6,
        "jitter": (k + random.uniform(-0.4, 0.4, len(k))) / rate,
        "drift": k / rate * (1.0 + 1e-4),
    }
    for name, t in times.items():
        if start > 1e6 and rate > 1000.0:
            continue  # Unix time in float64 has steps of 0.24 us: fine, but not what is tested here
        got = sample_timing(start + t)
        assert got.missing == 0, name
        assert got.period_s == pytest.approx(1.0 / rate, rel=5e-4), name
        np.testing.assert_array_equal(got.index, k)


@settings(max_examples=60, deadline=None)
@given(DRAWS, st.sampled_from([0.005, 0.05, 0.3]), st.sampled_from([0.0, 0.05, 0.1]))
def test_lost_samples_are_counted_and_the_others_keep_their_numbers(draw, loss, jitter):
    random, k = rows(draw)
    kept = random.uniform(size=len(k)) >= loss
    kept[[0, -1]] = True
    t = ((k + jitter * random.uniform(-1.0, 1.0, len(k))) * 0.01)[kept]
    got = sample_timing(t)
    np.testing.assert_array_equal(got.index, k[kept])
    assert got.missing == len(k) - kept.sum()
    assert sum(hole.missing for hole in got.holes) == got.missing


@given(DRAWS, st.integers(5, 2000))
@settings(max_examples=40, deadline=None)
def test_a_hole_costs_its_length_and_nothing_beside_it(draw, length):
    random, k = rows(draw)
    at = int(random.integers(500, 3000))
    kept = (k < at) | (k >= at + length)
    for t in (k * 0.01, np.floor(k * 1.25) / 1e3, (k + random.uniform(-0.3, 0.3, len(k))) * 0.01):
        got = sample_timing(t[kept])
        assert abs(got.missing - min(length, len(k) - at)) <= (
            1 if at + length < len(k) else length
        )
        if at + length < len(k):
            assert [hole.row for hole in got.holes] == [at]


def test_every_tenth_lost_and_bursts():
    k = np.arange(3000)
    got = sample_timing((k * 0.01)[k % 10 != 3])
    assert got.missing == 300 and got.period_s == pytest.approx(0.01)
    burst = sample_timing(np.floor(k / 5) * 0.05 + (k % 5) * 1e-4)
    assert burst.missing == 0 and burst.period_s == pytest.approx(0.01, rel=1e-3)


def test_times_that_do_not_rise_are_named_by_row():
    with pytest.raises(TimingError, match=r"does not rise \(2 such rows\)") as caught:
        sample_timing(np.array([0.0, 0.1, 0.1, 0.3, 0.2]))
    assert caught.value.row == 2
    with pytest.raises(TimingError, match="at least two"):
        sample_timing(np.array([1.0]))


@pytest.mark.parametrize("bits", [16, 24, 32])
@pytest.mark.parametrize("unit_s", [1e-6, 1e-3])
@pytest.mark.parametrize("rate", [100.0, 800.0, 1600.0])
@pytest.mark.parametrize("start", [0.1, 0.97])
def test_a_counter_that_begins_anew_changes_no_time(bits, unit_s, rate, start):
    n = np.arange(3000)
    count = np.rint((n + 1) / rate / unit_s) + start * 2**bits
    whole = count * unit_s
    t, said = straight(np.mod(count, 2**bits) * unit_s)
    ends = int(count[-1] // 2**bits) - int(count[0] // 2**bits)
    if np.min(np.diff(whole)) <= 0.0:
        return  # more samples than the counter has steps: another test
    np.testing.assert_allclose(np.diff(t), np.diff(whole), atol=1e-5)
    assert bool(said) == bool(ends)
    if ends:
        assert f"{bits} bits" in said[0] and sample_timing(t).missing == 0


@pytest.mark.parametrize("burst", [2, 8, 32])
@pytest.mark.parametrize("jitter", [0.0, 0.02])
def test_bursts_of_one_stamp_are_spread_evenly(burst, jitter):
    rng, period = np.random.default_rng(burst), 1.0 / 800.0
    read = (np.arange(200) + rng.normal(0.0, jitter, 200) + 1.0) * burst * period + 7.123456789
    true = 7.123456789 + (np.arange(200 * burst) + 1) * period
    t, said = straight(np.repeat(read, burst))
    assert f"up to {burst} in a row" in said[0]
    assert np.abs(t - true).max() < (1e-9 if jitter == 0.0 else 5.0 * jitter * burst * period)
    timing = sample_timing(t)
    assert timing.period_s == pytest.approx(period, rel=0.01) and timing.missing == 0
    lost = np.delete(np.repeat(read, burst), slice(10 * burst, 30 * burst))
    assert sample_timing(straight(lost)[0]).missing == pytest.approx(20 * burst, abs=burst / 4)


def test_rows_that_repeat_rows_are_named_and_others_are_never_thrown_away():
    t = np.sort(np.concatenate([np.arange(500) * 0.01 + 1e-7 * np.arange(500), [2.00002, 3.00003]]))
    equal = np.concatenate([[False], np.diff(t) == 0.0])
    assert equal.sum() == 2
    with pytest.raises(TimingError, match="repeat the row before in every column: remove"):
        straight(t, equal)
    spread, said = straight(t, np.zeros(len(t), bool))
    assert "2 samples have the time of the one before" in said[0] and (np.diff(spread) > 0.0).all()


@pytest.mark.parametrize("rows", [5000, 6000, 7000])
def test_a_log_set_behind_another_is_no_counter_that_begins_anew(rows):
    t = np.concatenate([np.arange(rows), np.arange(5000)]) * 0.01
    assert straight(t)[1] == ()
    with pytest.raises(TimingError, match="sort the rows by time"):
        sample_timing(straight(t)[0])
