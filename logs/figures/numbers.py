"""Numbers for people: no more digits than their uncertainty lets stand."""

import math


def with_half_width(value: float, half: float, digits: int = 3) -> str:
    """`0.0020 ± 0.0014`: two digits of the half width, and the value to the same place; the value
    to so many digits where the half width is not known.
    """
    if not (math.isfinite(half) and half > 0.0):
        return _minus(f"{value:.{digits}g}")
    places = 1 - math.floor(math.log10(half))
    if places > 6 or places < -3:  # neither is read well without a power of ten
        return _minus(f"{value:.{digits}g} ± {half:.2g}")
    return _minus(f"{value:.{max(places, 0)}f} ± {half:.{max(places, 0)}f}")


def _minus(text: str) -> str:
    return text.replace("-", "\u2212")
