"""REST: spectral density and Allan deviation of any curve of a recording between two moments."""

import math
from typing import Annotated, Any

import numpy as np
from fastapi import APIRouter, HTTPException, Query, Request

from dashboard.data.live import finite
from dashboard.web.api import SignedIn, reading_of
from dashboard.web.front import front_of
from logs.figures.sight import vouched
from logs.figures.spectrum import density, unbroken
from sessions.library.derived import derive
from sessions.report.stability import LEAST, allan_of

routes = APIRouter(prefix="/api")

Moment = Annotated[float | None, Query(description="s from the session's start")]


@routes.get(
    "/sessions/{session}/spectrum", summary="Spectral density and Allan deviation of a stretch"
)
def spectrum(
    request: Request,
    session: str,
    who: SignedIn,
    curve: Annotated[
        str, Query(max_length=500, description="a channel, or an expression over channels")
    ],
    begin: Moment = None,
    end: Moment = None,
) -> dict[str, Any]:
    """Of the longest part of the stretch that has no hole; `said` has what is to be known of it.

    409 while the recording is still being read, and for a curve that cannot be made of it.
    """
    curves, reading = reading_of(front_of(request), session)
    if curves is None or curves.coarse:
        why = reading.fault if reading is not None and reading.fault else "it is still being read"
        raise HTTPException(409, f"session {session}: {why}")
    [made] = derive(curves, [curve])
    if made.y is None:
        raise HTTPException(409, made.fault)
    t = curves.t
    first = -math.inf if begin is None or not math.isfinite(begin) else begin
    last = math.inf if end is None or not math.isfinite(end) else end
    inside = (t >= min(first, last)) & (t <= max(first, last))
    y, period = unbroken(t[inside], vouched(made.y, made.sight)[inside])
    if len(y) < LEAST:
        said = f"{len(y)} values without a hole; {LEAST} are needed: choose a longer stretch"
        return {"unit": made.unit, "said": said, "density": None, "allan": None}
    whole = all(line.low is line.mean for line in curves.lines.values())
    said = f"{len(y)} values without a hole, {len(y) * period:.4g} s at {1 / period:.4g} Hz"
    if not whole:
        said += f"; they are means over {curves.bin_s:.4g} s, so what is faster is not seen"
    f, p = density(y, period)
    seen = p > 0.0
    allan = allan_of(curve, y, period)
    return {
        "unit": made.unit,
        "said": said,
        "density": {"x": f[seen].tolist(), "y": np.sqrt(p[seen]).tolist()},
        "allan": allan
        and {
            "x": allan.tau.tolist(),
            "y": allan.deviation.tolist(),
            "random_walk": finite(allan.random_walk),
        },
    }
