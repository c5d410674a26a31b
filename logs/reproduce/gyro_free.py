"""`gyrofree reproduce gyro-free`: the table test run, its figures drawn, its page written."""

import json
from pathlib import Path
from typing import Any

from logs.reproduce import gyro_free_pages as pages
from logs.reproduce.gyro_free_study import Progress, evaluate, recorded, simulated


def reproduce(
    out: Path,
    *,
    session: Path | None = None,
    seed: int = 1,
    progress: Progress = lambda done, what: None,
) -> dict[str, Any]:
    """Write pictures, result.json and index.html into `out` and return the JSON.

    session: CSV of a recorded run of the cube, else one is simulated from the seed. Raises
    LogError, OSError.
    """
    out = Path(out)
    out.mkdir(parents=True, exist_ok=True)
    progress(0.0, "session")
    found = recorded(session, progress) if session is not None else simulated(seed, progress)
    result = evaluate(found)
    progress(0.7, "drawing")
    result["figures"] = pages.draw(out, found, result)
    (out / "result.json").write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")
    pages.write_index(out, result)
    progress(1.0, "done")
    return result
