"""The way of a body as a line of points that a browser gets in pieces."""

import math

import numpy as np


class Track:
    """A growing line of points in n, in pieces, so that a browser gets only the last piece again.

    Points nearer than `spacing` (m) to the last are left out; when there are too many pieces, every
    second point goes and the spacing doubles.
    """

    PIECE = 250
    PIECES = 160

    def __init__(self, spacing: float) -> None:
        self.spacing = spacing
        self.pieces: list[list[tuple[float, float, float]]] = [[]]
        self.thinned = 0  # counts thinnings: pieces already sent are then no longer valid

    def add(self, p_n) -> None:
        """Add a point (north, east, down), m. One without a height is drawn at the origin's."""
        down = float(p_n[2])
        point = (float(p_n[0]), float(p_n[1]), down if math.isfinite(down) else 0.0)
        last = self.last()
        if last is not None and np.linalg.norm(np.subtract(point, last)) < self.spacing:
            return
        if len(self.pieces[-1]) >= self.PIECE:
            self.pieces.append(
                [self.pieces[-1][-1]]
            )  # pieces share a point, so that the line is not broken
        self.pieces[-1].append(point)
        if len(self.pieces) > self.PIECES:
            self._thin()

    def last(self) -> tuple[float, float, float] | None:
        """The newest point."""
        return self.pieces[-1][-1] if self.pieces[-1] else None

    def _thin(self) -> None:
        points = [p for piece in self.pieces for p in piece][::2]
        self.spacing *= 2
        self.thinned += 1
        self.pieces = [points[i : i + self.PIECE + 1] for i in range(0, len(points), self.PIECE)]
