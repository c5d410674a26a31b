"""`make faults`: every fault and every proof, then the tables of docs/faults.md.

    python tests/faults/run.py [--only TEXT ...] [--own]

--only: faults whose name has one of the TEXTs; --own: not the tests of other rooms.
"""

import argparse
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]

import pytest  # noqa: E402

from faults import table  # noqa: E402
from faults.all import PROOFS  # noqa: E402

LATEST = 4000  # characters of what failed


class Book:
    """A plugin that keeps what each fault came to."""

    def __init__(self, only: list[str]) -> None:
        """only: texts of which names must have one; none for all."""
        self._only = only
        self.times: dict[str, str] = {}
        self.unnamed: dict[str, tuple[str, ...]] = {}

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """Only those that are wanted."""
        if self._only:
            items[:] = [item for item in items if any(text in item.name for text in self._only)]

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """One report of a test."""
        name = report.nodeid.partition("[")[2].removesuffix("]")
        found = dict(report.user_properties)
        if report.when == "call" and report.passed and "well_s" in found and name:
            self.times[name] = f"{found['well_s']:.1f} s"
            self.unnamed[name] = found["unnamed"]
        elif report.failed:  # at once: the whole run takes a quarter of an hour
            print(f"\n{report.longreprtext[-LATEST:]}", flush=True)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", default=[], nargs="+", help="faults whose name has this text")
    parser.add_argument("--own", action="store_true", help="not the tests of other rooms")
    options = parser.parse_args()
    own = [str(ROOT / "tests" / "faults" / "test_faults.py")]
    others = [] if options.own or options.only else proofs()
    words = ["-v", "-m", "faults or not faults", "-p", "no:cacheprovider", "--rootdir", str(ROOT)]
    book = Book(options.only)
    code = pytest.main([*words, *own, *others], plugins=[book])
    if code in (pytest.ExitCode.OK, pytest.ExitCode.TESTS_FAILED):
        table.write(book.times)
        for name, alarms in book.unnamed.items():
            if alarms:
                print(f"{name}: there were also the alarms {', '.join(alarms)}")
        print(f"{len(book.times)} faults measured; the tables of {table.PAGE} are written anew")
    return int(code)


def proofs() -> list[str]:
    """Tests of other rooms, each once."""
    return sorted({str(ROOT / "tests" / name) for one in PROOFS for name in one.tests})


if __name__ == "__main__":
    sys.exit(main())
