"""The faults that `make test` has time for, one after the other; `make faults` does all."""

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
from support.far_link import NoNamespaces

from faults.account import account
from faults.all import SCENARIOS
from faults.bench import Bench
from faults.disk import Device, NoDevice
from faults.far import FarBench
from faults.ground import Ground
from faults.of_sites import SITE
from faults.scenario import Scenario, run
from messages.bus.pulse import UP
from messages.bus.session import subscribe
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import BEAT

BENCHES = {  # by kind
    "": Bench,
    "site": lambda folder: Bench(folder, site=SITE),
    "device": lambda folder: Bench(folder, disk=Device),
    "far": FarBench,
}


EVERY = sorted(
    (one for part in SCENARIOS.values() for one in part),
    key=lambda one: list(BENCHES).index(one.on),
)


class Benches:
    """One at a time, of the kind that a scenario takes, begun when it is needed."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._kind = folder, ""
        self._open = ExitStack()
        self._bench: Ground | None = None

    def of(self, kind: str) -> Ground:
        """Raises NoNamespaces, NoDevice where it cannot be made here."""
        if self._bench is None or kind != self._kind:
            self.close()
            self._kind = kind
            made = BENCHES[kind](self._folder / (kind or "plain"))
            self._bench = self._open.enter_context(made)
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
    try:
        bench = benches.of(scenario.on)
    except (NoNamespaces, NoDevice) as error:
        pytest.skip(f"cannot be done here: {error}")
    why_not = scenario.needs(bench)
    if why_not:
        pytest.skip(why_not)
    measured = run(bench, scenario)
    record_property("well_s", round(measured.well_s, 1))
    record_property("missing", measured.account.missing)
    record_property("unnamed", measured.unnamed)


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
    bench.until(lambda: sum(bench.watch.durable.values()) > 100, "a recording with something in it")
    bench.stop_up()
    assert bench.ended == 0
    made = account(bench.sessions.path, list(bench.watch.recording), bench.watch.durable)
    assert made.samples and made.complete and not made.acknowledged_lost
