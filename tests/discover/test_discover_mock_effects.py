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
from mocks.hidden.table import Hidden
from mocks.physics.truth import machine_file, nominal_parameters
from mocks.simulate.files import points_csv, run_toml
from mocks.simulate.plan import Profile, RunPlan
from mocks.simulate.run import simulate

HIDDEN = {
    "backlash": {"backlash.leg2": 0.02, "backlash.leg5": 0.01},
    "gravity-sag": {"gravity-sag.c": 2e-4},
    "nest-offset": {"nest-offset.4.x": 0.03, "nest-offset.4.z": -0.05},
    "screw-cyclic": {
        "screw-cyclic.leg1.sin": 0.01,
        "screw-cyclic.leg4.cos": -0.01,
        "screw-cyclic.period": 3.3,
    },
    "screw-pitch": {"screw-pitch.leg1": 1e-3, "screw-pitch.leg6": -5e-4},
    "screw-twist": {"screw-twist.L": 1.5},
    "settling": {"settling.k": 2e-3, "settling.tau": 2.0},
    "thermal-growth": {"thermal-growth.a": 1.2e-5},
    "tracker-drift": {"tracker-drift.vx": 0.05, "tracker-drift.wz": 3e-5},
    "tracker-offset": {"tracker-offset.r0": 0.1},
    "tracker-scale": {"tracker-scale.k": 1e-4},
    "frame-shift": {"frame-shift.x": 0.05, "frame-shift.ry": 2e-4, "frame-shift.t0": 700.0},
}
TRIPOD = {
    "backlash": {"backlash.limb1": 0.02},
    "gravity-sag": {"gravity-sag.c": 1e-4},
    "joint-azimuth": {"joint-azimuth.limb1": 1e-3, "joint-azimuth.limb3": -5e-4},
    "parallelogram-sides": {"parallelogram-sides.limb2": 0.03},
    "screw-pitch": {"screw-pitch.limb2": 5e-4},
    "settling": {"settling.k": 2e-3, "settling.tau": 2.0},
    "thermal-growth": {"thermal-growth.a": 1.2e-5},
    "tracker-scale": {"tracker-scale.k": 1e-4},
}
PTM = {
    "backlash": {"backlash.limb1": 3e-4},
    "gravity-sag": {"gravity-sag.c": 3e-8},
    "settling": {"settling.k": 2e-3, "settling.tau": 2.0},
    "thermal-growth": {"thermal-growth.a": 2e-5},
    "tracker-scale": {"tracker-scale.k": 1e-4},
}
CASES = [("hexapod", effect, hidden) for effect, hidden in sorted(HIDDEN.items())]
CASES += [("tripod", effect, hidden) for effect, hidden in sorted(TRIPOD.items())]
CASES += [("ptm", effect, hidden) for effect, hidden in sorted(PTM.items())]
PROFILE = Profile(rise_K=8.0, payload_kg=(0.0, 12.0, 0.0, 12.0))


@pytest.mark.parametrize(("name", "effect", "hidden"), CASES, ids=[f"{m}-{e}" for m, e, _ in CASES])
def test_discover_mock_effect_is_measured_true(name, effect, hidden):
    machine = load_machine(name)
    plan = RunPlan(
        machine=name, seed=5, poses=50, noise_mm=0.001, hidden=Hidden(hidden), profile=PROFILE
    )
    run = simulate(plan)
    actuators = len(machine.actuators)
    rows = stack(machine, [parse_run(run_toml(run), points_csv(run), actuators=actuators)])
    before, found = fit_effects(rows, []), fit_effects(rows, [effect_named(effect, machine)])
    assert found.bad == ()
    assert found.chi2_per_dof == pytest.approx(1.0, abs=0.12)
    at = len(found.model.free)
    for unknown, value, sigma in zip(
        found.model.unknowns[0], found.values[at:], found.sigmas[at:], strict=False
    ):
        truth = hidden.get(unknown.name, 0.0)
        if unknown.name.endswith(".t0"):
            assert abs(value - truth) < 0.05 * np.ptp(rows.time_s)
        elif unknown.sigma is None:
            assert abs(value - truth) < 4.5 * sigma, unknown.name
    assert before.chi2_per_dof > 2.0


@pytest.mark.parametrize("body", ["base", "platform"])
@pytest.mark.parametrize("axis", ["y", "z"])
def test_discover_mock_tilted_joint_moves_the_readings_as_predicted(body, axis):
    """Geometry absorbs nearly all of a tilt, so displacements are compared before any refit."""
    machine = load_machine("hexapod")
    name = f"joint-tilt.leg2.{body}.{axis}"
    nominal = nominal_parameters(machine_file("hexapod"))
    plan = RunPlan(machine="hexapod", seed=5, poses=30, parameters=nominal)
    plain, tilted = simulate(plan), simulate(replace(plan, hidden=Hidden({name: 2e-3})))
    rows = stack(machine, [parse_run(run_toml(plain), points_csv(plain), actuators=6)])
    fitted = fit_effects(rows, [])
    columns = columns_at(fitted, effect_named("joint-tilt", machine), ((),))
    index = [unknown.name for unknown in columns.unknowns].index(name)
    predicted = 2e-3 * columns.columns[0, index]
    moved = (tilted.xyz - plain.xyz)[plain.layout.reading].T
    seen = np.einsum("ijn,jn->in", rows.whitener, moved)
    assert np.sqrt(np.mean(seen**2)) > 0.05
    np.testing.assert_allclose(predicted, seen, atol=0.02 * np.abs(seen).max())


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
    assert (
        np.max(np.abs(columns.columns)) < 1000.0
    )  # sigmas of 5 um: millimetres, no other assembly
    effects = [effect_named(name, machine) for name in ("redundancy", "thermal-growth")]
    found = fit_effects(rows, effects)
    values = dict(zip(found.model.names, found.values, strict=True))
    assert found.chi2_per_dof == pytest.approx(1.0, abs=0.15)
    assert round(values["redundancy.limb"]) == limb
    assert values["thermal-growth.a"] == pytest.approx(3e-5, abs=1e-5)
