"""The faults that `make test` has time for, one after the other; `make faults` does all."""

from collections.abc import Iterator

import pytest

from faults.all import SCENARIOS
from faults.bench import Bench
from faults.scenario import Scenario, run

EVERY = [one for part in SCENARIOS.values() for one in part]


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    with Bench(tmp_path_factory.mktemp("bench")) as running:
        yield running


@pytest.mark.parametrize(
    "scenario",
    [
        pytest.param(one, id=one.name, marks=() if one.quick else pytest.mark.faults)
        for one in EVERY
    ],
)
def test_a_fault_costs_what_it_may_and_is_said(
    bench: Bench, scenario: Scenario, record_property
) -> None:
    why_not = scenario.needs(bench)
    if why_not:
        pytest.skip(why_not)
    measured = run(bench, scenario)
    record_property("well_s", round(measured.well_s, 1))
    record_property("missing", measured.account.missing)


def test_an_orderly_end_is_quick_and_loses_nothing(bench: Bench, record_property) -> None:
    bench.watch.begin()
    bench.watch.record("orderly end")
    bench.until(lambda: bench.watch.recording, "recording")
    took_s = bench.stop_up()
    assert bench.ended == 0
    record_property("well_s", round(took_s, 1))
