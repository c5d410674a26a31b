"""Curves of a person's own over a session: expressions over the means of its bins."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from logs.figures.expression import evaluate, known_names, read, unit_of
from logs.figures.names import OTHERS, line_title, slug
from logs.figures.quantity import ExpressionError, Quantity
from logs.figures.units import unit
from sessions.library.curves import RATE, TACHO, Curves, Line

Array = NDArray[np.float64]

DEG = float(np.degrees(1.0))
WORDS = {name: f"omega_{name}" for name in "xyz"}


@dataclass(frozen=True)
class Named:
    """One component of a line of a session, in the unit of the charts."""

    name: str
    who: str  # for people
    unit: str
    line: Line
    part: int
    factor: float

    def values(self) -> Array:
        """The means of all bins (n,)."""
        return self.factor * self.line.mean[:, self.part].astype(np.float64)

    def said(self) -> NDArray[np.uint8] | None:
        """What its estimator says of them (n,), RateEstimate.Sight; None where nobody says."""
        return self.line.said_of(self.line.components[self.part])


@dataclass(frozen=True)
class Made:
    """A derived curve on the session's bins; or the sentence that says why there is none."""

    text: str
    unit: str
    fault: str = ""
    y: Array | None = None
    sight: NDArray[np.uint8] | None = None  # (n,) the worst that is said of what it is made of


def channels(curves: Curves) -> dict[str, Named]:
    """What a session has, by name: as on the live page, of its first device without a prefix."""
    found: dict[str, Named] = {}
    lead = curves.lead()
    first = lead.device if lead else min((line.device for line in curves.axes.values()), default="")
    for line in [*([lead] if lead else []), *curves.lines.values(), *curves.axes.values()]:
        whose = "" if line.device == first else f"{slug(line.device)}_"
        for k, component in enumerate(line.components):
            for word in _words(line, component, alone=line is lead):
                one = _named(whose + word, line, k, component)
                found.setdefault(one.name, one)
    return found


def _words(line: Line, component: str, alone: bool) -> list[str]:
    word = WORDS.get(component, component)
    if line.kind == TACHO:
        return ["tachometer"]
    if line.names:  # axes have names of their own
        return [word]
    before = slug(line.title) if line.kind == RATE else line.kind
    return ([word] if alone else []) + [f"{before}_{word}"]


def _named(name: str, line: Line, part: int, component: str) -> Named:
    if line.names:
        axis = f"axis {component.replace('_', '').translate(str.maketrans('xyz', '123'))}"
        return Named(name, axis if component[0] == "a" else OTHERS["gyro"], "m/s²", line, part, 1.0)
    shown = "°" if component.startswith("angle") else "°/s"
    return Named(name, line_title(line.title), shown, line, part, DEG)


def derive(curves: Curves, lines: Sequence[str]) -> list[Made]:
    """Each expression over the whole session."""
    named = channels(curves) if lines else {}
    units = {name: unit(one.unit) for name, one in named.items()} | {"t": unit("s")}
    found = []
    for line in lines:
        try:
            expression = read(line)
            known_names(expression, units)
            of = unit_of(expression, units)
            known = {
                name: Quantity(named[name].values(), units[name])
                for name in expression.names
                if name != "t"
            }
            y = evaluate(expression, known | {"t": Quantity(curves.t, units["t"])})
            of_them = (named[name].said() for name in expression.names if name != "t")
            said = [one for one in of_them if one is not None]
            sight = np.maximum.reduce(said) if said else None
            found.append(Made(line, of, "", np.asarray(y.values), sight))
        except ExpressionError as error:
            found.append(Made(line, "", str(error)))
    return found
