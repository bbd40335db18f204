"""The grammar of operators' formulas, and their parser: what is not in it does not exist.

    condition = sum [("<" | "<=" | ">" | ">=" | "==" | "!=") sum]
    sum       = product (("+" | "-") product)*
    product   = power (("*" | "/") power)*
    power     = ("+" | "-") power | atom ["**" power]
    atom      = number | name | name "[" (name | number) "]" | "(" condition ")"
              | function "(" condition ("," condition)* ")" | label "(" text ")"

Length, number of parts, depth and constants are bounded: a formula is read and evaluated in a time
that nobody notices, whatever is written.
"""

import re
from dataclasses import dataclass

import numpy as np

from calib.errors import BadInput
from calib.formulas.functions import CONSTANTS, FUNCTIONS, LABELS, OWN, SEVERAL

LONGEST = 2000
MOST_PARTS = 400
"""Numbers, names and signs in a formula."""
DEEPEST = 60
LARGEST = 1e100
"""Constants beyond are no physics."""

COMPARISONS = ("<", "<=", ">", ">=", "==", "!=")
_TOKEN = re.compile(
    r"\s*(?:(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)"
    r"|(?P<name>[A-Za-z_][A-Za-z_0-9]*)"
    r"|(?P<text>\"[^\"]*\"|'[^']*')"
    r"|(?P<sign>\*\*|<=|>=|==|!=|[-+*/(),<>\[\]]))"
)


@dataclass(frozen=True)
class Node:
    """A part of a formula: ``what`` is number, name, function or an operator; ``at`` its column.

    ``s[leg4]`` and ``nest("3")`` are names.
    """

    what: str
    at: int
    text: str = ""
    parts: tuple["Node", ...] = ()


def parse(text: str, place: str) -> Node:
    """Parse a formula; raises BadInput naming ``place`` and the column of the fault."""
    if not text.strip() or len(text) > LONGEST:
        raise BadInput(
            "the expression is empty" if not text.strip() else "the expression is too long",
            place=place,
            remedy=f'Write a formula such as "k * s**2", of at most {LONGEST} characters',
        )
    parser = _Parser(text, place)
    root = parser.condition()
    kind, found, column = parser.tokens[parser.next]
    if kind != "end":
        raise parser.error(column, f'"{found}" where an operator should be')
    parser.constant(root)
    return root


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
        counted = [column for kind, part, column in self.tokens if part not in ("+", "-")]
        if len(counted) > MOST_PARTS:
            raise self.error(counted[MOST_PARTS], f"there are more than {MOST_PARTS} parts")
        self.tokens.append(("end", "", len(text) + 1))
        self.next = 0

    def error(self, column: int, what: str) -> BadInput:
        shown = self.text if len(self.text) <= 200 else f"{self.text[:200]} ..."
        return BadInput(
            f"{what} (column {column} of the expression {shown!r})",
            place=self.place,
            remedy="Expected numbers, names, + - * / **, comparisons, brackets and the functions "
            + ", ".join((*FUNCTIONS, *SEVERAL, *LABELS)),
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

    def condition(self) -> Node:
        self.depth += 1
        if self.depth > DEEPEST:
            raise self.error(self.tokens[self.next][2], "brackets are nested too deeply")
        node = self.sum()
        if sign := self.take(*COMPARISONS):
            node = Node("compare", sign[1], sign[0], (node, self.sum()))
        self.depth -= 1
        return node

    def sum(self) -> Node:
        node = self.product()
        while sign := self.take("+", "-"):
            node = Node(sign[0], sign[1], parts=(node, self.product()))
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
            node = self.condition()
            self.must(")", f'the bracket of column {column} should close with ")"')
            return node
        if kind == "number":
            self.next += 1
            return Node("number", column, text)
        if kind != "name":
            found = f'"{text}"' if text else "the end"
            raise self.error(column, f"{found} where a number or a name should be")
        self.next += 1
        if bracket := self.take("["):
            return self.indexed(text, column, bracket[1])
        if self.take("("):
            return self.called(text, column)
        if (text in FUNCTIONS or text in SEVERAL or text in LABELS) and text not in OWN:
            raise self.error(column, f"the function {text} needs its argument in brackets")
        return Node("name", column, text)

    def indexed(self, text: str, column: int, bracket: int) -> Node:
        """``s[leg4]``, ``s["leg4"]`` or ``s[4]``: the same of a particular actuator."""
        kind, which, at = self.tokens[self.next]
        which = which.strip("\"'") if kind == "text" else which
        named = kind in ("name", "text") and bool(re.fullmatch(r"\w+", which))
        if text not in OWN or not (named or (which.isdigit() and int(which) > 0)):
            what = f"{text} has no actuators" if text not in OWN else "no actuator is named"
            raise self.error(bracket, what)
        self.next += 1
        self.must("]", f'the bracket of column {at} should close with "]"')
        return Node("name", column, f"{text}{which}" if which.isdigit() else f"{text}[{which}]")

    def called(self, text: str, column: int) -> Node:
        if text in LABELS:
            kind, label, at = self.tokens[self.next]
            if kind != "text":
                raise self.error(at, f"the label of a {text} should stand here in quotation marks")
            self.next += 1
            self.must(")", f'{text}(...) should close with ")": it takes one label')
            return Node("name", column, f'{text}("{label[1:-1]}")')
        least, most = SEVERAL.get(text, (1, 1))
        if text not in FUNCTIONS and text not in SEVERAL:
            raise self.error(column, f'there is no function "{text}"')
        arguments = [self.condition()]
        while len(arguments) < most and self.take(","):
            arguments.append(self.condition())
        takes = "one argument" if most == 1 else f"{least} to {most} arguments"
        takes = f"{least} arguments" if least == most > 1 else takes
        if len(arguments) < least:
            self.must(",", f"{text}(...) should go on: it takes {takes}")
        self.must(")", f'{text}(...) should close with ")": it takes {takes}')
        return Node("function", column, text, tuple(arguments))

    def constant(self, node: Node) -> float | None:
        """Value of a part without a name in it; a size that nothing has is refused."""
        if node.what == "number":
            value: float | None = float(node.text)
        elif node.what == "name":
            value = CONSTANTS.get(node.text)
        else:
            parts = [self.constant(part) for part in node.parts]
            known = [part for part in parts if part is not None]
            if len(known) < len(parts) or node.what not in ("neg", "+", "-", "*", "/", "**"):
                return None
            value = _constant(node.what, known)
        if value is not None and not abs(value) < LARGEST:
            raise self.error(node.at, "a constant part of it is too large, or no number")
        return value


def _constant(what: str, parts: list[float]) -> float:
    one, other = np.float64(parts[0]), np.float64(parts[-1])
    with np.errstate(all="ignore"):
        match what:
            case "neg":
                return float(-one)
            case "+":
                return float(one + other)
            case "-":
                return float(one - other)
            case "*":
                return float(one * other)
            case "/":
                return float(one / other)
            case _:
                return float(one**other)
