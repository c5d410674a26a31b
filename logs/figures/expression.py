"""Curves computed of others by an expression that a person types: `norm(omega_x, omega_y)`.

The text is parsed by Python's own parser, and every node is held against a short list: numbers,
names, + - * / **, and calls of FUNCTIONS by name. What is left is evaluated by simpleeval, with
operators and functions of quantity.py alone, on arrays of one length: neither time nor memory can
be more than the number of nodes times the number of samples. Units are kept with the values.
"""

import ast
import difflib
import functools
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from logs.figures import quantity
from logs.figures.quantity import ExpressionError, Quantity
from logs.figures.units import Unit, spelt, unit
from messages.text import check as fault_of

MOST_CHARACTERS = 200
MOST_NODES = 60
DEEPEST = 40  # calls and operators within one another; a sum of n is n deep
MOST_CURVES = 6  # of one person's arrangement
MOST_UNIT = 16  # characters of a unit that a person gives
EXAMPLE = "norm(omega_x, omega_y, omega_z)"
ALLOWED = "numbers, channels, + - * / ** and the functions offered"

OPERATORS = {
    ast.Add: quantity.add,
    ast.Sub: quantity.subtract,
    ast.Mult: quantity.multiply,
    ast.Div: quantity.divide,
    ast.Pow: quantity.power,
    ast.USub: quantity.negative,
    ast.UAdd: quantity.as_quantity,
}


@dataclass(frozen=True)
class Expression:
    """What was typed, checked: it can be evaluated as soon as its names are known."""

    text: str
    names: tuple[str, ...]  # of channels, in the order of their first use
    given: str = ""  # the unit that the person gave; else it follows from the channels'
    tree: ast.expr = field(repr=False, compare=False, default_factory=lambda: ast.Constant(0))

    @property
    def title(self) -> str:
        """As it is drawn and kept: `text [unit]`, or the text alone."""
        return f"{self.text} [{self.given}]" if self.given else self.text


def read(line: str) -> Expression:
    """Check a line, `expression` or `expression [unit]`. Raises ExpressionError with a sentence."""
    line = line.strip()
    text, given = line, ""
    if line.endswith("]") and "[" in line:
        text, _, given = line[:-1].rpartition("[")
        text, given = text.strip(), given.strip()
    _check_words(text, given)
    tree = _parse(text)
    nodes = list(_walk(tree, 1))
    if len(nodes) > MOST_NODES:
        raise ExpressionError(f"It has {len(nodes)} parts; at most {MOST_NODES} are computed.")
    called = {id(node.func) for node in nodes if isinstance(node, ast.Call)}
    for node in nodes:
        _check(node, called)
    names = [n.id for n in nodes if isinstance(n, ast.Name) and id(n) not in called]
    if not names:
        raise ExpressionError("It names no channel, so there is nothing to draw.")
    return Expression(text, tuple(dict.fromkeys(names)), given, tree)


def many(text: str) -> list[str]:
    """The lines of an arrangement, `;` between them, no more than MOST_CURVES and none twice."""
    lines = (part.strip()[: MOST_CHARACTERS + MOST_UNIT + 3] for part in text.split(";"))
    return list(dict.fromkeys(line for line in lines if line))[:MOST_CURVES]


def known_names(expression: Expression, offered: Iterable[str]) -> None:
    """Are all its channels there? Raises ExpressionError that says which may have been meant."""
    offered = set(offered)
    for name in expression.names:
        if name not in offered and name in quantity.FUNCTIONS:
            raise ExpressionError(f"{name} is a function: write {name}(...).")
        if name not in offered:
            raise ExpressionError(f"There is no channel {name}{_meant(name, offered)}")


def evaluate(expression: Expression, channels: Mapping[str, Quantity]) -> Quantity:
    """The curve, and its unit: the one given, else what follows. The arrays of channels have one
    length, and so has the result; what is not finite in it is NaN.

    Raises ExpressionError where a channel is missing, or units do not go together and none is
    given.
    """
    from simpleeval import SimpleEval  # here: only who draws a curve of his own needs it

    known_names(expression, channels)
    used = {name: channels[name] for name in expression.names}
    evaluator = SimpleEval(OPERATORS, quantity.FUNCTIONS, used)
    with np.errstate(all="ignore"):
        found = quantity.as_quantity(evaluator.eval(expression.text, expression.tree))
        length = max(np.size(one.values) for one in used.values())
        values = np.broadcast_to(np.asarray(found.values, dtype=np.float64), (length,))
    if found.why and not expression.given:  # whoever gives the unit has thought of the others
        raise ExpressionError(found.why)
    values = np.where(np.isfinite(values), values, np.nan)
    return Quantity(values, unit(expression.given) if expression.given else found.unit)


def unit_of(expression: Expression, units: Mapping[str, Unit]) -> str:
    """Its unit as it is spelt, without any sample. Raises what evaluate raises."""
    if expression.given:
        known_names(expression, units)
        return expression.given
    empty = {name: Quantity(np.zeros(1), one) for name, one in units.items()}
    return spelt(evaluate(expression, empty).unit)


def _check_words(text: str, given: str) -> None:
    if not text:
        raise ExpressionError(f"Type an expression, like {EXAMPLE}.")
    if len(text) > MOST_CHARACTERS:
        raise ExpressionError(f"It has {len(text)} characters; at most {MOST_CHARACTERS} are read.")
    if len(given) > MOST_UNIT or set(given) & set("[];") or fault_of(given, False):
        raise ExpressionError(f"The unit in brackets is no unit: at most {MOST_UNIT} letters.")


@functools.lru_cache(256)
def _parse(text: str) -> ast.expr:
    if "^" in text:
        raise ExpressionError("For a power write **, as in omega_x**2.")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return ast.parse(text, mode="eval").body
    except SyntaxError as error:
        where = f" at character {error.offset}" if error.offset else ""
        raise ExpressionError(f"It cannot be read{where}: want something like {EXAMPLE}.") from None
    except (ValueError, RecursionError, MemoryError):
        raise ExpressionError(f"It cannot be read: want something like {EXAMPLE}.") from None


def _walk(node: ast.AST, depth: int) -> Iterable[ast.AST]:
    """Every node that stands for a part, with a limit to how deep they lie."""
    if depth > DEEPEST:
        raise ExpressionError(f"It is nested deeper than {DEEPEST} levels.")
    yield node
    for child in ast.iter_child_nodes(node):
        if not isinstance(child, ast.expr_context | ast.operator | ast.unaryop):
            yield from _walk(child, depth + 1)


def _check(node: ast.AST, called: set[int]) -> None:
    match node:
        case ast.Constant(value=bool() | complex()):
            raise ExpressionError(f"{node.value} is no number: want {ALLOWED}.")
        case ast.Constant(value=int() | float() as value) if abs(value) < quantity.LARGEST:
            return
        case ast.BinOp(op=operator) | ast.UnaryOp(op=operator) if type(operator) in OPERATORS:
            return
        case ast.Name(id=name):
            if id(node) in called and name not in quantity.FUNCTIONS:
                meant = _meant(name, quantity.FUNCTIONS)
                raise ExpressionError(f"There is no function {name}{meant}")
            return
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
            least, most = quantity.ARGUMENTS.get(name, (0, MOST_NODES))
            if least <= len(arguments) <= most:
                return
            wanted = str(least) if least == most else f"{least} to {most}"
            raise ExpressionError(f"{name} wants {wanted} arguments, not {len(arguments)}.")
    raise ExpressionError(f"{_shown(node)} cannot stand here: want {ALLOWED}.")


def _shown(node: ast.AST) -> str:
    words = ast.unparse(node) if isinstance(node, ast.expr) else type(node).__name__
    return words if len(words) <= 40 else f"{words[:37]}..."


def _meant(name: str, among: Iterable[str]) -> str:
    close = difflib.get_close_matches(name, list(among), 1)
    return f". Is {close[0]} meant?" if close else "."
