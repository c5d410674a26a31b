"""A box seen from somewhere, for the pictures of how a board should lie: which faces, and where."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

EDGE_ON = 0.02  # cosine between a face's normal and the camera below which it is not drawn


@dataclass(frozen=True)
class Face:
    """One visible face of a box."""

    axis: int  # 0 to 2 of the body
    sign: float  # 1.0 or -1.0: on which side of it
    points: str  # corners, as an SVG polygon wants them
    middle: tuple[float, float]  # on the picture


@dataclass(frozen=True)
class Camera:
    """Looks along -towards, without perspective; `right` and `over` span the picture (unit
    vectors of the frame that R turns into), `middle` is where the origin is drawn.
    """

    towards: np.ndarray
    right: np.ndarray
    over: np.ndarray
    middle: tuple[float, float]
    scale: float

    @classmethod
    def at(
        cls, place: np.ndarray, up: np.ndarray, middle: tuple[float, float], scale: float
    ) -> "Camera":
        """From `place` towards the origin, with `up` upwards in the picture."""
        towards = place / np.linalg.norm(place)
        right = np.cross(up, towards)
        right /= np.linalg.norm(right)
        return cls(towards, right, np.cross(towards, right), middle, scale)

    def screen(self, p: np.ndarray) -> tuple[float, float]:
        """Where a point is on the picture; y grows downwards there."""
        x, y = self.middle
        return x + self.scale * float(self.right @ p), y - self.scale * float(self.over @ p)

    def faces(self, R: np.ndarray, half: np.ndarray) -> Iterator[Face]:
        """Visible faces of a box of half sides `half` (3,), turned by R (3, 3)."""
        for axis in range(3):
            for sign in (1.0, -1.0):
                normal = sign * np.eye(3)[axis]
                if float((R @ normal) @ self.towards) <= EDGE_ON:
                    continue
                a, b = np.eye(3)[(axis + 1) % 3], np.eye(3)[(axis + 2) % 3]
                corners = [
                    self.screen(R @ (half * (normal + p * a + q * b)))
                    for p, q in ((1, 1), (1, -1), (-1, -1), (-1, 1))
                ]
                points = " ".join(f"{u:.1f},{v:.1f}" for u, v in corners)
                yield Face(axis, sign, points, self.screen(R @ (half * normal)))
