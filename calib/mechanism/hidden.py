"""Error sources that a machine has but that are not calibrated: its hidden parameters."""

from collections.abc import Callable
from dataclasses import replace

from calib.mechanism.description import Element, Limb, Machine


def with_hidden_apart(machine: Machine) -> Machine:
    """The machine without its hidden parameters, and with itself as its ``detailed`` version."""
    parameters = sorted(machine.parameters, key=lambda p: p.hidden)
    visible = sum(not p.hidden for p in parameters)
    if visible == len(parameters):
        return machine
    where = {machine.parameters.index(p): k for k, p in enumerate(parameters)}

    def moved(element: Element) -> Element:
        terms = [
            replace(t, index=where[t.index]) if t.kind == "parameter" else t for t in element.terms
        ]
        return replace(element, terms=tuple(terms))

    def folded(element: Element) -> Element:
        hidden = [t for t in element.terms if t.kind == "parameter" and t.index >= visible]
        constant = element.constant + sum(t.factor * parameters[t.index].nominal for t in hidden)
        terms = tuple(t for t in element.terms if t not in hidden)
        return replace(element, constant=constant, terms=terms)

    def changed(limbs: tuple[Limb, ...], how: Callable[[Element], Element]) -> tuple[Limb, ...]:
        return tuple(replace(b, elements=tuple(how(e) for e in b.elements)) for b in limbs)

    limbs = changed(machine.limbs, moved)
    detailed = replace(machine, parameters=tuple(parameters), limbs=limbs)
    return replace(
        machine,
        parameters=tuple(parameters[:visible]),
        limbs=changed(limbs, folded),
        detailed=detailed,
    )
