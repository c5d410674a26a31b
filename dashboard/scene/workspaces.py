"""Workspaces: what a person is about, and which pages belong to it; what our page and the view of
one browser say to each other of them.

The view states itself as JSON in an element of its own, which the page around the scene reads; the
page asks in one line of the form of a link: `w=diagnose&p=health&device=cube&window=60`. So what a
link may ask is what a person may click.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import parse_qs

from dashboard.data.device import Device
from dashboard.scene.panels.base import Panel
from dashboard.scene.span import WINDOWS
from logs.figures.words import meaning

LAYERS = ("truth", "estimates", "sensors", "rate", "trajectory", "fixes", "ellipsoid", "grid")
MOST_FIELDS = 24


@dataclass(frozen=True)
class Workspace:
    """A room of the page; its pages are the panels that name it."""

    key: str
    title: str
    hint: str


WORKSPACES = (
    Workspace("watch", "Watch", "The big picture: what moves, and how fast"),
    Workspace("test", "Test", "A procedure step by step, to its report"),
    Workspace("diagnose", "Diagnose", "Axes, health, NIS, line and board"),
    Workspace("calibrate", "Calibrate", "Calibration, wiring, and the arrangement of the axes"),
    Workspace("navigate", "Navigate", "Position, map, horizon and errors"),
)


def pages_of(workspace: str, pages: Sequence[type[Panel]]) -> list[type[Panel]]:
    """The pages of a workspace in their order."""
    return [page for page in pages if page.workspace == workspace]


def offered(pages: Sequence[type[Panel]], device: Device) -> list[dict[str, Any]]:
    """What the kind and the state of a device offer: workspaces with their pages, and for each page
    why it is not there. Call under the store's lock.
    """
    found = []
    for room in WORKSPACES:
        of_it = [(page, page.missing(device)) for page in pages_of(room.key, pages)]
        there = [
            {"key": page.key(), "title": page.title, "hint": meaning(page.title)}
            for page, why in of_it
            if not why
        ]
        absent = [{"title": page.title, "why": why} for page, why in of_it if why]
        found.append(
            {
                "key": room.key,
                "title": room.title,
                "hint": room.hint,
                "pages": there,
                "absent": absent,
            }
        )
    return found


@dataclass(frozen=True)
class Wish:
    """What the page around the scene asks of one browser's view; None: as it is."""

    workspace: str | None = None
    page: str | None = None
    device: str | None = None
    prefer: str | None = None  # the device to begin with, unless a replay was just asked for
    window: str | None = None
    size: str | None = None  # of the page: s, n, m, l
    quality: str = ""  # key of pace.QUALITIES; empty: as it is
    dark: bool | None = None
    pause: bool | None = None
    follow: bool | None = None
    layers: frozenset[str] | None = None  # those shown
    cursors: tuple[float, float] | tuple[()] | None = None  # s on the device's axis; (): none
    zoom: tuple[float, float] | tuple[()] | None = None  # s since 1970; (): follow the data
    derived: str | None = None  # curves of one's own, as expression.many reads them
    do: tuple[str, ...] = field(default=())  # "camera", "play", "back", "on"

    @classmethod
    def of(cls, line: str) -> "Wish":
        """Read one line; what is not understood is left out."""
        try:
            fields = parse_qs(line, keep_blank_values=True, max_num_fields=MOST_FIELDS)
        except ValueError:
            return cls()
        given = {name: values[-1] for name, values in fields.items()}
        switch = {"0": False, "1": True}
        layers = given.get("layers")
        return cls(
            workspace=given.get("w"),
            page=given.get("p"),
            device=given.get("device"),
            prefer=given.get("prefer"),
            size=given.get("size"),
            quality=given.get("quality", ""),
            window=given["window"] if given.get("window") in WINDOWS else None,
            dark=switch.get(given.get("dark", "")),
            pause=switch.get(given.get("pause", "")),
            follow=switch.get(given.get("follow", "")),
            layers=None if layers is None else frozenset(layers.split(".")) & frozenset(LAYERS),
            cursors=_pair(given.get("cursors")),
            zoom=_pair(given.get("zoom"), decimals=4),
            derived=given.get("derived"),
            do=tuple(given.get("do", "").split(".")),
        )


def _pair(text: str | None, decimals: int = 9) -> tuple[float, float] | tuple[()] | None:
    """`from_until`, s; what is no such pair stands for none."""
    try:
        a, b = map(float, (text or "").split("_"))
    except ValueError:
        return None if text is None else ()
    if not abs(a) + abs(b) < 1e12:
        return ()
    return round(min(a, b), decimals), round(max(a, b), decimals)


def stated(**state: Any) -> str:
    """The view's state as the text of an attribute."""
    return json.dumps(state, separators=(",", ":"), ensure_ascii=False)
