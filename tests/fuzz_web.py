"""A longer run of hostile requests than the tests have time for.

    python tests/fuzz_web.py [--examples 200]

Prints the answers by status; every fault of the server, and exit code 1 where there is one.
"""

import argparse
import shutil
import sys
import tempfile
from pathlib import Path

from support.front_door import open_door
from support.table_session import SESSION, table_root
from support.web_fuzz import fuzz


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--examples", type=int, default=200, help="of each kind and operation")
    examples = parser.parse_args().examples
    known = {"session": [SESSION], "device": ["cube"], "form": ["html"], "number": ["1"]}
    with tempfile.TemporaryDirectory() as folder:
        shutil.copytree(table_root(), Path(folder) / "sessions")
        with open_door(Path(folder), scene=False, free_attempts=100) as door:
            run = fuzz(door, "anna", known, examples)
    print(dict(sorted(run.codes.items())))
    for fault in run.faults:
        print(fault, file=sys.stderr)
    return 1 if run.faults else 0


if __name__ == "__main__":
    sys.exit(main())
