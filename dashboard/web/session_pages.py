"""Pages of one recorded session, and of one device over its sessions."""

import json
from dataclasses import dataclass
from typing import Annotated
from urllib.parse import parse_qs

from fastapi import APIRouter, Query, Request
from fastapi.responses import HTMLResponse

from dashboard.web import api
from dashboard.web.auth import Role
from dashboard.web.front import Front, front_of
from dashboard.web.pages import SignedIn, barred, render
from dashboard.web.schemas import session_out
from dashboard.web.session_api import REPORT_FOLDER, find_session
from dashboard.web.trend import Point, Trend, draw
from sessions.export.export import FORMATS
from sessions.library.annotations import Annotations, read_annotations
from sessions.library.copied import read_copied
from sessions.recording.manifest import Manifest, SessionError
from sessions.report import photo

routes = APIRouter(include_in_schema=False)
NO_REPORT = {"verdict": "", "specification": "", "estimator": ""}  # of a file that says less

TRENDS = (
    ("accel_bias_x_mg", "equivalent bias x, mg"),
    ("accel_bias_y_mg", "equivalent bias y, mg"),
    ("accel_bias_z_mg", "equivalent bias z, mg"),
    ("scale_factor_error_ppm", "scale factor error, ppm"),
    ("rate_rms_z_dps", "RMS of ω_z, °/s"),
    ("angle_error_deg", "angle error at the end, deg"),
)


@dataclass(frozen=True)
class Completeness:
    """One topic's line of the certificate."""

    topic: str
    expected: int
    received: int
    repaired: int
    lost: int


@routes.get("/sessions/{session}")
def session_page(request: Request, session: str, who: SignedIn) -> HTMLResponse:
    front = front_of(request)
    info = find_session(front, session)
    now = api.recording_out(front)
    row = session_out(info, now.session if now.recording else "")
    manifest = _manifest(front, session)
    report = _report(front, session)
    return render(
        request,
        "session.html",
        who,
        row=row,
        manifest=manifest,
        annotations=_annotations(front, session),
        report=report,
        photo=_photo(front, session),
        completeness=_completeness(manifest),
        copied=read_copied(front.catalogue.root / session),
        formats=list(FORMATS),
        derived=parse_qs(front.views.of(who.name, "session")).get("derived", [""])[0],
        can_replay=front.replay is not None and not barred(front, who),
        can_change=who.role >= Role.operator,
        can_delete=who.role >= Role.admin,
    )


@routes.get("/trend")
def trend_page(
    request: Request, who: SignedIn, device: Annotated[str, Query(max_length=64)] = ""
) -> HTMLResponse:
    front = front_of(request)
    reports = [
        (row, report)
        for row in api.list_sessions(front)
        if (report := _report(front, row.id)) is not None
    ]
    devices = sorted({report["device"] for _, report in reports})
    device = device if device in devices else (devices[0] if devices else "")
    mine = sorted((r for r in reports if r[1]["device"] == device), key=lambda r: r[0].start_s)
    trends = []
    for name, label in TRENDS:
        points = [
            Point(row.id, row.start_s, value)
            for row, report in mine
            if (value := _figure(report, name)) is not None
        ]
        if points:
            trends.append(Trend(label, points, draw(points)))
    return render(
        request, "trend.html", who, device=device, devices=devices, trends=trends, reports=len(mine)
    )


def _figure(report: dict, name: str) -> float | None:
    """A figure of a report; None when it is not in it, or is no number."""
    figures = report.get("figures")
    value = figures.get(name) if isinstance(figures, dict) else None
    good = isinstance(value, float | int) and not isinstance(value, bool) and abs(value) < 1e300
    return float(value) if good else None


def _manifest(front: Front, session: str) -> Manifest | None:
    try:
        return front.catalogue.manifest(session)
    except SessionError:
        return None


def _annotations(front: Front, session: str) -> Annotations:
    try:
        return read_annotations(front.catalogue.root / session)
    except SessionError:
        return Annotations()


def _report(front: Front, session: str) -> dict | None:
    """The session's report as data; None when there is none, or none that can be read."""
    try:
        found = json.loads(
            (front.catalogue.root / session / REPORT_FOLDER / "report.json").read_text(
                encoding="utf-8"
            )
        )
    except (OSError, ValueError, RecursionError):
        return None
    whole = isinstance(found, dict) and isinstance(found.get("device"), str)
    return NO_REPORT | found if whole else None


def _photo(front: Front, session: str) -> str:
    """Digest of the photo of the unit; empty without one."""
    try:
        found = photo.read(front.catalogue.root / session)
    except OSError:
        return ""
    return "" if found is None else found.sha256


def _completeness(manifest: Manifest | None) -> list[Completeness]:
    rows = []
    for key, count in sorted(manifest.keys.items() if manifest else ()):
        received = count.messages - count.repeated
        name = "/".join(key.split("/")[1:])
        rows.append(Completeness(name, count.expected, received, count.repaired, count.lost))
    return rows
