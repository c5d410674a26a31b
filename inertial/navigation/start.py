"""From the first sample to the first fix that a filter can start from: alignment and its samples.

Live navigation and the run over a whole drive step the same object, so that they start alike.
"""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inertial.constants import GRAVITY
from inertial.core import navigation as core
from inertial.elementary import dot, norm, product
from inertial.navigation.alignment import Alignment, AlignmentSettings, Start
from inertial.navigation.alignment_positions import Positions
from inertial.navigation.error_model import DP
from inertial.navigation.filters import FilterConfig
from inertial.navigation.fix import Fix
from inertial.navigation.settings import NavigatorConfig

Array = NDArray[np.float64]

CHANGE = 1.0  # m/s^2, by which a velocity may have changed since
HEIGHT_UP = np.array([1.0, 1.0, -1.0])  # the error state counts height up


class Startup:
    """Alignment, fed with every sample and asked at every fix. `history` keeps the samples,
    because a fix is about a moment that has passed.
    """

    def __init__(self, settings: AlignmentSettings, history: Any) -> None:
        """`history` is the core's Live of the filter that is to start."""
        self.align = Alignment(settings)
        self.history = history
        self._positions = Positions()

    @property
    def still_f(self) -> float:
        """|mean f| at standstill, m/s^2; standard gravity where there was none."""
        return float(norm(self.align.mean_f)) if self.align.levelled else GRAVITY

    def feed(self, imu: Array) -> None:
        """Take samples imu (n, 7: t s, f_b m/s^2, omega_ib_b rad/s) without a gap in them."""
        for row in imu:
            self.align.imu(float(row[0]), row[1:4], row[4:7])
        self.history.feed(imu)

    def fix(self, fix: Fix) -> Start | None:
        """Take a fix; the start at its time, when the alignment knows enough. A receiver without
        velocities is asked for the way between its positions.
        """
        fix = fix.filled()
        if fix.v_n is not None:
            return self._ask(fix.t, fix.v_n, fix.sigma_v)
        walked = self._positions.take(fix)
        if walked is None:
            return None
        start = self._ask(walked.t, walked.v_n, walked.sigma_v)
        if start is None:
            return None
        # from the middle of the way to the fix, by the gyros; the velocity may have changed
        bias = start.bias_gyro
        then, now = (self.history.turned_back(np.eye(3), bias, t) for t in (walked.t, fix.t))
        C_nb = product(start.C_nb, product(then.T, now))
        sigma_v = walked.sigma_v + CHANGE * (fix.t - walked.t)
        return replace(start, C_nb=C_nb, v_n=walked.v_n, sigma_v=sigma_v)

    def _ask(self, t: float, v_n: Array, sigma_v: Array) -> Start | None:
        self.align.fix(t, v_n, sigma_v)
        if not self.history.reaches(t):
            return None
        a = self.align

        def turned_back(then: float) -> Array:
            return self.history.turned_back(a.C, a.gyro_bias, then)

        return a.start(turned_back(t), v_n, turned_back)

    def after_gap(self, nominal: Any | None) -> None:
        """Begin again after samples were missing; nominal is the core's state of the filter that
        navigated until then, None where none did.
        """
        if nominal is not None:
            # roughly: what turned during the gap is in sigma_tilt of the next start
            self.align.resume(nominal.C_nb, nominal.bias_gyro)


def first_leg(config: NavigatorConfig, chosen: FilterConfig, start: Start, fix: Fix) -> Any:
    """The filter's Leg at the fix that ended the alignment: attitude from there, position and
    velocity of the fix. What the fix does not know begins at zero with the sigma of not knowing.
    """
    fix = fix.filled()
    model = chosen.model(config.imu)
    leg = core.new_leg(model.states)
    x = leg.x
    x.latitude, x.longitude, x.height = fix.latitude, fix.longitude, fix.height
    x.v_n, x.C_nb = fix.v_n if start.v_n is None else start.v_n, start.C_nb
    x.bias_gyro, x.bias_accel = start.bias_gyro, start.bias_accel
    if chosen.constraints.car:
        x.axle = chosen.constraints.axle
    antenna = np.zeros(model.states)
    antenna[DP] = dot(start.C_nb, np.array(config.lever_arm_b)) * HEIGHT_UP
    leg.reset(antenna, model)
    leg.P = first_covariance(config, chosen, start, fix)
    leg.time = fix.t
    return leg


def first_covariance(
    config: NavigatorConfig, chosen: FilterConfig, start: Start, fix: Fix
) -> Array:
    """(n, n) at the start: what is told, the fix, and what the alignment knows of itself."""
    c = config
    sigma_p = np.minimum(c.sigma_p, np.maximum(3.0 * fix.sigma_p, 0.1))
    sigma_p = np.maximum(sigma_p, fix.sigma_p)  # no start is better than its fix
    sigma_v = np.maximum(c.sigma_v, fix.sigma_v if start.sigma_v is None else start.sigma_v)
    sigma_yaw = c.sigma_yaw if start.sigma_yaw is None else max(c.sigma_yaw, start.sigma_yaw)
    attitude = [c.sigma_tilt, c.sigma_tilt, sigma_yaw]
    biases = [c.sigma_bias_accel] * 3 + [c.sigma_bias_gyro] * 3
    sigma = np.concatenate([attitude, sigma_v, sigma_p, biases, chosen.extra_sigma()])
    P = np.diag(np.square(sigma))
    if start.P is not None:
        places = np.r_[0:3, 9:15]
        P[np.ix_(places, places)] = start.P
    return P
