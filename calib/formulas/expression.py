"""Formulas that an operator writes: parsed by our own grammar (``parser.py``), never run as Python.

There are numbers, names, the usual functions and comparisons and nothing else: no attributes.
Derivatives are exact, by forward-mode differentiation: every node answers its value and its
derivative by each unknown it contains. What jumps (comparisons, ``step``, ``sign``) has none.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, BoolArray
from calib.formulas.functions import CONSTANTS, FUNCTIONS
from calib.formulas.parser import Node, parse

_Pair = tuple[Array, dict[str, Array]]
"""A value and its derivatives by the unknowns in it."""

JUMPING = ("step", "sign")
"""Functions in which an unknown has no derivative that a fit could follow."""


@dataclass(frozen=True)
class Expression:
    """A parsed formula."""

    text: str
    root: Node

    @property
    def names(self) -> dict[str, int]:
        """Every name in it but constants, with the column (from 1) of its first use."""
        found: dict[str, int] = {}
        waiting = [self.root]
        while waiting:
            node = waiting.pop()
            if node.what == "name" and node.text not in CONSTANTS:
                found[node.text] = min(node.at, found.get(node.text, node.at))
            waiting.extend(node.parts)
        return dict(sorted(found.items(), key=lambda item: item[1]))

    def evaluate(self, values: Mapping[str, Array], unknowns: frozenset[str]) -> _Pair:
        """Value, and derivatives by the ``unknowns`` in it; arrays are broadcast.

        What is not defined (log of a negative number, division by zero) comes out as nan or inf.
        """
        with np.errstate(all="ignore"):
            return _evaluate(self.root, values, unknowns)


def parse_expression(text: str, place: str) -> Expression:
    """Parse a formula.

    Raises
    ------
    BadInput
        Naming ``place`` and the column of the fault.
    """
    return Expression(text, parse(text, place))


def _evaluate(node: Node, values: Mapping[str, Array], unknowns: frozenset[str]) -> _Pair:
    if node.what == "number":
        return np.asarray(float(node.text)), {}
    if node.what == "name":
        if node.text in CONSTANTS:
            return np.asarray(CONSTANTS[node.text]), {}
        slope = {node.text: np.asarray(1.0)} if node.text in unknowns else {}
        return np.asarray(values[node.text], dtype=np.float64), slope
    pairs = [_evaluate(part, values, unknowns) for part in node.parts]
    value, slopes = pairs[0]
    if node.what == "compare":
        return np.asarray(_COMPARED[node.text](value, pairs[1][0]), dtype=np.float64), {}
    if node.text == "where":
        return _chosen(value != 0.0, pairs[1], pairs[2])
    if node.text in ("max", "min"):
        return _extreme(node.text, pairs)
    if node.what == "neg":
        return -value, _scaled(slopes, np.asarray(-1.0))
    if node.what == "function":
        function, derivative = FUNCTIONS[node.text]
        answer = np.asarray(function(value))
        return answer, _scaled(slopes, np.asarray(derivative(value))) if slopes else {}
    return _OPERATIONS[node.what](value, slopes, *pairs[1])


def _chosen(first: BoolArray, one: _Pair, other: _Pair) -> _Pair:
    """One where ``first`` is true, else the other."""
    none = np.asarray(0.0)
    slopes = {
        name: np.where(first, one[1].get(name, none), other[1].get(name, none))
        for name in {**one[1], **other[1]}
    }
    return np.where(first, one[0], other[0]), slopes


def _extreme(which: str, pairs: Sequence[_Pair]) -> _Pair:
    """The largest or the smallest."""
    best = pairs[0]
    for pair in pairs[1:]:
        best = _chosen(best[0] >= pair[0] if which == "max" else best[0] <= pair[0], best, pair)
    return best


_COMPARED: dict[str, Callable[[Array, Array], Array]] = {
    "<": np.less,
    "<=": np.less_equal,
    ">": np.greater,
    ">=": np.greater_equal,
    "==": np.equal,
    "!=": np.not_equal,
}


def _scaled(slopes: dict[str, Array], factor: Array) -> dict[str, Array]:
    return {name: slope * factor for name, slope in slopes.items()}


def _added(one: dict[str, Array], other: dict[str, Array]) -> dict[str, Array]:
    total = dict(one)
    for name, slope in other.items():
        total[name] = total[name] + slope if name in total else slope
    return total


def _plus(a: Array, da: dict[str, Array], b: Array, db: dict[str, Array]) -> _Pair:
    return a + b, _added(da, db)


def _minus(a: Array, da: dict[str, Array], b: Array, db: dict[str, Array]) -> _Pair:
    return a - b, _added(da, _scaled(db, np.asarray(-1.0)))


def _times(a: Array, da: dict[str, Array], b: Array, db: dict[str, Array]) -> _Pair:
    return a * b, _added(_scaled(da, b), _scaled(db, a))


def _over(a: Array, da: dict[str, Array], b: Array, db: dict[str, Array]) -> _Pair:
    return a / b, _added(_scaled(da, 1.0 / b), _scaled(db, -a / b**2))


def _raised(a: Array, da: dict[str, Array], b: Array, db: dict[str, Array]) -> _Pair:
    answer = np.asarray(a**b)
    slopes = _scaled(da, b * a ** (b - 1.0)) if da else {}
    return answer, _added(slopes, _scaled(db, answer * np.log(a))) if db else slopes


_OPERATIONS: dict[str, Callable[[Array, dict[str, Array], Array, dict[str, Array]], _Pair]] = {
    "+": _plus,
    "-": _minus,
    "*": _times,
    "/": _over,
    "**": _raised,
}


def linear_unknowns(expression: Expression, unknowns: tuple[str, ...]) -> tuple[str, ...]:
    """Unknowns of the formula in which it is linear, all of them together.

    Of two that multiply each other the one declared first counts as linear.
    """
    present, curved, multiplied = _interplay(expression.root, frozenset(unknowns))
    linear: list[str] = []
    for name in (each for each in unknowns if each in present):
        pairs = {frozenset((name, other)) for other in linear}
        if name not in curved and not pairs & multiplied:
            linear.append(name)
    return tuple(linear)


_Interplay = tuple[frozenset[str], frozenset[str], frozenset[frozenset[str]]]
"""Unknowns in a node, those not linear, and pairs that multiply each other."""


def _interplay(node: Node, unknowns: frozenset[str]) -> _Interplay:
    if node.what == "name" and node.text in unknowns:
        return frozenset((node.text,)), frozenset(), frozenset()
    parts = [_interplay(part, unknowns) for part in node.parts]
    inside = frozenset[str]().union(*(part[0] for part in parts))
    curved = frozenset[str]().union(*(part[1] for part in parts))
    pairs = frozenset[frozenset[str]]().union(*(part[2] for part in parts))
    if node.text == "where":
        condition = parts[0][0]
        free = (parts[1][0] | parts[2][0]) - condition
        pairs |= {frozenset((a, b)) for a in condition for b in free}
        return inside, curved | condition, pairs
    if node.what in ("function", "**", "compare"):
        return inside, inside, pairs
    if node.what in ("*", "/"):
        one, other = parts[0][0], parts[1][0]
        curved |= (one & other) | (other if node.what == "/" else frozenset())
        pairs |= {frozenset((a, b)) for a in one for b in other if a != b}
    return inside, curved, pairs


def jumping_unknowns(expression: Expression, unknowns: Sequence[str]) -> frozenset[str]:
    """Unknowns in a comparison, a ``step`` or a ``sign``: no derivative moves them."""
    found: set[str] = set()
    waiting = [(expression.root, False)]
    while waiting:
        node, inside = waiting.pop()
        if inside and node.what == "name" and node.text in unknowns:
            found.add(node.text)
        jumps = node.what == "compare" or (node.what == "function" and node.text in JUMPING)
        waiting += [(part, inside or jumps) for part in node.parts]
    return frozenset(found)


def vanishes_without(expression: Expression, linear: tuple[str, ...]) -> bool:
    """Whether every term contains one of the unknowns ``linear``: no unknown, no effect."""
    return _has_factor(expression.root, frozenset(linear))


def _has_factor(node: Node, linear: frozenset[str]) -> bool:
    if node.what == "name":
        return node.text in linear
    if node.what == "number":
        return float(node.text) == 0.0
    inside = [_has_factor(part, linear) for part in node.parts]
    if node.text == "where":
        return all(inside[1:])
    if node.what in ("+", "-") or node.text in ("max", "min"):
        return all(inside)
    if node.what == "*":
        return any(inside)
    return node.what in ("neg", "/") and inside[0]
