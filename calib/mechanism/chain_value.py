"""The value of an element of a chain: a sum of products, each with one variable at most.

-2*e+15d             numbers and names; d or deg for degrees
5mm/turn*q+L0        a motor behind a screw: the ratio has a unit, the product is in mm
gear*q               the same with gear = "0.01" or "5 mm/turn" in the table of the limb
"""

import re
from collections.abc import Callable
from dataclasses import dataclass

from calib.errors import BadInput
from calib.mechanism.description import Term
from calib.quantity import is_quantity, measured, product_unit

_DIGITS = r"(?:\d++\.?\d*+|\.\d++)"
_FACTOR = rf"(?:{_DIGITS}[eE][+-]\d+[A-Za-z/]*|[^+\-*]+)"
_PRODUCT = re.compile(rf"([+-]?)({_FACTOR}(?:\*{_FACTOR})*)")


@dataclass(frozen=True)
class Meant:
    """What a name stands for: a variable or a constant, in ``unit`` ("" for a bare number)."""

    value: Term | float
    unit: str


Resolve = Callable[[str, str], Meant]
"""(name, place) -> what it means; raises BadInput for a name that means nothing."""


@dataclass(frozen=True)
class Value:
    """A sum: its constant, its terms, and the names in it with what each is multiplied by."""

    constant: float
    terms: list[Term]
    names: list[tuple[str, float]]


def read_value(text: str, unit: str, place: str, resolve: Resolve) -> Value:
    """A value in ``unit`` ("mm" or "rad"; "" takes any).

    Raises
    ------
    BadInput
        For text that is no sum of products, and for products that are in another unit.
    """
    constant, terms, names, end = 0.0, [], list[tuple[str, float]](), 0
    for found in _PRODUCT.finditer(text):
        if found.start() != end or (end and not found[1]):
            break
        end = found.end()
        factor, variable, own, named = _product(found[2], place, resolve)
        sign = -1.0 if found[1] == "-" else 1.0
        factor *= sign
        names += [(name, sign * rest) for name, rest in named]
        if own != unit and unit and not (variable is None and not own):
            raise _mismatch(found[2], variable, own, unit, place)
        if variable is None:
            constant += factor
        else:
            terms.append(Term(variable.kind, variable.index, factor * variable.factor))
    if end != len(text):
        raise BadInput(
            f'cannot read the value "{text}"',
            place=place,
            remedy="A value is a sum of products: q+L0, -P_x, 2*e, 15d, 5mm/turn*q.",
        )
    return Value(constant, terms, names)


def _product(
    text: str, place: str, resolve: Resolve
) -> tuple[float, Term | None, str, list[tuple[str, float]]]:
    """Number, variable and unit of a product, and its names with the rest of it."""
    factor, variable, units = 1.0, None, []
    named: list[tuple[str, float]] = []
    for name in re.findall(_FACTOR, text):
        if is_quantity(name):
            number, unit = measured(name, place)
            meant = Meant(number, unit)
        else:
            meant = resolve(name, place)
            named.append((name, factor))
        units.append(meant.unit)
        if isinstance(meant.value, float):
            factor *= meant.value
            named = [(n, r if n == name else r * meant.value) for n, r in named]
        elif variable is None:
            variable = meant.value
        else:
            raise BadInput(
                f'"{text}" is the product of two variables',
                place=place,
                remedy="A product holds one parameter, actuator or joint; the rest are numbers.",
            )
    return factor, variable, product_unit(units), named


def _mismatch(text: str, variable: Term | None, own: str, unit: str, place: str) -> BadInput:
    if variable is None:
        return BadInput(
            f'"{text}" does not measure what is asked for here',
            place=place,
            remedy=f"A value in {unit} is expected.",
        )
    ratio = {("rad", "mm"): "5mm/turn", ("mm", "rad"): "1turn/5mm"}.get((own, unit))
    return BadInput(
        f"{text} is in {own or 'no unit'}, a value in {unit} is needed",
        place=place,
        remedy=f"Give the ratio with its unit: {ratio}*{text}." if ratio else "",
    )
