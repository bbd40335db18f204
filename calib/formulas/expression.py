"""Formulas that an operator writes: parsed by our own grammar, never run as Python.

    sum     = product (("+" | "-") product)*
    product = power (("*" | "/") power)*
    power   = ("+" | "-") power | atom ["**" power]
    atom    = number | name | name "(" sum ("," sum)* ")" | "(" sum ")"

There are numbers, names, the usual functions and nothing else: no attributes, no indices, no
strings. Derivatives are exact, by forward-mode differentiation: every node answers its value and
its derivative by each unknown it contains.
"""

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from calib.arrays import Array
from calib.errors import BadInput

LONGEST = 2000
DEEPEST = 60
CONSTANTS = {"pi": math.pi, "e": math.e}

_Pair = tuple[Array, dict[str, Array]]
"""A value and its derivatives by the unknowns in it."""

_TOKEN = re.compile(
    r"\s*(?:(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)"
    r"|(?P<name>[A-Za-z_][A-Za-z_0-9]*)|(?P<sign>\*\*|[-+*/(),]))"
)

FUNCTIONS: dict[str, tuple[Callable[[Array], Array], Callable[[Array], Array]]] = {
    "sin": (np.sin, np.cos),
    "cos": (np.cos, lambda x: -np.sin(x)),
    "tan": (np.tan, lambda x: 1.0 / np.cos(x) ** 2),
    "asin": (np.arcsin, lambda x: 1.0 / np.sqrt(1.0 - x**2)),
    "acos": (np.arccos, lambda x: -1.0 / np.sqrt(1.0 - x**2)),
    "atan": (np.arctan, lambda x: 1.0 / (1.0 + x**2)),
    "sinh": (np.sinh, np.cosh),
    "cosh": (np.cosh, np.sinh),
    "tanh": (np.tanh, lambda x: 1.0 - np.tanh(x) ** 2),
    "exp": (np.exp, np.exp),
    "log": (np.log, lambda x: 1.0 / x),
    "sqrt": (np.sqrt, lambda x: 0.5 / np.sqrt(x)),
    "abs": (np.abs, np.sign),
    "sign": (np.sign, np.zeros_like),
}
"""Each function of one argument with its derivative."""


@dataclass(frozen=True)
class Node:
    """A part of a formula: ``what`` is number, name, function or an operator; ``at`` its column."""

    what: str
    at: int
    text: str = ""
    parts: tuple["Node", ...] = ()


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


class _Parser:
    def __init__(self, text: str, place: str) -> None:
        self.text, self.place, self.depth = text, place, 0
        self.tokens: list[tuple[str, str, int]] = []
        at = 0
        while text[at:].strip():
            found = _TOKEN.match(text, at)
            if not found:
                column = at + len(text[at:]) - len(text[at:].lstrip()) + 1
                raise self.error(column, f'"{text[column - 1]}" has no meaning here')
            kind = found.lastgroup or ""
            self.tokens.append((kind, found[kind], found.start(kind) + 1))
            at = found.end()
        self.tokens.append(("end", "", len(text) + 1))
        self.next = 0

    def error(self, column: int, what: str) -> BadInput:
        return BadInput(
            f"{what} (column {column} of the expression {self.text!r})",
            place=self.place,
            remedy="Expected numbers, names, + - * / **, brackets and the functions "
            + ", ".join(FUNCTIONS),
        )

    def take(self, *texts: str) -> tuple[str, int] | None:
        kind, text, column = self.tokens[self.next]
        if kind == "sign" and text in texts:
            self.next += 1
            return text, column
        return None

    def must(self, text: str, why: str) -> None:
        if not self.take(text):
            _, found, column = self.tokens[self.next]
            raise self.error(column, f'"{found}" where {why}' if found else f"it ends where {why}")

    def sum(self) -> Node:
        self.depth += 1
        if self.depth > DEEPEST:
            raise self.error(self.tokens[self.next][2], "brackets are nested too deeply")
        node = self.product()
        while sign := self.take("+", "-"):
            node = Node(sign[0], sign[1], parts=(node, self.product()))
        self.depth -= 1
        return node

    def product(self) -> Node:
        node = self.power()
        while sign := self.take("*", "/"):
            node = Node(sign[0], sign[1], parts=(node, self.power()))
        return node

    def power(self) -> Node:
        negative, start = False, None
        while sign := self.take("+", "-"):
            start = start or sign[1]
            negative ^= sign[0] == "-"
        node = self.atom()
        if sign := self.take("**"):
            self.depth += 1
            if self.depth > DEEPEST:
                raise self.error(sign[1], "powers are nested too deeply")
            node = Node("**", sign[1], parts=(node, self.power()))
            self.depth -= 1
        return Node("neg", start or node.at, parts=(node,)) if negative else node

    def atom(self) -> Node:
        kind, text, column = self.tokens[self.next]
        if self.take("("):
            node = self.sum()
            self.must(")", f'the bracket of column {column} should close with ")"')
            return node
        if kind == "number":
            self.next += 1
            return Node("number", column, text)
        if kind != "name":
            found = f'"{text}"' if text else "the end"
            raise self.error(column, f"{found} where a number or a name should be")
        self.next += 1
        if not self.take("("):
            if text in FUNCTIONS:
                raise self.error(column, f"the function {text} needs its argument in brackets")
            return Node("name", column, text)
        if text not in FUNCTIONS:
            raise self.error(column, f'there is no function "{text}"')
        argument = self.sum()
        self.must(")", f'{text}(...) should close with ")": it takes one argument')
        return Node("function", column, text, (argument,))


def parse_expression(text: str, place: str) -> Expression:
    """Parse a formula.

    Raises
    ------
    BadInput
        Naming ``place`` and the column of the fault.
    """
    if not text.strip() or len(text) > LONGEST:
        raise BadInput(
            "the expression is empty" if not text.strip() else "the expression is too long",
            place=place,
            remedy=f'Write a formula such as "k * s**2", of at most {LONGEST} characters',
        )
    parser = _Parser(text, place)
    root = parser.sum()
    kind, found, column = parser.tokens[parser.next]
    if kind != "end":
        raise parser.error(column, f'"{found}" where an operator should be')
    return Expression(text, root)


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
    if node.what == "neg":
        return -value, _scaled(slopes, np.asarray(-1.0))
    if node.what == "function":
        function, derivative = FUNCTIONS[node.text]
        answer = np.asarray(function(value))
        return answer, _scaled(slopes, np.asarray(derivative(value))) if slopes else {}
    return _OPERATIONS[node.what](value, slopes, *pairs[1])


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
    if node.what in ("function", "**"):
        return inside, inside, pairs
    if node.what in ("*", "/"):
        one, other = parts[0][0], parts[1][0]
        curved |= (one & other) | (other if node.what == "/" else frozenset())
        pairs |= {frozenset((a, b)) for a in one for b in other if a != b}
    return inside, curved, pairs


def vanishes_without(expression: Expression, linear: tuple[str, ...]) -> bool:
    """Whether every term contains one of the unknowns ``linear``: no unknown, no effect."""
    return _has_factor(expression.root, frozenset(linear))


def _has_factor(node: Node, linear: frozenset[str]) -> bool:
    if node.what == "name":
        return node.text in linear
    if node.what == "number":
        return float(node.text) == 0.0
    inside = [_has_factor(part, linear) for part in node.parts]
    if node.what in ("+", "-"):
        return all(inside)
    if node.what == "*":
        return any(inside)
    return node.what in ("neg", "/") and inside[0]
