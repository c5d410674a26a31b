"""Inputs that once failed, from a folder outside of the project: $GYROFREE_CASES, else shared/cases
beside the checkout. `make cases` runs them; `make test` does not, as its result must not depend on
what lies beside the checkout.
"""

import pytest
from support import cases
from support.case_expectations import hold

NAMES = cases.names()
pytestmark = pytest.mark.cases


@pytest.mark.skipif(
    cases.cases_dir() is None,
    reason="no folder of cases: set GYROFREE_CASES, or put shared/cases beside the checkout",
)
@pytest.mark.parametrize("name", NAMES or ["none"])
def test_a_case_gives_what_is_right_or_says_what_is_wrong(name, tmp_path):
    hold(name, cases.run(name, tmp_path))


def test_a_folder_of_cases_that_is_there_is_run_whole():
    if cases.cases_dir() is not None:
        assert NAMES, f"{cases.cases_dir()}: no case in it"
