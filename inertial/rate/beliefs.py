"""What an estimator is told beside the layout: a card's uncertainties, where it stands, the table's
axis.
"""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from inertial.layouts.layout import Layout

if TYPE_CHECKING:
    from inertial.calibration.card import Card

BIAS_LEFT = 0.005  # m/s^2, 0.5 mg: of an axis since its calibration, however good that was
SCALE_LEFT = 2e-4  # of 1, the same for scale and direction


@dataclass(frozen=True)
class Beliefs:
    """Options of the products filters."""

    latitude: float | None = None  # rad; given, a standing body turns with the Earth
    tacho_axis_b: tuple[float, float, float] = (
        0.0,
        0.0,
        1.0,
    )  # the axis that a tachometer's rate is about


def card_priors(card: "Card") -> dict[str, float]:
    """Sigmas of one axis after calibration, over the axes' mean square: bias (m/s^2), scale and
    direction (of 1).
    """
    from inertial.calibration.card import sigmas  # here: not every board has a card

    sigma = sigmas(card)
    bias, scale, direction = (
        float(np.sqrt(np.mean(np.square(sigma[k])))) for k in ("bias", "scale", "misalignment")
    )
    return {
        "bias": float(np.hypot(bias, BIAS_LEFT)),
        "scale": float(np.sqrt(scale**2 + direction**2 + SCALE_LEFT**2)),
    }


def make(
    kind: Any, layout: Layout, card: "Card | None" = None, beliefs: Beliefs = Beliefs()
) -> Any:
    """An estimator of this kind for a layout that is the card's, if there is one.

    Raises GeometryError when the layout does not see angular acceleration and specific force.
    """
    default = getattr(kind, "default", None)
    if default is None:
        return kind(layout) if card is None else kind(layout, calibration=card.id)
    config = replace(
        default, latitude=beliefs.latitude, **(card_priors(card) if card is not None else {})
    )
    estimator = kind(layout, config, "" if card is None else card.id)
    estimator.tacho_axis(beliefs.tacho_axis_b)
    return estimator
