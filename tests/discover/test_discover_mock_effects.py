"""Every effect of the catalogue, hidden by the mock's own physics, is found back with its size.

The mock shares no code with the effects (docs/architecture.md), so signs, units and reference
points are checked against independent formulas.
"""

from dataclasses import replace

import numpy as np
import pytest

from app.files.machines import load_machine
from calib.effects import effect_named
from calib.identify.signatures import columns_at
from calib.identify.staged import fit_effects
from calib.runs import parse_run
from calib.runs.stack import stack
from mocks.hidden import effects
from mocks.hidden.effect import Site
from mocks.hidden.table import Hidden
from mocks.physics.bodies import BODIES, body_named
from mocks.simulate.files import points_csv, run_toml
from mocks.simulate.plan import Profile, RunPlan
from mocks.simulate.run import simulate

pytestmark = pytest.mark.long

PROFILE = Profile(rise_K=8.0, payload_kg=(0.0, 12.0, 0.0, 12.0))
# What arms alone have is in tests/effects/test_effects_arms.py.
CASES = [
    (next(name for name in BODIES if name in effect.machines), effect)
    for effect in effects()
    if not effect.id.startswith("unknown.") and effect.linear and set(BODIES) & set(effect.machines)
]


@pytest.mark.parametrize(("name", "hidden"), CASES, ids=[f"{m}-{e.id}" for m, e in CASES])
def test_discover_mock_effect_is_measured_true(name, hidden):
    """On one machine each; how the mocks move the readings is asked on all of them elsewhere."""
    machine, body = load_machine(name), body_named(name)
    plan = RunPlan(machine=name, seed=5, poses=50, noise_mm=0.001, profile=PROFILE, delays=True)
    plain = simulate(plan)
    span = float(plain.layout.time[-1])
    site = Site(name, body.limbs, tuple(body.around.platform_nests), body.stroke, span)
    truth = hidden.example(site)
    run = simulate(replace(plan, hidden=Hidden(truth)))
    actuators = len(machine.actuators)
    rows = stack(machine, [parse_run(run_toml(run), points_csv(run), actuators=actuators)])
    before, found = fit_effects(rows, []), fit_effects(rows, [effect_named(hidden.id, machine)])
    assert found.bad == ()
    assert found.chi2_per_dof == pytest.approx(1.0, abs=0.12)
    at = len(found.model.free)
    for unknown, value, sigma in zip(
        found.model.unknowns[0], found.values[at:], found.sigmas[at:], strict=False
    ):
        wanted = truth.get(unknown.name, 0.0)
        if unknown.name.endswith(".t0"):
            assert abs(value - wanted) < 0.05 * span
        elif unknown.sigma is None:
            assert abs(value - wanted) < 4.5 * sigma, unknown.name
    # What geometry and frames have not absorbed of it was in the residual.
    moved = (run.xyz - plain.xyz)[plain.layout.reading].T
    seen = np.einsum("ijn,jn->in", rows.whitener, moved)[:, before.accepted].reshape(-1)
    left = before.problem.project(seen)
    assert before.chi2_per_dof == pytest.approx(1.0 + left @ left / before.dof, rel=0.3)


@pytest.mark.parametrize("limb", [2, 3])
def test_discover_mock_released_limb_is_found_beside_another_effect(limb):
    """The machine closes with the constraint of one limb gone, near to where it was."""
    machine = load_machine("ptm")
    hidden = {"redundancy.limb": float(limb), "redundancy.share": 1.0, "thermal-growth.a": 3e-5}
    plan = RunPlan(
        machine="ptm", seed=5, poses=25, noise_mm=0.005, hidden=Hidden(hidden), profile=PROFILE
    )
    run = simulate(plan)
    rows = stack(machine, [parse_run(run_toml(run), points_csv(run), actuators=2)])
    plain = fit_effects(rows, [])
    columns = columns_at(plain, effect_named("redundancy", machine), ((float(limb),),))
    assert np.max(np.abs(columns.at(0))) < 1000.0  # sigmas of 5 um: millimetres, no other assembly
    effects = [effect_named(name, machine) for name in ("redundancy", "thermal-growth")]
    found = fit_effects(rows, effects)
    values = dict(zip(found.model.names, found.values, strict=True))
    assert found.chi2_per_dof == pytest.approx(1.0, abs=0.15)
    assert round(values["redundancy.limb"]) == limb
    assert values["thermal-growth.a"] == pytest.approx(3e-5, abs=1e-5)
