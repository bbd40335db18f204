"""An operator's own effect: a TOML file with a formula, no change to the program.

    [effect]
    id = "screw-quadratic"
    says = "the screw's pitch changes along its length"
    acts_on = "actuator"              # adds to each actuator's extension; or "point"
    expression = "k * s**2"
    unknowns = { k = "1/mm" }         # one for each actuator unless shared = true

What a formula may name is in docs/own-effects.md, and in ``functions.py``. For points one formula
acts along the line of sight, a list of three along x, y and z of ``frame`` (tracker, base or
platform).

``axes = ["leg1", "leg4"]`` leaves all other actuators alone: where linear and rotary ones are
mixed, an unknown has a unit only among actuators of one unit.

An unknown in which the formula is not linear is searched for and needs a range:
``tau = { unit = "s", from = 1, to = 100 }``; ``size`` (how large it may reasonably be) and
``sigma`` (a prior) may be given too.
"""

import math
import re

from calib.effects.component import Kind
from calib.errors import BadInput
from calib.formulas.expression import Expression, parse_expression, vanishes_without
from calib.formulas.formula_effect import OF_ONE, TRIALS, Declared, OperatorEffect
from calib.formulas.functions import CONSTANTS, FUNCTIONS, LABELS, OWN, POINT, POSE, SEVERAL
from calib.toml_table import TomlTable
from calib.unknown import Unknown

FRAMES = ("tracker", "base", "platform")
KINDS = ("machine", "measurement")


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
    return effect_of(TomlTable.parse(text, source), text, source)


def effect_of(top: TomlTable, text: str, source: str) -> OperatorEffect:
    """Read the table [effect] of a file, see :func:`effect_from_text`."""
    if not top.has("effect"):
        raise BadInput("there is no table [effect]", place=source, remedy="Begin with [effect]")
    table = top.table("effect")
    table.only("id", "says", "acts_on", "expression", "unknowns", "shared", "kind", "axes", "frame")
    acts_on = table.choice("acts_on", ("actuator", "point"), "actuator")
    usual = "machine" if acts_on == "actuator" else "measurement"
    kind: Kind = "machine" if table.choice("kind", KINDS, usual) == "machine" else "measurement"
    unknowns, shared = _unknowns(table)
    declared = Declared(
        _identifier(table),
        table.text("says", "an operator's own effect"),
        kind,
        unknowns,
        frozenset(one.name for one in unknowns) if table.flag("shared", False) else shared,
        acts_on,
        source,
        _axes(table, acts_on),
        _frame(table, acts_on),
        text,
    )
    effect = OperatorEffect(declared, _expressions(table, acts_on))
    _check(effect, unknowns, table)
    return effect


def _check(effect: OperatorEffect, declared: tuple[Unknown, ...], table: TomlTable) -> None:
    """Every unknown is used, does something linear or has a range, and zero means no effect."""
    for one in declared:
        if not any(one.name in expression.names for expression in effect.expressions):
            raise table.wrong(
                f"the unknown {one.name!r} is not in the expression",
                "unknowns",
                remedy="Write it there, or leave it out",
            )
    for one in effect.searched:
        if one.bounds is None:
            raise table.wrong(
                f"the expression is not linear in {one.name!r}",
                "unknowns",
                remedy=f"It must be searched: {one.name} = "
                f'{{ unit = "{one.unit}", from = 1, to = 100 }}',
            )
    linear = tuple(one.name for one in effect.linear)
    for name in effect.states:
        if effect.acts_on == "actuator" and name.startswith("nest("):
            raise table.wrong(
                f"an actuator does not know which nest is read: {name}",
                "expression",
                remedy='Write acts_on = "point", or leave it out',
            )
    for expression in effect.expressions:
        if expression.text.strip() not in ("0", "0.0") and not vanishes_without(expression, linear):
            raise table.wrong(
                f"the expression {expression.text!r} has a term without a linear unknown",
                "expression",
                remedy="With its unknowns at zero an effect must do nothing: "
                "multiply every term by one",
            )


def _identifier(table: TomlTable) -> str:
    value = table.text("id")
    if not re.fullmatch(r"[a-z][a-z0-9-]*", value):
        raise table.wrong(
            f"id is {value!r}", "id", remedy="Write small letters, digits and hyphens: my-effect"
        )
    return value


def _frame(table: TomlTable, acts_on: str) -> str:
    frame = table.choice("frame", FRAMES, "tracker")
    if acts_on != "point" and table.has("frame"):
        raise table.wrong("an actuator has no frame", "frame", remedy="Leave frame out")
    return frame


def _axes(table: TomlTable, acts_on: str) -> tuple[str, ...]:
    names = table.texts("axes")
    if names and acts_on != "actuator":
        raise table.wrong("a point has no axes", "axes", remedy="Leave axes out")
    return tuple(dict.fromkeys(names))


def _expressions(table: TomlTable, acts_on: str) -> tuple[Expression, ...]:
    value = table.raw("expression", "text or 3 texts", required=True)
    whole = value if isinstance(value, list) else [value]
    given = [one for one in whole if isinstance(one, str)]
    if len(given) != len(whole) or len(given) not in (1, 3):
        raise table.wrong(f"expression is {value!r}", "expression", remedy='Write "k * s**2"')
    if len(given) == 3 and acts_on != "point":
        raise table.wrong(
            "three expressions are for points", "expression", remedy="Give one for actuators"
        )
    return tuple(parse_expression(one, table.place("expression")) for one in given)


def _unknowns(table: TomlTable) -> tuple[tuple[Unknown, ...], frozenset[str]]:
    """The unknowns, and which of them are one for all actuators."""
    unknowns = table.named("unknowns", required=False)
    if not unknowns.names():
        raise table.wrong("no unknowns are declared", "unknowns", remedy='Write { k = "1/mm" }')
    found = [_unknown(unknowns, name) for name in unknowns]
    return tuple(one for one, _ in found), frozenset(one.name for one, common in found if common)


def _unknown(unknowns: TomlTable, name: str) -> tuple[Unknown, bool]:
    taken = {*OWN, *POINT, *POSE, *FUNCTIONS, *SEVERAL, *LABELS, *CONSTANTS, "t"}
    if not re.fullmatch(r"[A-Za-z_]\w*", name) or name in taken or OF_ONE.fullmatch(name):
        raise unknowns.wrong(f"an unknown cannot be called {name!r}", name, remedy="Rename it")
    value = unknowns.raw(name, "text or table")
    if isinstance(value, str):
        return Unknown(name, value, steps=TRIALS), False
    if not isinstance(value, dict):
        raise unknowns.wrong(f"{name} is {value!r}", name, remedy=f'Write {name} = "its unit"')
    about = unknowns.table(name)
    about.only("unit", "size", "sigma", "from", "to", "steps", "shared")
    size = about.optional_number("size", above=0.0)
    low, high = about.optional_number("from"), about.optional_number("to")
    if (low is None) != (high is None) or (low is not None and high is not None and low >= high):
        raise about.wrong(
            f"{name}: from and to are no range", "from", remedy="Give both, from < to"
        )
    one = Unknown(
        name,
        about.text("unit", "1"),
        math.nan if size is None else size,
        about.optional_number("sigma", above=0.0),
        bounds=None if low is None or high is None else (low, high),
        steps=about.whole("steps", TRIALS, least=2, most=400),
    )
    return one, about.flag("shared", False)
