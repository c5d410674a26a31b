"""One name, one colour: the table that every picture asks, and that nobody keeps a second one."""

import re
from itertools import combinations
from pathlib import Path

import pytest

from inertial.attitude.filters import ATTITUDES as ATTITUDE
from inertial.navigation.navigation import NAVIGATORS
from inertial.rate.estimators import VARIANTS
from logs.figures import names

ROOT = Path(__file__).resolve().parents[2]
GROUNDS = ("#FFFFFF", "#1B1E21")


def luminance(colour: str) -> float:
    parts = [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    linear = [v / 12.92 if v <= 0.04045 else ((v + 0.055) / 1.055) ** 2.4 for v in parts]
    return sum(w * v for w, v in zip((0.2126, 0.7152, 0.0722), linear, strict=True))


@pytest.mark.parametrize("colour", sorted({look.colour for look in names.LOOKS.values()}))
@pytest.mark.parametrize("ground", GROUNDS)
def test_a_curve_is_seen_on_white_and_on_dark(colour, ground):
    low, high = sorted((luminance(colour), luminance(ground)))
    assert (high + 0.05) / (low + 0.05) >= 3.0


@pytest.mark.parametrize("family", [tuple(VARIANTS), tuple(ATTITUDE)], ids=["rate", "attitude"])
def test_every_estimator_of_a_family_has_a_name_and_a_colour_of_its_own(family):
    assert all(name in names.LOOKS for name in family)
    for one, other in combinations(family, 2):
        assert names.estimator_colour(one) != names.estimator_colour(other)
        assert names.estimator_title(one) != names.estimator_title(other)


def test_a_colour_does_not_depend_on_who_else_is_there():
    for name in (*VARIANTS, *NAVIGATORS):
        assert names.estimator_colour(name) == names.estimator_colour(name, [name])
        if name in names.LOOKS:
            assert names.estimator_colour(name, NAVIGATORS) == names.estimator_colour(name)
    strangers = [f"own-{k}" for k in range(8)]
    assert len({names.estimator_colour(one, strangers) for one in strangers}) == 8


def test_a_rate_is_spelt_one_way_where_people_read():
    """deg/s stands in comments and in texts for programs only."""
    wrong = []
    for room in ("dashboard", "sessions", "inertial"):
        for path in sorted((ROOT / room).rglob("*")):
            if path.suffix not in (".js", ".html", ".py"):
                continue
            text = re.sub(r'""".*?"""', "", path.read_text(), flags=re.DOTALL)
            for line in text.splitlines():
                code = line.split("#")[0] if path.suffix == ".py" else line.split("//")[0]
                if "deg/s" in code and path.name not in (
                    "description.py",
                    "table.py",
                    "plausible.py",
                ):  # units of files
                    wrong.append(f"{path.name}: {line.strip()}")
    assert wrong == []


def test_nobody_keeps_a_table_of_his_own():
    keys = re.compile(r'"(?:products-ekf|least-squares|huber-nhc)"\s*:\s*["A-Z(]')
    kept = [
        p for room in ("dashboard", "sessions", "gyrofree") for p in (ROOT / room).rglob("*.py")
    ]
    assert [path for path in kept if keys.search(path.read_text())] == []
