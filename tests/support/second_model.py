"""A turning table by a physics engine that knows nothing of ours: MuJoCo's rigid-body recursion.

A chain of two hinges, a rocking base and the table, with an accelerometer site at every corner of
the cube. Other noise than the simulator's too: a heavy-tailed one, a low-pass, times that jitter.
"""

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from inertial.layouts.catalogue import CUBE
from inertial.layouts.layout import Layout

Array = NDArray[np.float64]

G = 9.80665  # m/s^2

MODEL = """
<mujoco>
  <option gravity="0 0 -9.80665" timestep="0.001"/>
  <worldbody>
    <body name="base">
      <joint name="rock" type="hinge" axis="1 0 0"/>
      <geom type="box" size="0.3 0.3 0.02" mass="10"/>
      <body name="table" quat="{tilt}">
        <joint name="turn" type="hinge" axis="0 0 1"/>
        <geom type="cylinder" size="0.2 0.01" mass="5"/>
        <body name="cube" pos="{place}">
          <geom type="box" size="0.05 0.05 0.05" mass="1"/>
          {sites}
        </body>
      </body>
    </body>
  </worldbody>
  <sensor>{sensors}</sensor>
</mujoco>
"""


@dataclass(frozen=True)
class Turned:
    """What the axes read (n, N), m/s^2, when (n,), s, and the true rate (n, 3), rad/s."""

    t_s: Array
    readings: Array
    omega_b: Array


def model_of(layout: Layout, tilt: float, place: tuple[float, float, float]) -> mujoco.MjModel:
    """The chain with one site for every accelerometer axis of a layout."""
    names = [f"a{k}" for k in range(layout.axes)]
    sites = "".join(
        f'<site name="{name}" pos="{r[0]} {r[1]} {r[2]}"/>'
        for name, r in zip(names, layout.r_b, strict=True)
    )
    sensors = "".join(f'<accelerometer site="{name}"/>' for name in names)
    sensors += '<gyro site="a0"/>'
    half = 0.5 * tilt
    quaternion = f"{np.cos(half)} {np.sin(half)} 0 0"
    where = " ".join(map(str, place))
    return mujoco.MjModel.from_xml_string(
        MODEL.format(tilt=quaternion, place=where, sites=sites, sensors=sensors)
    )


def turned(
    seed: int,
    rate,
    seconds: float = 20.0,
    *,
    rate_hz: float = 100.0,
    tilt: float = 0.03,
    place: tuple[float, float, float] = (0.0, 0.0, 0.05),
    noise: float = 4e-3 * G,
    bias: float = 15e-3 * G,
    jitter_s: float = 0.0,
    rocking: float = 0.0,
    layout: Layout | None = None,
) -> Turned:
    """The table turned at rate(t) (rad/s, a smooth function of arrays), read by the engine.

    noise is a Laplace distribution's standard deviation, m/s^2; jitter_s that of the true sampling
    instants about the even ones that t_s gives.
    """
    layout = layout or CUBE(0.05)
    model = model_of(layout, tilt, place)
    data = mujoco.MjData(model)
    draw = np.random.default_rng([seed, 91])
    even = np.arange(round(seconds * rate_hz)) / rate_hz
    at = even + np.clip(draw.normal(0.0, 1.0, len(even)) * jitter_s, -0.4 / rate_hz, 0.4 / rate_hz)
    fine = np.linspace(0.0, seconds + 1.0, 200 * round(seconds + 1.0) + 1)
    speeds = rate(fine)
    angles = np.concatenate([[0.0], np.cumsum(0.5 * (speeds[1:] + speeds[:-1]) * np.diff(fine))])
    offsets = draw.normal(0.0, bias, layout.axes)
    readings, omega = np.empty((len(at), layout.axes)), np.empty((len(at), 3))
    for k, t in enumerate(np.maximum(at, 0.0)):
        w = 2.0 * np.pi * 0.6
        step = 1e-4
        data.qpos[:] = rocking * np.sin(w * t), np.interp(t, fine, angles)
        data.qvel[:] = rocking * w * np.cos(w * t), rate(np.array([t]))[0]
        slope = rate(np.array([t + step]))[0] - rate(np.array([t - step]))[0]
        data.qacc[:] = -rocking * w * w * np.sin(w * t), slope / (2.0 * step)
        mujoco.mj_inverse(model, data)
        felt = data.sensordata[: 3 * layout.axes].reshape(layout.axes, 3)
        readings[k] = (felt * layout.theta_b).sum(axis=1)
        omega[k] = data.sensordata[3 * layout.axes :]
    readings += offsets + draw.laplace(0.0, noise / np.sqrt(2.0), readings.shape)
    return Turned(even, readings, omega)
