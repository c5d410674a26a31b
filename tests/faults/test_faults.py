"""The faults that `make test` has time for, one after the other; `make faults` does all."""

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from faults.account import account
from faults.all import SCENARIOS
from faults.bench import Bench
from faults.scenario import Scenario, run
from messages.bus.pulse import UP
from messages.bus.session import subscribe
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import BEAT

EVERY = [one for part in SCENARIOS.values() for one in part]


class Benches:
    """One at a time, without a site or with one, begun when it is needed."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._site = folder, ""
        self._open = ExitStack()
        self._bench: Bench | None = None

    def of(self, site: str) -> Bench:
        """That of this site; "" for none."""
        if self._bench is None or site != self._site:
            self.close()
            self._site = site
            folder = self._folder / (site or "bench")
            self._bench = self._open.enter_context(Bench(folder, site))
        return self._bench

    def close(self) -> None:
        """End what runs."""
        self._open.close()
        self._bench = None


@pytest.fixture(scope="module")
def benches(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Benches]:
    made = Benches(tmp_path_factory.mktemp("faults"))
    yield made
    made.close()


@pytest.mark.parametrize(
    "scenario",
    [
        pytest.param(one, id=one.name, marks=() if one.quick else pytest.mark.faults)
        for one in EVERY
    ],
)
def test_a_fault_costs_what_it_may_and_is_said(
    benches: Benches, scenario: Scenario, record_property
) -> None:
    bench = benches.of(scenario.site)
    why_not = scenario.needs(bench)
    if why_not:
        pytest.skip(why_not)
    measured = run(bench, scenario)
    record_property("well_s", round(measured.well_s, 1))
    record_property("missing", measured.account.missing)


def test_every_service_says_whether_its_work_goes_on(benches: Benches) -> None:
    """Its beats name a loop; the supervisor's, too, which has no session on the bus."""
    bench, heard = benches.of(""), dict[str, pb.Beat]()

    def take(_: str, beat: pb.Beat) -> None:
        heard[beat.role] = beat

    beats = subscribe(bench.watch.session, BEAT, bench.bus.prefix, take)
    wanted = {"router", "gateway", "estimator", "recorder", "procedures", "alarms", "dashboard", UP}
    bench.until(lambda: heard.keys() >= wanted, "a beat of everybody")
    beats.undeclare()
    assert not [role for role in wanted if not heard[role].loop or not heard[role].turn_most_s]


def test_an_orderly_end_is_quick_and_loses_nothing(benches: Benches) -> None:
    bench = benches.of("")
    bench.watch.begin()
    bench.watch.record("orderly end")
    bench.until(lambda: bench.watch.recording, "recording")
    bench.stop_up()
    assert bench.ended == 0
    made = account(bench.sessions.path, list(bench.watch.recording), bench.watch.durable)
    assert made.samples and made.complete and not made.acknowledged_lost
