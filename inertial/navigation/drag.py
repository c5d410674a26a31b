"""A GNSS position that walks off slowly, unseen by a gate for jumps: the receiver's own velocity
tells. E-132, E-133.

A position that is dragged by some decimetres a second looks like a drive to a filter: each fix
alone is plausible. But the receiver measures its velocity by Doppler shift, apart from its
position, and the two must tell the same way. The watch keeps the difference of the position and the
integrated velocity in a Kalman filter of its own: an offset that wanders as such receivers' errors
do, the drag, and the age of the velocity, which else looks like a drag in every acceleration. The
drag is an alarm when it is not zero by its own covariance.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from inertial.core import navigation as core
from inertial.earth import ned_between
from inertial.elementary import norm
from inertial.navigation.fix import Fix

Array = NDArray[np.float64]

DRAG, LAG = slice(3, 6), 6  # of the core's DragFilter
UP = np.array([1.0, 1.0, -1.0])


@dataclass(frozen=True)
class DragSettings:
    """How a drag is told from a receiver's honest errors. The split of its sigma is that of a
    low-cost receiver.
    """

    white: float = 0.65  # of its position sigma is new in every fix
    wander: float = 0.75  # of it wanders (ionosphere, multipath)
    tau: float = 60.0  # s, of the wander
    memory: float = 60.0  # s, over which a drag is looked for
    sigma_v: float = 0.1  # m/s, at least: of a velocity
    bend: float = (
        0.1  # of the change of velocity between two fixes: how wrong the straight line may be
    )
    sigma_lag: float = 0.2  # s, age of the velocity against the position
    sigma_drag: float = 1.0  # m/s, before any data
    false_alarm: float = 1e-4  # chance of a statistic as large without a drag, were the model right
    calm: float = 1e-2  # an alarm ends where the chance is above this
    # s from its begin until it raises an alarm: it may have begun in a burst of gross fixes
    patience: float = 20.0
    longest_gap: float = 5.0  # s between fixes; after more it begins anew
    gross: float = 1e-3  # chance that a good fix is left out as a gross one
    # contradicting fixes in a row after which the position is taken to have jumped: begin anew
    jumps: int = 5


class DragWatch:
    """Looks at every fix that is to be used, in order; gives it back with a raised sigma while it
    drags.
    """

    def __init__(self, settings: DragSettings = DragSettings()) -> None:
        s = self.settings = settings
        self.dragging = False
        self._gate, self._calm = float(chdtri(3, s.false_alarm)), float(chdtri(3, s.calm))
        self._jump = float(chdtri(3, s.gross))
        self._last: Fix | None = None
        self._lag, self._sigma_lag = 0.0, s.sigma_lag
        self._contradicted = 0
        self._calm_since = self._began = (
            0.0  # s, when the statistic was last calm, when the watch began
        )

    @property
    def drag(self) -> Array:
        """(3,) m/s north, east, up, by which the position walks off as far as is known."""
        return self._filter.x[DRAG] if self._last is not None else np.zeros(3)

    @property
    def statistic(self) -> float:
        """Squared drag in its own sigmas, 3 degrees of freedom."""
        return self._filter.statistic() if self._last is not None else 0.0

    def take(self, fix: Fix) -> Fix:
        """The fix as the filters may have it. One that is withheld or has no velocity passes and
        teaches nothing.
        """
        if fix.withheld or fix.v_n is None:
            return fix
        return self._look(fix, fix.filled())

    def _look(self, given: Fix, fix: Fix) -> Fix:
        """fix: as given, with numbers for what is unknown."""
        last = self._last
        if last is not None and fix.t <= last.t:
            return given  # late, or twice
        if last is None or fix.t - last.t > self.settings.longest_gap:
            self._begin(fix)
            return given
        if self._step(last, fix):
            self._contradicted = 0
        else:
            self._contradicted += 1
            if self._contradicted >= self.settings.jumps:
                self._begin(fix)
            return self._raised(given) if self.dragging else given
        if self.statistic < self._calm:
            self._calm_since, self.dragging = fix.t, False
        elif self.statistic > self._gate and fix.t - self._began >= self.settings.patience:
            self.dragging = True
        return self._raised(given) if self.dragging else given

    def _raised(self, fix: Fix) -> Fix:
        """The sigma that is honest while the position drags: by as much as it may have walked
        off.
        """
        speed = float(norm(self.drag))
        walked = speed * (fix.t - self._calm_since)
        return replace(fix, sigma_p=np.sqrt(fix.sigma_p**2 + walked**2), drag=speed)

    def _begin(self, fix: Fix) -> None:
        s = self.settings
        white = (s.white * fix.sigma_p) ** 2
        offset = white + (s.wander * fix.sigma_p) ** 2
        variances = [*offset, *[s.sigma_drag**2] * 3, self._sigma_lag**2]
        self._filter = core.DragFilter(
            x=[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, self._lag], P=np.diag(variances)
        )
        self._walk, self._last = np.zeros(3), fix
        self._origin = (fix.latitude, fix.longitude, fix.height)
        self._v0 = fix.v_n * UP
        self._contradicted, self.dragging, self._calm_since, self._began = 0, False, fix.t, fix.t

    def _step(self, last: Fix, fix: Fix) -> bool:
        """Predict, and correct by position minus integrated velocity; False for a fix that
        contradicts all of it.
        """
        s, dt = self.settings, fix.t - last.t
        sigma_v = np.maximum(s.sigma_v, fix.sigma_v if fix.sigma_v is not None else 0.0)
        wander, before = (s.wander * fix.sigma_p) ** 2, (s.wander * last.sigma_p) ** 2
        walk = 2.0 * wander / s.tau + sigma_v**2 * dt  # m2/s, on a straight road
        bend = (s.bend * np.abs(fix.v_n - last.v_n) * dt) ** 2
        noise = np.concatenate(
            [walk * dt + bend + np.abs(wander - before), walk * dt / s.memory**2]
        )
        walked = self._walk + 0.5 * (fix.v_n + last.v_n) * UP * dt
        north, east, down = ned_between(self._origin, (fix.latitude, fix.longitude, fix.height))
        y = np.array([north, east, -down]) - walked
        white = (s.white * fix.sigma_p) ** 2
        if not self._filter.look(dt, noise, y, fix.v_n * UP - self._v0, white, self._jump):
            return False  # as if it had not come: its velocity must not be integrated either
        self._last, self._walk = fix, walked
        self._lag = float(self._filter.x[LAG])
        self._sigma_lag = math.sqrt(float(self._filter.P[LAG, LAG]) + 0.01**2)
        return True
