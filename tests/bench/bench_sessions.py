"""What one waits for with sessions: report of a table run, exports, the list of 500 sessions. One line of JSON.

    python tests/bench/bench_sessions.py
"""

import json
import shutil
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from table_session import SESSION, table_recording, table_root

from sessions.catalogue import Catalogue
from sessions.export import FORMATS, export
from sessions.report.build import build
from sessions.report.verdict import load_spec


def seconds(work) -> float:
    """Wall time of one call."""
    begin = time.perf_counter()
    work()
    return round(time.perf_counter() - begin, 2)


def main() -> dict:
    """The figures, by name; s."""
    path = table_recording()
    result: dict = {"bench": "sessions", "recording_MB": round(path.stat().st_size / 1e6, 2)}
    result["report_s"] = seconds(lambda: build(path, load_spec(None)))
    with tempfile.TemporaryDirectory() as scratch:
        for form in FORMATS:
            if form not in ("kml", "gpx"):  # this one has no track
                result[f"export_{form}_s"] = seconds(lambda form=form: export(path, form, Path(scratch) / form))
        root = Path(scratch) / "sessions"
        for k in range(500):
            folder = root / f"20240101-{k:06d}"
            folder.mkdir(parents=True)
            (folder / "recording.mcap").write_bytes(b"")
            text = (table_root() / SESSION / "session.json").read_text().replace(SESSION, folder.name)
            (folder / "session.json").write_text(text)
        result["list_500_s"] = seconds(lambda: Catalogue(root).list())
        shutil.rmtree(root)
    return result


if __name__ == "__main__":
    print(json.dumps(main()))
