"""Where effects apply, and what those that do not apply lack; nothing hangs on a name."""

from dataclasses import replace

import numpy as np
import pytest
from effects_rows import readings_of, rows_of, start_of

from app.files.machines import load_machine, shipped_machines
from calib.effects import catalogue, effect_named, not_defined
from calib.errors import BadInput
from calib.model import Model

SHIPPED = shipped_machines()
EVERY = {effect.id for name in SHIPPED for effect in catalogue(load_machine(name))}
EVERY |= not_defined(load_machine("arm")).keys()


@pytest.mark.parametrize("name", SHIPPED)
def test_an_effect_applies_or_says_what_is_lacking(name: str) -> None:
    machine = load_machine(name)
    here, lacking = {effect.id for effect in catalogue(machine)}, not_defined(machine)
    assert not here & lacking.keys()
    assert here | lacking.keys() == EVERY
    for identifier, why in lacking.items():
        with pytest.raises(BadInput, match="not defined for the machine") as caught:
            effect_named(identifier, machine)
        assert why in str(caught.value)


@pytest.mark.parametrize("name", SHIPPED)
def test_parts_are_made_of_the_unknowns(name: str) -> None:
    rows = readings_of(name)
    for effect in catalogue(rows.machine):
        linear = [k for k, u in enumerate(effect.unknowns(rows)) if not u.nonlinear]
        for part in effect.parts(rows):
            assert set(part) < set(linear)


def test_nothing_hangs_on_the_names_of_parameters_joints_and_limbs() -> None:
    """The hexapod with every name changed has the same effects, with the same columns."""
    machine = load_machine("hexapod")
    renamed = replace(
        machine,
        parameters=tuple(replace(p, name=f"x{k}") for k, p in enumerate(machine.parameters)),
        limbs=tuple(
            replace(
                limb,
                name=f"b{k}",
                joints=tuple(replace(j, name=f"j{n}") for n, j in enumerate(limb.joints)),
            )
            for k, limb in enumerate(machine.limbs)
        ),
        actuators=tuple(replace(a, reference=230.715) for a in machine.actuators),
    )
    assert [e.id for e in catalogue(renamed)] == [e.id for e in catalogue(machine)]
    own, other = rows_of(machine), rows_of(renamed)
    for effect in catalogue(machine):
        if effect.kind == "machine":
            one, two = Model(own, [effect]), Model(other, [effect_named(effect.id, renamed)])
            np.testing.assert_array_equal(
                one.linearise(start_of(one)).jacobian, two.linearise(start_of(two)).jacobian
            )
