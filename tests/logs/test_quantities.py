"""Numbers of any unit become the same number in SI, to the bit."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from firmware_protocol.frames import SensorInfo
from gateway.samples.convert import axis_scales
from inertial.constants import from_mg
from logs.quantities import UNITS, to_si


@given(st.integers(0, 2**52), st.sampled_from([("ms", 3), ("us", 6), ("ns", 9), ("cm", 2)]))
def test_a_time_in_any_unit_is_the_time_that_is_written_in_seconds(number, unit):
    name, digits = unit
    text = str(number).rjust(digits + 1, "0")
    seconds = float(f"{text[:-digits]}.{text[-digits:]}")
    assert to_si(np.array([float(number)]), UNITS[name])[0] == seconds


@given(st.integers(1, 100_000))
def test_a_scale_from_the_wire_is_the_scale_of_a_log(hundredths):
    class Hello:  # the one field that is looked at
        sensors = (SensorInfo(scale_ng=hundredths * 10_000),)

    assert axis_scales(Hello, 1) == [from_mg(hundredths / 100)] * 3
