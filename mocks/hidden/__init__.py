"""Hidden effects of the mock machines, one file each; :func:`effects` finds them."""

import pkgutil
from functools import cache
from importlib import import_module

from mocks.hidden.effect import HiddenEffect


@cache
def effects() -> tuple[HiddenEffect, ...]:
    """Everything that can be wrong with a mock machine, in the order of identifiers."""
    found: list[HiddenEffect] = []
    for module in sorted(pkgutil.iter_modules(__path__), key=lambda info: info.name):
        found += getattr(import_module(f"{__name__}.{module.name}"), "EFFECTS", ())
    return tuple(sorted(found, key=lambda effect: effect.id))


def effects_of(machine: str) -> tuple[HiddenEffect, ...]:
    """Those that this mock machine can have."""
    return tuple(effect for effect in effects() if machine in effect.machines)
