"""Physical effects as components, one file each; :func:`catalogue` finds them."""

import pkgutil
from functools import lru_cache
from importlib import import_module

from calib.effects.component import Effect, Signature, Situation
from calib.effects.of_one_run import OfOneRun, of_one_run
from calib.errors import BadInput
from calib.mechanism.description import Machine
from calib.unknown import Unknown

__all__ = [
    "Effect",
    "Signature",
    "Situation",
    "Unknown",
    "catalogue",
    "effect_named",
    "is_shipped",
    "not_defined",
]


@lru_cache(maxsize=1)
def _shipped() -> tuple[Effect, ...]:
    found: list[Effect] = []
    for module in sorted(pkgutil.iter_modules(__path__), key=lambda info: info.name):
        found += getattr(import_module(f"{__name__}.{module.name}"), "EFFECTS", ())
    return tuple(found)


def catalogue(machine: Machine) -> tuple[Effect, ...]:
    """Every shipped effect that is defined for ``machine``, in the order of their identifiers."""
    return tuple(sorted((e for e in _shipped() if e.applies(machine)), key=lambda e: e.id))


def not_defined(machine: Machine) -> dict[str, str]:
    """Every other shipped effect, and what the machine lacks for it."""
    reasons = {effect.id: effect.lacking(machine) for effect in _shipped()}
    return {name: reason for name, reason in sorted(reasons.items()) if reason}


def is_shipped(identifier: str) -> bool:
    """Tell whether an identifier is that of a shipped effect, on whatever machine."""
    return any(effect.id == identifier for effect in _shipped())


def effect_named(identifier: str, machine: Machine) -> Effect:
    """Find an effect, ``backlash``, or ``backlash@2`` for the second of several runs alone.

    Raises BadInput for one that the machine does not have.
    """
    if (asked := of_one_run(identifier)) is not None:
        alone = OfOneRun(effect_named(asked[0], machine), asked[1])
        if why := alone.lacking(machine):
            raise BadInput(
                f"{asked[0]} cannot be of one run: {why}", remedy=f"Name {asked[0]} for all"
            )
        return alone
    here = {effect.id: effect for effect in catalogue(machine)}
    if identifier in here:
        return here[identifier]
    lacking = not_defined(machine).get(identifier)
    raise BadInput(
        f"the effect {identifier!r} is not defined for the machine {machine.name}: {lacking}"
        if lacking
        else f"unknown effect {identifier!r}",
        remedy=f"Known for {machine.name}: {', '.join(here)}",
    )
