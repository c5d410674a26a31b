"""The guard's own process, given the table's description as JSON and its port; see guard.py."""

import os
import select
import sys
import time

from sessions.procedure.driven.description import Description, TableError
from sessions.procedure.driven.guard import ALIVE, HANGS_S, LET_GO
from sessions.procedure.driven.table import TextTable

TRIES, AGAIN_S = 20, 0.5


def stop(table: TextTable, why: str) -> bool:
    """Stop it, again and again where it does not take it."""
    for _ in range(TRIES):
        try:
            table.stop()
        except TableError as error:
            print(f"ERROR {why}; the table did not take the stop: {error}", file=sys.stderr)
            time.sleep(AGAIN_S)
        else:
            print(f"WARNING {why}: {table.name} was stopped", file=sys.stderr, flush=True)
            return True
        finally:
            table.close()
    return False


def watch(source: int, table: TextTable, hangs_s: float = HANGS_S) -> int:
    """Until the driver lets go, or is gone; the exit code."""
    hung = False
    while True:
        ready, _, _ = select.select([source], [], [], None if hung else hangs_s)
        if not ready:
            hung = stop(table, f"nothing from the procedures for {hangs_s:g} s")
            continue
        said = os.read(source, 4096)
        if LET_GO in said:
            return 0
        if not said:
            return 0 if stop(table, "the procedures are gone") else 1
        hung = hung and ALIVE not in said


if __name__ == "__main__":
    sys.exit(watch(0, TextTable(Description.model_validate_json(sys.argv[1]), sys.argv[2])))
