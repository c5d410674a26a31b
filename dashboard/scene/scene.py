"""The 3-D scene of one browser: what is where, from the newest messages of the chosen device.

Names of the nodes, which tests and other tools may rely on. Below /world everything stands in n
(north, east, down): a node's quaternion (w, x, y, z) is the q_nb of the message and its position is
in metres (the cube: half sides).

    /world                                          n turned into the z-up display frame; moved
                                                    against the vehicle when following
    /world/truth                                    body frame of what is really the case;
                                                    simulated devices only
    /world/truth/edges
    /world/estimate/<estimator>/body                body frame of one estimator
    /world/estimate/<estimator>/body/{edges,faces,label}  faces: main estimator only
    /world/estimate/<estimator>/body/axes           the twelve sensors; main estimator only
    /world/estimate/<estimator>/body/rate           arrow of omega_ib_b; main estimator only
    /world/estimate/<estimator>/body/rate_label
    /world/estimate/<estimator>/trajectory/<piece>  vehicles
    /world/estimate/<estimator>/ellipsoid           3-sigma position, at the body
    /world/table                                    below the cube, turning with the truth, else
                                                    with the main estimate
    /world/fixes/<piece>                            GNSS fixes
    /world/fixes/rejected/<piece>                   those that the main estimator did not believe
    /world/ground                                   grid

An estimator is one of rate/, of nav/ for a vehicle, or of attitude/ for a board that only tilts:
those all have the heading of the truth or of the first.
"""

import math
import time
from dataclasses import dataclass, field

import numpy as np
import viser
from viser._messages import SetOrientationMessage, SetPositionMessage

from dashboard.data.device import Device
from dashboard.scene.drawing import bodies, camera
from dashboard.scene.drawing import geometry as geo
from dashboard.scene.drawing.axis_arrows import AxisArrows
from dashboard.scene.drawing.labels import Placed, declutter
from dashboard.scene.drawing.palette import estimator_colour, number, rgb, truth_colour
from dashboard.scene.drawing.trails import Trails
from dashboard.scene.workspaces import LAYERS
from inertial.rotation import rotate

ARROW_PER_RADPS = 0.55  # half sides per rad/s; 180 deg/s gives 1.7
ARROW_LONGEST = 2.2
SELDOM_S = 0.2  # between two arrows of the rate, and two looks at which labels lie on others
MOST = 12  # estimators drawn of one device; the tables have them all


@dataclass
class Choice:
    """What the person at this browser wants to see."""

    dark: bool = True
    follow: bool = True
    sheet: bool = False  # panels lie over the lower part of the scene: a phone
    axis_names: bool = False  # of all axes; those left out are named always
    layers: dict[str, bool] = field(default_factory=lambda: dict.fromkeys(LAYERS, True))


class SceneView:
    """Nodes in the scope of one client; update() brings them to the state of a device."""

    def __init__(self, client: viser.ClientHandle, choice: Choice) -> None:
        self._client, self._scene, self._choice = client, client.scene, choice
        self._built: tuple = ()
        self._nodes: dict[str, object] = {}
        self._sent: dict[str, tuple] = {}
        self.trails = Trails(self._scene, self._nodes)
        self._arrows: AxisArrows | None = None
        self._shown = True  # False while a page has a scene of its own
        self._turning = False  # fast enough for an arrow
        self._seldom_at = 0.0
        self._scene.set_up_direction("+z")
        self._lights()

    def reset_camera(self, vehicle: bool) -> None:
        """Look at the body from the usual side."""
        seen = self._client.camera
        position, look_at = camera.aim(
            camera.VEHICLE if vehicle else camera.CUBE, seen.fov, seen.aspect, self._choice.sheet
        )
        with self._client.atomic():
            seen.up_direction = (0.0, 0.0, 1.0)
            seen.position, seen.look_at = position, look_at

    def show(self, shown: bool) -> None:
        """Hide the device's world while a page has a scene of its own."""
        self._shown = shown
        if "/world" in self._nodes:
            self._nodes["/world"].visible = shown

    def forget(self) -> None:
        """Take everything away; the next update builds it again."""
        if "/world" in self._nodes:
            self._nodes["/world"].remove()
        self._nodes.clear()
        self._sent.clear()
        self.trails.forget()
        self._built = ()
        self._arrows = None

    def update(self, device: Device) -> None:
        """Poses from the newest messages. Call under the store's lock, 20 to 30 times a second."""
        body = device.body
        estimators = device.estimators(body)[:MOST]
        truth = device.get("truth") is not None
        built = (device.name, device.generation, body, tuple(estimators), truth, self._choice.dark)
        built_now = built != self._built
        if built_now:
            first = not self._built or self._built[2] != body
            self.forget()
            self._built = built
            self._build(body, estimators, truth)
            if first:
                self.reset_camera(body == "nav")
        now = time.monotonic()
        seldom = built_now or now >= self._seldom_at
        if body == "nav":
            self._update_vehicle(device, estimators)
        elif body == "attitude":
            self._update_board(device, estimators)
        else:
            self._update_cube(device, estimators)
            if seldom and estimators:
                path = f"/world/estimate/{estimators[0]}/body/rate"
                self._update_rate_arrow(path, device, estimators[0])
        nodes = tuple(map(id, self._nodes.values()))
        shown = (*self._choice.layers.values(), self._turning, *nodes)
        if shown != self._sent.get("#layers"):
            self._sent["#layers"] = shown
            self._show_layers()
        if seldom:
            self._seldom_at = now + SELDOM_S
            declutter(self._client.camera, self._labels(estimators))

    def _show_layers(self) -> None:
        for node, layer in self._layers():
            visible = self._choice.layers[layer] and (layer != "rate" or self._turning)
            if node.visible != visible:
                node.visible = visible

    # --- building

    def _lights(self) -> None:
        """Our own lights: the default ones are so strong that colours turn to white."""
        self._scene.configure_default_lights(enabled=False)
        self._scene.configure_environment_map(None)
        self._scene.add_light_ambient("/lights/ambient", intensity=1.0)
        self._scene.add_light_directional("/lights/sun", intensity=1.5, position=(3.0, -4.0, 8.0))

    def _build(self, kind: str, estimators: list[str], truth: bool) -> None:
        scene, dark, vehicle = self._scene, self._choice.dark, kind == "nav"
        self._nodes["/world"] = scene.add_frame(
            "/world", show_axes=False, wxyz=geo.Q_DISPLAY_N, visible=self._shown
        )
        bodies.ground(scene, self._nodes, vehicle, dark)
        for index, name in enumerate(estimators):
            colour = estimator_colour(name, estimators)
            body = f"/world/estimate/{name}/body"
            self._nodes[body] = scene.add_frame(body, show_axes=False)
            if vehicle:
                bodies.vehicle(scene, self._nodes, body, colour, name, index)
                path = f"/world/estimate/{name}/ellipsoid"
                self._nodes[path] = scene.add_icosphere(
                    path,
                    radius=1.0,
                    color=rgb(colour),
                    opacity=0.22,
                    cast_shadow=False,
                    visible=False,
                )
            elif kind == "attitude":
                bodies.board(scene, self._nodes, body, colour, name, index)
            else:
                bodies.cube(scene, self._nodes, body, colour, name, index)
                if index == 0:
                    self._arrows = AxisArrows(scene, self._nodes, body)
        if kind == "rate":
            bodies.table(scene, self._nodes, dark)
        if truth:
            self._nodes["/world/truth"] = scene.add_frame("/world/truth", show_axes=False)
            scene.add_line_segments(
                "/world/truth/edges",
                geo.box_edges((1.015,) * 3 if kind == "rate" else bodies.BOARD),
                rgb(truth_colour(dark)),
                thickness=2.0,
                thickness_units="screen",
            )

    # --- updating

    def _set(self, path: str, *, q=None, p=None) -> None:
        """Send a pose when it changed, past viser's comparison: that costs more than sending."""
        node = self._nodes.get(path)
        if node is None:
            return
        if q is not None and self._sent.get(f"{path}#q") != q:
            self._sent[f"{path}#q"] = node._impl.wxyz[:] = q
            node._impl.api._queue_scene_message(SetOrientationMessage(path, q))
        if p is not None and self._sent.get(f"{path}#p") != p:
            self._sent[f"{path}#p"] = node._impl.position[:] = p
            node._impl.api._queue_scene_message(SetPositionMessage(path, p))

    def _update_cube(self, device: Device, estimators: list[str]) -> None:
        reference = None
        for name in reversed(estimators):
            reference = geo.quaternion(device.get("rate", name).message.q_nb[-4:])  # the last
            self._set(f"/world/estimate/{name}/body", q=reference)
        truth = device.get("truth")
        if truth is not None:
            reference = geo.quaternion(truth.message.q_nb) or reference
            self._set("/world/truth", q=reference)
        self._set("/world/table", q=reference)
        health = device.get("axes")
        if self._arrows is not None and health is not None:
            self._arrows.update(health.message)

    def _update_board(self, device: Device, estimators: list[str]) -> None:
        """Filters that know no north start at any heading: all are turned to the truth's, or to the
        first one's.
        """
        truth = device.get("truth")
        north = (
            truth.message.q_nb
            if truth is not None
            else device.get("attitude", estimators[0]).message.q_nb
        )
        if truth is not None:
            self._set("/world/truth", q=geo.quaternion(north))
        for name in estimators:
            self._set(
                f"/world/estimate/{name}/body",
                q=geo.facing(device.get("attitude", name).message.q_nb, north),
            )

    def _update_rate_arrow(self, path: str, device: Device, estimator: str) -> None:
        node, label = self._nodes.get(path), self._nodes.get(f"{path}_label")
        omega = np.asarray(device.get("rate", estimator).message.omega_ib_b_radps[-3:], dtype=float)
        if node is None or omega.shape != (3,) or not np.all(np.isfinite(omega)):
            return
        size = float(np.linalg.norm(omega))
        self._turning = size > 0.05
        if not self._turning:
            return
        text, direction = f"ω {number(np.degrees(size), 0, '°/s')}", omega / size
        # It stands on the face it leaves the cube through, so that a slow rate is seen outside the
        # cube as well; one that points into the table comes from above instead.
        face = direction / np.max(np.abs(direction))
        reach = direction * (0.25 + min(ARROW_PER_RADPS * size, ARROW_LONGEST))
        start, tip = (face, face + reach) if direction[2] > -0.5 else (-face - reach, -face)
        key = tuple(np.round(np.concatenate([start, tip]), 2))
        if self._sent.get(path) != key:
            self._sent[path] = key
            node.points = np.array([[start, tip]], dtype=np.float32)
            label.position = tuple((tip if direction[2] > -0.5 else start) + [0.0, 0.0, 0.15])
        if label.text != text:
            label.text = text

    def _update_vehicle(self, device: Device, estimators: list[str]) -> None:
        for index, name in enumerate(estimators):
            message = device.get("nav", name).message
            q = geo.quaternion(message.q_nb)
            p = geo.drawn_place(message.p_ned_m)
            self._set(f"/world/estimate/{name}/body", q=q, p=p)
            flat = len(message.p_ned_m) == 3 and math.isnan(message.p_ned_m[2])
            surface = geo.ellipsoid(geo.flattened(message.position_covariance, flat))
            path = f"/world/estimate/{name}/ellipsoid"
            if surface is not None and p is not None and path in self._nodes:
                self._set(path, q=surface[1], p=p)
                scale = tuple(round(v, 3) for v in surface[0])
                if self._sent.get(f"{path}#s") != scale:
                    self._sent[f"{path}#s"] = scale
                    self._nodes[path].scale = scale
            if index == 0 and p is not None:
                self._set("/world/ground", p=(0.0, 0.0, round(p[2], 1) + bodies.GROUND_BELOW))
                if self._choice.follow:
                    shift = -rotate(geo.Q_DISPLAY_N, p)
                    self._set("/world", p=tuple(float(v) for v in shift))

    def _labels(self, estimators: list[str]) -> list[Placed]:
        """All labels and where they are, the weightier first."""
        layers = self._choice.layers
        shift = np.asarray(self._sent.get("/world#p", (0.0, 0.0, 0.0)))
        found: list[Placed] = []

        def add(body: str, handle: object, shown: bool) -> None:
            q, p = self._sent.get(f"{body}#q"), self._sent.get(f"{body}#p", (0.0, 0.0, 0.0))
            if handle is not None and q is not None:
                point = rotate(q, np.asarray(handle.position, dtype=float)) + np.asarray(p)
                found.append(Placed(handle, rotate(geo.Q_DISPLAY_N, point) + shift, shown))

        bodies_of = [f"/world/estimate/{name}/body" for name in estimators]
        for body in bodies_of[:1]:
            rate = layers["rate"] and self._turning
            add(body, self._nodes.get(f"{body}/rate_label"), rate)
        for body in bodies_of:
            add(body, self._nodes.get(f"{body}/label"), layers["estimates"])
        if self._arrows is not None and bodies_of:
            for handle, out in self._arrows.labels():
                add(bodies_of[0], handle, layers["sensors"] and (out or self._choice.axis_names))
        return found

    def _layers(self):
        for path, node in self._nodes.items():
            tail = path.rsplit("/", 1)[1]
            if path == "/world/truth":
                yield node, "truth"
            elif tail == "rate":
                yield node, "rate"
            elif "/trajectory/" in path:
                yield node, "trajectory"
            elif path.startswith("/world/fixes/"):
                yield node, "fixes"
            elif tail in _TAILS:
                yield node, _TAILS[tail]


_TAILS = {"body": "estimates", "axes": "sensors", "ellipsoid": "ellipsoid", "ground": "grid"}
