"""Laws of every effect on every shipped machine where it applies."""

from dataclasses import replace

import numpy as np
import pytest
from effects_rows import readings_of, rows_of, start_of

from app.files.machines import load_machine, shipped_machines
from calib.effects import catalogue, effect_named, not_defined
from calib.errors import BadInput
from calib.model import Model

SHIPPED = shipped_machines()
PAIRS = [(name, effect.id) for name in SHIPPED for effect in catalogue(load_machine(name))]

EVERY = {effect for _, effect in PAIRS} | not_defined(load_machine("arm")).keys()


@pytest.mark.parametrize(("name", "identifier"), PAIRS, ids=[f"{m}-{e}" for m, e in PAIRS])
def test_columns_agree_with_differences(name: str, identifier: str) -> None:
    rows = readings_of(name)
    machine = rows.machine
    effect = effect_named(identifier, machine)
    assert effect.unavailable(rows) == ""
    model = Model(rows, [effect])
    unknowns, trials = model.unknowns[0], list(effect.trials(rows))
    generator = np.random.default_rng(7)
    # Small amplitudes, since an effect's shape moves with the pose that it moves; but a period or
    # a time constant can only be seen where there is something to be seen.
    share = 1.0 if any(u.nonlinear for u in unknowns) else 0.01
    small = [share * u.size * generator.normal() for u in unknowns]
    trial = iter(trials[len(trials) // 3])
    values = [next(trial) if u.nonlinear else v for u, v in zip(unknowns, small, strict=True)]
    linear = model.linearise(start_of(model, np.array(values)))
    for index, unknown in enumerate(unknowns):
        if unknown.nonlinear and identifier in ("frame-shift", "redundancy"):
            continue  # a moment, a limb: searched, never differentiated
        step = np.zeros(model.prior.size)
        size = 1e-5 * values[index] if unknown.nonlinear else 1e-3 * unknown.size
        step[model.free.size + index] = size
        ahead, back = (
            model.predict(model.moved(linear.state, sign * step)) for sign in (1.0, -1.0)
        )
        slope = np.einsum("ijn,jn->in", rows.whitener, ahead - back) / (2.0 * size)
        own = linear.jacobian[model.free.size + index]
        assert np.abs(own).max() > 0.0 or unknown.nonlinear, unknown.name
        np.testing.assert_allclose(
            own, slope, atol=2e-3 * np.abs(own).max() + 1e-6, err_msg=unknown.name
        )


@pytest.mark.parametrize("name", SHIPPED)
def test_names_are_unique_and_parts_are_unknowns(name: str) -> None:
    rows = readings_of(name)
    machine = rows.machine
    effects = catalogue(machine)
    names = [unknown.name for effect in effects for unknown in effect.unknowns(rows)]
    assert len(set(names)) == len(names)
    for effect in effects:
        count = len(effect.unknowns(rows))
        assert all(0 <= index < count for part in effect.parts(rows) for index in part)
        assert all(own.name.startswith(f"{effect.id}.") for own in effect.unknowns(rows))


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
        actuators=tuple(
            replace(a, reference=230.715) if isinstance(a.reference, str) else a
            for a in machine.actuators
        ),
    )
    assert [e.id for e in catalogue(renamed)] == [e.id for e in catalogue(machine)]
    for effect in catalogue(machine):
        if effect.kind == "machine":
            one, other = (
                Model(rows := rows_of(m), [effect_named(effect.id, m)]).linearise(
                    start_of(Model(rows, [effect_named(effect.id, m)]))
                )
                for m in (machine, renamed)
            )
            np.testing.assert_array_equal(one.jacobian, other.jacobian)
