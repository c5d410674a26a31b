"""A wrong setting is said from the data with the number that fits, a right one is never doubted."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from inertial.constants import GRAVITY
from inertial.doubts.axes import wirings
from inertial.doubts.watch import SettingsWatch
from inertial.layouts.catalogue import CUBE, find
from inertial.simulation.imperfect import MOUNTINGS, STEPS, device, table_run

BATCH = 10
SECONDS = 20.0


def watched(run, layout, *, readings=None, tacho=1.0, pulses=360, period=5):
    """The run's samples in batches and a tachometer report at 20 Hz, as a gateway sends them."""
    watch = SettingsWatch(layout)
    f_axis = run.readings if readings is None else readings
    angle, count = 0.0, 0
    for k in range(0, len(f_axis) - BATCH + 1, BATCH):
        for j in range(k, k + BATCH, period):
            rate = tacho * float(run.tacho[j])
            angle += abs(float(run.tacho[j])) * 0.01 * period
            count = int(angle * tacho / (2.0 * np.pi) * pulses)
            watch.tacho(float(run.t_s[j]), rate, count)
        watch.feed(run.t_s[k : k + BATCH], f_axis[k : k + BATCH])
    return watch.doubts()


@pytest.mark.parametrize("seed", range(50))
def test_an_imperfect_cube_is_never_doubted(seed):
    """20 mg, 2 %, 10 mrad, 0.5 mm; tilted, off the axis, mounted on any face."""
    layout = CUBE(0.05)
    profile = STEPS if seed % 2 else "published"
    mounting = MOUNTINGS[seed % len(MOUNTINGS)]
    centre = (0.22, 0.0, 0.0) if seed % 5 == 0 else (0.004, -0.003, 0.002)
    run = table_run(
        device(layout, seed), mounting, profile, seed, centre_b=centre, seconds=2 * SECONDS
    )
    assert watched(run, layout) == []


def told(layout, seed=1, **changes):
    run = table_run(device(CUBE(0.05), seed), profile=STEPS, seconds=SECONDS)
    doubts = watched(run, layout, **changes)
    assert len(doubts) == 1
    return doubts[0].text


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize(
    ("set_to", "truly"), [(100, 360), (360, 100), (360, 720), (60, 72), (24, 48)]
)
def test_wrong_pulses_per_revolution_are_said_with_those_that_fit(seed, set_to, truly):
    text = told(CUBE(0.05), seed, tacho=truly / set_to, pulses=set_to)
    assert "half side" not in text
    said = int(text.split("revolution: ")[1].split(" would fit")[0])
    assert abs(said - truly) <= 0.02 * truly
    assert f"{set_to} is set" in text


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("half_side", [0.025, 0.04, 0.06, 0.1, 0.2])
def test_a_half_side_that_does_not_fit_is_said_with_the_one_that_does(seed, half_side):
    text = told(CUBE(half_side), seed)
    assert "pulses" not in text
    said = float(text.split("half side: ")[1].split(" mm")[0])
    assert said == pytest.approx(50.0, rel=0.05)


@pytest.mark.parametrize(
    ("factor", "word"),
    [(1.0 / GRAVITY, "sends g"), (GRAVITY, "are taken for g"), (0.5, "2 times the scale")],
)
def test_gravity_of_another_unit_asks_for_the_scale(factor, word):
    layout = CUBE(0.05)
    run = table_run(device(layout, 3), profile=STEPS, seconds=SECONDS)
    (doubt,) = watched(run, layout, readings=run.readings * factor)
    assert doubt.subject == "gravity" and "counts or g?" in doubt.text and word in doubt.text


def test_every_simple_wiring_is_found_or_left_unsaid_but_never_named_wrongly():
    """One mistake each: every two axes exchanged, every sign, every two sensors."""
    layout = CUBE(0.05)
    runs = [
        table_run(device(layout, seed), MOUNTINGS[seed], STEPS, seed, seconds=SECONDS)
        for seed in range(3)
    ]
    simple = [wiring for wiring in wirings(layout) if wiring.effort == 1]
    named = set()
    for run, wiring in product(runs, simple):
        # what is its own inverse: one mistake made twice is none
        wrong = run.readings[:, list(wiring.source)] * np.array(wiring.sign)
        for doubt in watched(run, layout, readings=wrong):
            assert doubt.subject == "axes", (wiring.text, doubt.text)
            if "would fit" in doubt.text:
                assert wiring.text in doubt.text, (wiring.text, doubt.text)
                named.add(wiring.text)
    # of the others the readings about one axis are alike: they are said not to fit, or harmless
    assert len(named) >= 0.7 * len(simple), (len(named), len(simple))


@pytest.mark.parametrize("name", ["chen-6", "nine", "edges-12", "stars-12"])
def test_other_layouts_are_never_doubted_for_what_they_do_not_see(name):
    layout = find(name, 0.05)
    run = table_run(device(layout, 5), profile=STEPS, seconds=SECONDS)
    assert watched(run, layout) == []


def test_a_drifting_cube_and_a_hole_in_the_data_say_nothing():
    layout = CUBE(0.05)
    run = table_run(device(layout, 7), profile=STEPS, seconds=2 * SECONDS)
    drift = np.linspace(0.0, 0.3, len(run.t_s))[:, None]
    assert watched(run, layout, readings=run.readings + drift) == []
    holes = np.concatenate([np.arange(0, 700), np.arange(950, 1500), np.arange(1800, 4000)])
    cut = replace(run, t_s=run.t_s[holes], readings=run.readings[holes], tacho=run.tacho[holes])
    assert watched(cut, layout) == []
