"""Which labels of the scene are shown, so that none lies on another: the weightier first."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import viser

# size of a label's box at font_screen_scale 1, px, as viser draws it, with a margin
CHARACTER, PADDING, HEIGHT = 7.2, 10.0, 22.0


@dataclass
class Placed:
    """A label and where it stands in the display frame."""

    handle: viser.LabelHandle
    position: np.ndarray  # (3,)
    shown: bool = True  # as far as the person's layers go


def pixels(camera: viser.CameraHandle, points: np.ndarray) -> np.ndarray | None:
    """Where points (n, 3) of the display frame are in the picture, (n, 2), px from its middle; NaN
    for those behind the camera. None while the camera is not known.
    """
    height = getattr(camera, "image_height", 0)
    if not height:
        return None
    position, look_at = np.asarray(camera.position), np.asarray(camera.look_at)
    ahead = look_at - position
    right = np.cross(ahead, np.asarray(camera.up_direction))
    if not math.hypot(*right) > 0.0:
        return None
    ahead, right = ahead / math.hypot(*ahead), right / math.hypot(*right)
    from_camera = points - position
    depth = from_camera @ ahead
    depth = np.where(depth > 1e-6, depth, np.nan)
    plane = np.stack([from_camera @ right, -from_camera @ np.cross(right, ahead)], axis=1)
    return plane / depth[:, None] * (0.5 * height / np.tan(camera.fov / 2.0))


def boxes(texts: Iterable[str], scales: Iterable[float]) -> np.ndarray:
    """Half widths and half heights (n, 2) of labels, px."""
    sizes = [
        ((CHARACTER * len(t) + PADDING) * s / 2.0, HEIGHT * s / 2.0)
        for t, s in zip(texts, scales, strict=True)
    ]
    return np.array(sizes).reshape(-1, 2)


def free(places: np.ndarray, halves: np.ndarray) -> list[bool]:
    """Which boxes about places (n, 2) with half sizes (n, 2) stand free of all shown before them;
    what has no place is free.
    """
    shown: list[int] = []
    found = []
    for k, place in enumerate(places):
        apart = (np.abs(places[shown] - place) > halves[shown] + halves[k]).any(axis=1)
        known = bool(np.isfinite(place).all())
        found.append(not known or bool(apart.all()))
        if known and found[-1]:
            shown.append(k)
    return found


def declutter(camera: viser.CameraHandle, labels: list[Placed]) -> None:
    """Show those that stand free, in the order given, and hide the others."""
    wanted = [label for label in labels if label.shown]
    if wanted:
        places = pixels(camera, np.array([label.position for label in wanted]))
        if places is not None:
            texts = [label.handle.text for label in wanted]
            scales = [label.handle.font_screen_scale for label in wanted]
            for label, good in zip(wanted, free(places, boxes(texts, scales)), strict=True):
                label.shown = good
    for label in labels:
        if label.handle.visible != label.shown:
            label.handle.visible = label.shown
