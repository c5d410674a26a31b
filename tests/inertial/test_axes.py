"""Guided axis detection: a virtual analogue board of any wiring is turned by hand, and the wiring
must come out.
"""

import itertools

import numpy as np
import pytest

from inertial.attitude.axes import Unclear, assign

PERIOD = 0.01
NAMES = ("accel_x", "accel_y", "accel_z", "gyro_xz", "gyro_yz")


def board(
    angle_xz: np.ndarray,
    angle_yz: np.ndarray,
    wiring: tuple[int, ...],
    signs: tuple[int, ...],
    seed: int,
):
    """(n, 6) counts: R along x = sin Axz and so on, gyros their rates; one input is left open."""
    draw = np.random.default_rng(seed)
    R = np.column_stack([np.sin(angle_xz), np.sin(angle_yz), np.cos(angle_xz) * np.cos(angle_yz)])
    rates = np.gradient(np.column_stack([angle_xz, angle_yz]), PERIOD, axis=0)
    physical = np.column_stack(
        [2048 + 594 * R * np.array(signs[:3]), 1526 + 142 * rates * np.array(signs[3:])]
    )
    counts = np.full((len(angle_xz), 6), 900.0)
    counts[:, list(wiring)] = physical
    return np.rint(counts + draw.normal(size=counts.shape) * 3.0)


def by_hand(seed: int, size: float = 1.45, wobble: float = 0.06) -> tuple[np.ndarray, np.ndarray]:
    """Angle of the turn meant, and the wobble of a hand about the other axis, rad."""
    draw = np.random.default_rng(seed)
    t = np.arange(0.0, 3.0, PERIOD)
    x = np.clip((t - 0.8) / 1.2, 0.0, 1.0)
    ramp = x * x * (3.0 - 2.0 * x)
    return size * ramp, wobble * np.sin(np.pi * ramp) * draw.choice([-1.0, 1.0])


@pytest.mark.parametrize("seed", range(6))
def test_any_wiring_is_found(seed):
    draw = np.random.default_rng(seed)
    wiring = tuple(draw.permutation(6)[:5].tolist())
    signs = tuple(draw.choice([-1, 1], size=5).tolist())
    meant, wobble = by_hand(seed)
    found = assign(
        board(meant, wobble, wiring, signs, 1), board(wobble, meant, wiring, signs, 2), PERIOD
    )
    for name, channel, sign in zip(NAMES, wiring, signs, strict=True):
        said = getattr(found, name)
        assert (said.channel, said.invert) == (channel, sign < 0), name


def test_all_signs_of_the_acc_gyro_board():
    meant, wobble = by_hand(0)
    for signs in itertools.product((-1, 1), repeat=5):
        wiring = (0, 1, 2, 3, 4)
        found = assign(
            board(meant, wobble, wiring, signs, 1), board(wobble, meant, wiring, signs, 2), PERIOD
        )
        assert tuple(-1 if getattr(found, name).invert else 1 for name in NAMES) == signs
    assert "gyro_xz = { channel = 3, invert = false }" in found.toml()


@pytest.mark.parametrize(
    ("first", "second", "complaint"),
    [
        ((0.0, 0.0), (0.0, 1.4), "no input changed in the turn about y"),
        ((1.4, 0.0), (1.4, 0.0), "want three|same input"),
        ((1.4, 1.3), (0.0, 1.4), "moved alike|same input"),
    ],
)
def test_movements_that_tell_nothing_are_to_be_repeated(first, second, complaint):
    meant, _ = by_hand(0, size=1.0)
    wiring, signs = (0, 1, 2, 3, 4), (1, 1, 1, 1, 1)
    turns = [board(a * meant, b * meant, wiring, signs, 1) for a, b in (first, second)]
    with pytest.raises(Unclear, match=complaint):
        assign(*turns, PERIOD)


def test_a_movement_without_rest_is_refused():
    meant, wobble = by_hand(0)
    counts = board(meant, wobble, (0, 1, 2, 3, 4), (1, 1, 1, 1, 1), 1)
    with pytest.raises(Unclear, match="hold the board still"):
        assign(counts[60:], counts, PERIOD)
    with pytest.raises(Unclear, match="1.0 s recorded"):
        assign(counts[:100], counts, PERIOD)
