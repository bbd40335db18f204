"""An operator's own effect: a TOML file with a formula, no change to the program.

    [effect]
    id = "screw-quadratic"
    says = "the screw's pitch changes along its length"
    acts_on = "actuator"              # adds to each actuator's extension; or "point"
    expression = "k * s**2"
    unknowns = { k = "1/mm" }         # one for each actuator unless shared = true

For actuators the formula may use ``s``, ``q``, ``l`` (commanded extension, coordinate, length of
that actuator), ``direction`` and ``step`` of its last move, the same of a particular one (``s1``,
``q2`` ...), ``t`` (s from the start of the run) and any channel by its column's name. For points
(tracker frame, mm) there are ``x``, ``y``, ``z``, ``range``, ``azimuth``, ``elevation``, ``t`` and
the channels; one formula acts along the line of sight, a list of three along x, y and z.

``axes = ["leg1", "leg4"]`` leaves all other actuators alone: where linear and rotary ones are
mixed, an unknown has a unit only among actuators of one unit.

An unknown in which the formula is not linear is searched for and needs a range:
``tau = { unit = "s", from = 1, to = 100 }``; ``size`` (how large it may reasonably be) and
``sigma`` (a prior) may be given too.
"""

import math
import re
from typing import Any

from calib.effects.component import Kind
from calib.errors import BadInput
from calib.formulas.expression import (
    CONSTANTS,
    FUNCTIONS,
    Expression,
    parse_expression,
    vanishes_without,
)
from calib.formulas.formula_effect import NUMBERED, OWN, POINT, TRIALS, OperatorEffect
from calib.toml_place import line_of, load_toml
from calib.unknown import Unknown

KINDS = ("machine", "measurement")
_RANGE = ("from", "to")


def effect_from_text(text: str, source: str) -> OperatorEffect:
    """Read an operator's effect file.

    Parameters
    ----------
    text : str
        TOML, see the module's text.
    source : str
        Name of the file, for messages.

    Raises
    ------
    BadInput
        Naming file, line and, for a fault in a formula, its column.
    """
    table = load_toml(text, source).get("effect")
    if not isinstance(table, dict):
        raise BadInput("there is no table [effect]", place=source, remedy="Begin with [effect]")
    read = _Reader(table, text, source)
    acts_on = read.text("acts_on", "actuator", ("actuator", "point"))
    usual = "machine" if acts_on == "actuator" else "measurement"
    kind: Kind = "machine" if read.text("kind", usual, KINDS) == "machine" else "measurement"
    declared = read.unknowns()
    expressions = read.expressions(acts_on)
    effect = OperatorEffect(
        read.identifier(), read.text("says", "an operator's own effect"), kind,
        expressions, declared, read.flag("shared"), acts_on, source, read.axes(acts_on),
    )  # fmt: skip
    _check(effect, declared, read)
    return effect


def _check(effect: OperatorEffect, declared: tuple[Unknown, ...], read: "_Reader") -> None:
    """Every unknown is used, does something linear or has a range, and zero means no effect."""
    for one in declared:
        if not any(one.name in expression.names for expression in effect.expressions):
            raise read.fault("unknowns", f"the unknown {one.name!r} is not in the expression")
    for one in effect.searched:
        if one.bounds is None:
            raise read.fault(
                "unknowns",
                f"the expression is not linear in {one.name!r}",
                f'It must be searched: {one.name} = {{ unit = "{one.unit}", from = 1, to = 100 }}',
            )
    linear = tuple(one.name for one in effect.linear)
    for expression in effect.expressions:
        if expression.text.strip() not in ("0", "0.0") and not vanishes_without(expression, linear):
            raise read.fault(
                "expression",
                f"the expression {expression.text!r} has a term without a linear unknown",
                "With its unknowns at zero an effect must do nothing: multiply every term by one",
            )


class _Reader:
    """The table [effect] of a file, every fault with its line."""

    def __init__(self, table: dict[str, Any], text: str, source: str) -> None:
        self.table, self.source, self.whole = table, source, text
        known = {"id", "says", "acts_on", "expression", "unknowns", "shared", "kind", "axes"}
        for key in table:
            if key not in known:
                raise self.fault(key, f"unknown key {key!r}", f"Known: {', '.join(sorted(known))}")

    def fault(self, key: str, what: str, remedy: str = "") -> BadInput:
        return BadInput(what, place=self.place(key), remedy=remedy)

    def place(self, key: str) -> str:
        return f"{self.source}, line {line_of(self.whole, 'effect', key)}, {key}"

    def text(self, key: str, default: str, choice: tuple[str, ...] = ()) -> str:
        value = self.table.get(key, default)
        if not isinstance(value, str) or not value.strip() or (choice and value not in choice):
            expected = " or ".join(choice) if choice else "text"
            raise self.fault(key, f"{key} is {value!r}", f"Expected {expected}")
        return value

    def identifier(self) -> str:
        value = self.table.get("id", "")
        if not isinstance(value, str) or not re.fullmatch(r"[a-z][a-z0-9-]*", value):
            raise self.fault(
                "id", f"id is {value!r}", "Expected small letters, digits and hyphens: my-effect"
            )
        return value

    def flag(self, key: str) -> bool:
        value = self.table.get(key, False)
        if not isinstance(value, bool):
            raise self.fault(key, f"{key} is {value!r}", "Expected true or false")
        return value

    def axes(self, acts_on: str) -> tuple[str, ...]:
        value = self.table.get("axes", [])
        if not isinstance(value, list) or not all(isinstance(one, str) for one in value):
            raise self.fault("axes", f"axes is {value!r}", 'Write axes = ["leg1", "leg4"]')
        if value and acts_on != "actuator":
            raise self.fault("axes", "a point has no axes", "Leave axes out")
        return tuple(dict.fromkeys(value))

    def expressions(self, acts_on: str) -> tuple[Expression, ...]:
        value = self.table.get("expression")
        whole = value if isinstance(value, list) else [value]
        given = [one for one in whole if isinstance(one, str)]
        if len(given) != len(whole) or len(given) not in (1, 3):
            raise self.fault("expression", f"expression is {value!r}", 'Write "k * s**2"')
        if len(given) == 3 and acts_on != "point":
            raise self.fault(
                "expression", "three expressions are for points", "Give one for actuators"
            )
        return tuple(parse_expression(one, self.place("expression")) for one in given)

    def unknowns(self) -> tuple[Unknown, ...]:
        table = self.table.get("unknowns")
        if not isinstance(table, dict) or not table:
            raise self.fault("unknowns", "no unknowns are declared", 'Write { k = "1/mm" }')
        return tuple(self._unknown(name, value) for name, value in table.items())

    def _unknown(self, name: str, value: object) -> Unknown:
        taken = {*OWN, *POINT, *FUNCTIONS, *CONSTANTS, "t"}
        if not re.fullmatch(r"[A-Za-z_]\w*", name) or name in taken or NUMBERED.fullmatch(name):
            raise self.fault("unknowns", f"an unknown cannot be called {name!r}", "Rename it")
        if isinstance(value, str):
            return Unknown(name, value, steps=TRIALS)
        if not isinstance(value, dict) or not isinstance(value.get("unit", ""), str):
            raise self.fault("unknowns", f"{name} is {value!r}", f'Write {name} = "its unit"')
        extra = set(value) - {"unit", "size", "sigma", "from", "to", "steps"}
        if extra:
            raise self.fault("unknowns", f"{name} has an unknown key {min(extra)!r}")
        size, sigma = (self._number(name, key, value.get(key)) for key in ("size", "sigma"))
        low, high = (self._number(name, key, value.get(key), any_sign=True) for key in _RANGE)
        if (low is None) != (high is None) or (
            low is not None and high is not None and low >= high
        ):
            raise self.fault("unknowns", f"{name}: from and to are no range", "Give from < to")
        steps = value.get("steps", TRIALS)
        if not isinstance(steps, int) or isinstance(steps, bool) or not 2 <= steps <= 400:
            raise self.fault("unknowns", f"{name}: steps is {steps!r}", "Expected 2 to 400")
        bounds = None if low is None or high is None else (low, high)
        return Unknown(
            name,
            value.get("unit", "1"),
            math.nan if size is None else size,
            sigma,
            bounds=bounds,
            steps=steps,
        )

    def _number(self, name: str, key: str, value: object, any_sign: bool = False) -> float | None:
        if value is None:
            return None
        good = isinstance(value, int | float) and not isinstance(value, bool)
        if good and math.isfinite(float(value)) and (any_sign or float(value) > 0):  # type: ignore[arg-type]
            return float(value)  # type: ignore[arg-type]
        raise self.fault("unknowns", f"{name}: {key} is {value!r}", "Expected a positive number")
