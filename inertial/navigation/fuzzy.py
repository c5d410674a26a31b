"""The fuzzy horizon: how hard the vehicle moves decides how many fixes the predictive estimator
looks back. E-128, E-129.

Sets S, M, H on |f| and |w|, nine rules, singleton consequents. Break points and rules stand in
fuzzy_horizon.toml beside this module, which people may edit; RULES is what it says.
"""

import math
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inertial.core import navigation as core
from inertial.toml_file import parsed, text_of

Array = NDArray[np.float64]

DEFAULT_FILE = Path(__file__).with_name("fuzzy_horizon.toml")
SETS = ("small", "medium", "high")
MEMBERSHIPS = tuple(f"{what} {name}" for what in ("|f|", "|ω|") for name in SETS)


class FuzzyError(ValueError):
    """A file of rules that cannot be used."""


@dataclass(frozen=True)
class FuzzyRules:
    """Break points of the sets and the consequents of the rules."""

    force: tuple[float, float, float] = (
        9.9,
        10.2,
        10.8,
    )  # m/s^2: S falls to 0 at the second, H is 1 from the third
    rate: tuple[float, float, float] = (0.05, 0.20, 0.45)  # rad/s
    table: tuple[tuple[float, float, float], ...] = (
        (1.0, 2.0, 3.0),
        (4.0, 5.0, 6.0),
        (7.0, 8.0, 9.0),
    )
    minimum: bool = False  # combine the sets by their minimum instead of their product

    def core(self) -> Any:
        """As the core's filters take it."""
        return core.FuzzyRules(
            force=self.force, rate=self.rate, table=self.table, minimum=self.minimum
        )


def read_rules(path: Path = DEFAULT_FILE) -> FuzzyRules:
    """Rules from TOML; raises FuzzyError that names the file, the key and what is wanted."""
    try:
        data = parsed(text_of(path))
    except (OSError, tomllib.TOMLDecodeError) as error:
        raise FuzzyError(f"{path}: {error}") from None
    known = {"force_mps2", "rate_radps", "combine", "rules"}
    if unknown := data.keys() - known:
        raise FuzzyError(
            f"{path}: no such key {sorted(unknown)[0]!r}; want {', '.join(sorted(known))}"
        )
    points = [_points(path, key, data.get(key)) for key in ("force_mps2", "rate_radps")]
    table = data.get("rules")
    if not (
        isinstance(table, list)
        and len(table) == 3
        and all(isinstance(r, list) and len(r) == 3 for r in table)
    ):
        raise FuzzyError(
            f"{path}: rules: want three rows (|f| small, medium, high) of three numbers (|w|"
            " likewise)"
        )
    if not all(isinstance(v, int | float) and 0.0 <= v <= 9.0 for row in table for v in row):
        raise FuzzyError(f"{path}: rules: want numbers from 0 to 9, to which one fix is added")
    combine = data.get("combine", "product")
    if combine not in ("product", "minimum"):
        raise FuzzyError(f"{path}: combine = {combine!r}: want 'product' or 'minimum'")
    rows = tuple((float(a), float(b), float(c)) for a, b, c in table)
    return FuzzyRules(points[0], points[1], rows, combine == "minimum")


def _points(path: Path, key: str, value: object) -> tuple[float, float, float]:
    if not (
        isinstance(value, list)
        and len(value) == 3
        and all(isinstance(v, int | float) for v in value)
    ):
        raise FuzzyError(f"{path}: {key} = {value!r}: want three numbers")
    a, b, c = (float(v) for v in value)
    if not (math.isfinite(a) and math.isfinite(c) and a < b < c):
        raise FuzzyError(f"{path}: {key} = {value!r}: want them rising")
    return a, b, c


RULES = read_rules()


def membership(value: float, points: tuple[float, float, float]) -> Array:
    """S, M, H (3,) of a value: a partition of unity over three break points."""
    return core.membership(value, points)


def memberships(force: float, rate: float, rules: FuzzyRules = RULES) -> list[float]:
    """Six numbers in the order of MEMBERSHIPS, for |f| in m/s^2 and |w| in rad/s."""
    return [*membership(force, rules.force).tolist(), *membership(rate, rules.rate).tolist()]


def horizon(force: float, rate: float, rules: FuzzyRules = RULES) -> float:
    """1 + No, not yet rounded, from |f| in m/s^2 and |w| in rad/s (E-129)."""
    return core.crisp_horizon(force, rate, rules.core())


def fixes(crisp: float) -> int:
    """N: the horizon rounded half up, 2 to 10 fixes (E-129)."""
    return core.whole_horizon(crisp)
