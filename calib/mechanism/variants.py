"""Closures of an over-constrained machine other than its own, by the names in its file.

::

    [closure.D3]
    release = ["limb3"]                         # its constraint is dropped
    [closure.LS.rows]                           # unit forces, one for each wrench of the limb
    limb1 = [{ idle = "6da5" }, { idle = "q1", spans = ["q1", "theta_5"], at = "theta_2" }]

A row of a limb with two wrenches does no work on ``idle``; ``spans`` and ``at`` scale it by the
area that the velocities of two joints span at the axis of a third.
They exist to reproduce published numbers; a machine closes by its compliances unless asked.
"""

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from calib.errors import BadInput
from calib.mechanism.description import Limb, Machine, PublishedRow


def closure_names(machine: Machine) -> list[str]:
    """Names of the other closures that the machine's file describes."""
    table = machine.extra.get("closure", {})
    return list(table) if isinstance(table, dict) else []


def with_closure(machine: Machine, name: str) -> Machine:
    """The same machine, closed as ``[closure.NAME]`` of its file says.

    Raises
    ------
    BadInput
        If the file describes no such closure, or describes it wrongly.
    """
    table: Any = machine.extra.get("closure", {})
    place = f"{machine.source}, [closure.{name}]"
    if not isinstance(table, dict) or not isinstance(table.get(name), dict):
        raise BadInput(
            f'machine "{machine.name}" describes no closure "{name}"',
            place=machine.source,
            remedy=f"It has {', '.join(closure_names(machine)) or 'none'} beside its own.",
        )
    chosen: dict[str, Any] = table[name]
    _known(chosen, ("says", "release", "rows"), place)
    released, rows = chosen.get("release", []), chosen.get("rows")
    if not isinstance(released, list) or not isinstance(rows or {}, dict):
        raise BadInput(
            "release is a list of limbs and rows a table",
            place=place,
            remedy='Write release = ["limb3"], or rows = { limb1 = [{ idle = "6da5" }, ...] }.',
        )
    names = tuple(limb.name for limb in machine.limbs)
    _known(dict.fromkeys(released), names, place)
    _known(rows or {}, names, place)
    limbs = tuple(
        replace(
            limb,
            released=limb.name in released,
            published_rows=None if rows is None else _rows(machine, limb, rows, place),
        )
        for limb in machine.limbs
    )
    return replace(machine, limbs=limbs)


def _rows(
    machine: Machine, limb: Limb, rows: Mapping[str, Any], place: str
) -> tuple[PublishedRow, ...]:
    """The rows of one limb; a limb that carries one wrench needs no description."""
    wrenches = 6 - len(limb.joints)
    given = rows.get(limb.name, [{}] if wrenches == 1 else [])
    if (
        len(given) != wrenches
        or wrenches > 2
        or any(("idle" in g) != (wrenches == 2) for g in given)
    ):
        raise BadInput(
            f"{limb.name} carries {wrenches} wrenches, {len(given)} rows are described",
            place=place,
            remedy="A limb of two wrenches needs two rows, each with idle = NAME.",
        )
    elements = _elements(machine, limb)
    found = []
    for row in given:
        _known(row, ("idle", "spans", "at"), place)
        names = [*row.get("spans", []), *([row["at"]] if "at" in row else [])]
        _known(
            dict.fromkeys([*names, *([row["idle"]] if "idle" in row else [])]),
            tuple(elements),
            place,
        )
        if len(names) not in (0, 3):
            raise BadInput(
                "spans and at do not name three joints",
                place=place,
                remedy='Write spans = ["q1", "theta_5"], at = "theta_2".',
            )
        spans = (elements[names[0]], elements[names[1]], elements[names[2]]) if names else None
        found.append(PublishedRow(elements[row["idle"]] if "idle" in row else None, spans))
    return tuple(found)


def _elements(machine: Machine, limb: Limb) -> dict[str, int]:
    """Names of a limb's parameters, actuators and joints -> element of its chain."""
    names: dict[str, int] = {}
    for k, element in enumerate(limb.elements):
        for term in element.terms:
            if term.kind == "parameter":
                full = machine.parameters[term.index].name
                names.setdefault(full.removeprefix(f"{limb.name}."), k)
            elif term.kind == "actuator":
                names.setdefault(machine.actuators[term.index].name, k)
            else:
                names.setdefault(limb.joints[term.index - limb.first_joint].name, k)
    return names


def _known(given: Mapping[str, object], allowed: Sequence[str], place: str) -> None:
    for name in given:
        if name not in allowed:
            near = difflib.get_close_matches(name, allowed, 1)
            raise BadInput(
                f'"{name}" is not known here',
                place=place,
                remedy=f'Did you mean "{near[0]}"?' if near else f"Known: {', '.join(allowed)}.",
            )
