"""The page of faults says what the scenarios do, and no more."""

from collections import Counter

from faults.all import PROOFS, SCENARIOS
from faults.table import BEGIN, END, PAGE, ROOT, measured, tables


def test_the_page_is_made_of_the_scenarios_that_there_are():
    page = PAGE.read_text(encoding="utf-8")
    made = page.split(BEGIN)[1].split(END)[0].strip()
    assert made == tables(measured(page)), "run `make faults`"


def test_every_scenario_has_a_name_of_its_own_and_was_measured():
    names = [one.name for part in SCENARIOS.values() for one in part]
    assert max(Counter(names).values()) == 1
    times = measured(PAGE.read_text(encoding="utf-8"))
    assert [name for name in names if not times.get(name, "-")[0].isdigit()] == []


def test_every_proof_is_there():
    for one in PROOFS:
        for test in one.tests:
            file, _, name = test.partition("::")
            text = (ROOT / "tests" / file).read_text(encoding="utf-8")
            assert not name or f"def {name}(" in text, test


def test_what_is_lost_is_nothing_or_said():
    for part in SCENARIOS.values():
        for one in part:
            may_lose = one.lost.samples[1] > 0 or one.lost.gone > 0
            assert may_lose == (one.lost.text != "nothing"), one.name
