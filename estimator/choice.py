"""Names and files of the settings become estimators, layouts and calibration files; a wrong one is
refused by name.
"""

import math
from pathlib import Path
from typing import Any

from estimator.settings import EstimatorSettings, LayoutSettings
from inertial.attitude.filters import ATTITUDES
from inertial.calibration.card import Card, CardError, read_card
from inertial.navigation.navigation import NAVIGATORS
from inertial.rate.beliefs import Beliefs


class UnknownEstimator(ValueError):
    """Settings name an estimator that does not exist."""


def rate_estimators() -> dict[str, Any]:
    """The table of rate estimators."""
    from inertial.rate.estimators import (
        VARIANTS,
    )  # here: the tables of names need not load with the settings

    return VARIANTS


def check_names(key: str, names: list[str], known: dict[str, Any]) -> None:
    """Raises UnknownEstimator with the known names."""
    for name in names:
        if name not in known:
            raise UnknownEstimator(
                f"[estimator] {key}: no estimator {name!r}; want some of {', '.join(known)}"
            )


def check_settings(settings: EstimatorSettings) -> None:
    """Raises UnknownEstimator for a name that is none or a file that cannot be read: at the start,
    not at the first sample.
    """
    check_names("rate", settings.rate, rate_estimators())
    check_names("navigators", settings.navigators, NAVIGATORS)
    check_names("attitudes", settings.attitudes, ATTITUDES)
    check_names("gyro_free_navigation", settings.gyro_free_navigation, NAVIGATORS)
    if settings.gyro_free_navigation:
        check_names("gyro_free_rate", [settings.believed_rate], dict.fromkeys(settings.rate))
    for layout in (settings.layout, *settings.layouts.values()):
        if layout.file:
            make_layout(layout)
    for path in filter(None, (settings.calibration, *settings.calibrations.values())):
        load_card(path)


def beliefs(settings: EstimatorSettings) -> Beliefs:
    """What the products filters are told beside the layout."""
    latitude = None if settings.latitude_deg is None else math.radians(settings.latitude_deg)
    return Beliefs(latitude, settings.tacho_axis_b)


def load_card(path: Path) -> Card:
    """A calibration file; raises UnknownEstimator for a file that is none or cannot be read."""
    try:
        return read_card(path)
    except (CardError, OSError) as error:
        raise UnknownEstimator(f"[estimator] calibration: {error}") from None


def make_layout(settings: LayoutSettings) -> Any:
    """Accelerometer layout from its settings; raises UnknownEstimator for a file that is none."""
    from inertial.layouts import catalogue, layout

    try:
        return catalogue.find(settings.file or settings.kind, settings.half_side_m)
    except layout.GeometryError as error:
        raise UnknownEstimator(f"[estimator] layout: {error}") from None
