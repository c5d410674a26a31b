"""Where the camera stands so that the body is seen whole, beside the panels or above the sheet of a
phone.
"""

import math
from dataclasses import dataclass

import numpy as np

# where the middle is above the sheet of a phone, as a part of the height from the top
PHONE_CENTRE = 0.28


@dataclass(frozen=True)
class Aim:
    """A usual view: the point looked at, where from, and what must fit; display frame, its
    units.
    """

    centre: tuple[float, float, float]
    offset: tuple[float, float, float]
    half_width: float  # to be seen left and right of the centre


CUBE = Aim((0.0, 0.0, 0.25), (4.3, -3.6, 2.35), 2.9)
VEHICLE = Aim(
    (0.0, 0.0, 0.0), (-50.0, -42.0, 58.0), 42.0
)  # m; the last 200 m of a way that is not all straight


def aim(view: Aim, fov: float, aspect: float, sheet: bool) -> tuple[np.ndarray, np.ndarray]:
    """Position and look_at of a camera, (3,) each, for a vertical field of view (rad) and a width
    over height. sheet: panels lie over the lower part, as on a phone.

    The camera goes back from the centre until half_width fits. Above a sheet it is moved down
    across its line of sight, so that the centre rises to PHONE_CENTRE.
    """
    centre, offset = np.array(view.centre), np.array(view.offset)
    half_height = math.tan(fov / 2)  # of the picture, at distance 1
    distance = max(float(np.linalg.norm(offset)), view.half_width / (half_height * aspect))
    back = offset / np.linalg.norm(offset)
    if sheet:
        right = np.cross([0.0, 0.0, 1.0], back)
        up = np.cross(back, right / np.linalg.norm(right))
        centre = centre - (1.0 - 2.0 * PHONE_CENTRE) * half_height * distance * up
    return centre + distance * back, centre
