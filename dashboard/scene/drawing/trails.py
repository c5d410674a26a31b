"""Trajectories and fixes in the scene, in the pieces that their tracks come in."""

import numpy as np
from viser import SceneApi

from dashboard.data.device import Device
from dashboard.data.track import Track
from dashboard.scene.drawing.palette import FIX, REJECTED, estimator_colour, rgb

FIX_SIZE, REJECTED_SIZE = 0.8, 1.4  # m; a rejected fix lies over the same fix in its usual colour


class Trails:
    """Nodes of the tracks of one browser's device, kept in `nodes` with all the others."""

    def __init__(self, scene: SceneApi, nodes: dict[str, object]) -> None:
        self._scene, self._nodes = scene, nodes
        self._pieces: dict[str, int] = {}  # points of each track piece that the browser has
        self._thinned: dict[str, int] = {}

    def forget(self) -> None:
        """The nodes are gone."""
        self._pieces.clear()
        self._thinned.clear()

    def update(self, device: Device) -> None:
        """Only pieces that grew are sent. Call under the store's lock."""
        if device.body != "nav":
            return  # a cube stands on its table, whatever way it went
        for name, track in device.tracks.items():
            if name == "fixes":
                self._track("/world/fixes", track, rgb(FIX), FIX_SIZE)
            elif name == "rejected":
                self._track("/world/fixes/rejected", track, rgb(REJECTED), REJECTED_SIZE)
            else:
                estimator = name.split("/", 1)[1]
                if f"/world/estimate/{estimator}/body" not in self._nodes:
                    continue  # one too many to be drawn
                colour = rgb(estimator_colour(estimator, device.estimators("nav")))
                self._track(f"/world/estimate/{estimator}/trajectory", track, colour)

    def _track(
        self, base: str, track: Track, colour: tuple[int, int, int], point_size: float = 0.0
    ) -> None:
        """Bring a track to the browser, as points of that size in m, or as a line when there is no
        size.
        """
        if self._thinned.get(base, track.thinned) != track.thinned:
            for path in [path for path in self._nodes if path.startswith(f"{base}/")]:
                self._nodes.pop(path).remove()
                self._pieces.pop(path, None)
        self._thinned[base] = track.thinned
        for index, piece in enumerate(track.pieces):
            path = f"{base}/{index}"
            if len(piece) < (1 if point_size else 2) or self._pieces.get(path) == len(piece):
                continue
            self._pieces[path] = len(piece)
            line = np.asarray(piece, dtype=np.float32)
            if point_size:
                self._nodes[path] = self._scene.add_point_cloud(
                    path,
                    line,
                    colour,
                    point_size=point_size,
                    point_shape="circle",
                    precision="float32",
                )
            else:
                segments = np.stack([line[:-1], line[1:]], axis=1)
                self._nodes[path] = self._scene.add_line_segments(
                    path, segments, colour, thickness=5.0, thickness_units="screen"
                )
