"""A payload beside its place: what mocks that are loaded so do, and what the columns say."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import pkmcal
from app.files.machines import load_machine
from calib.effects import effect_named, not_defined
from calib.identify.signatures import columns_at
from calib.identify.staged import fit_effects
from calib.runs import parse_run
from calib.runs.stack import stack
from mocks.hidden.table import Hidden
from mocks.physics.truth import nominal_parameters
from mocks.simulate.files import points_csv, run_toml
from mocks.simulate.plan import Profile, RunPlan
from mocks.simulate.run import simulate

SOFT = {"hexapod": 2e-4, "tripod": 1e-4, "ptm": 3e-8}
OFF = {"payload-centre.x": 30.0, "payload-centre.y": -20.0, "payload-centre.z": 15.0}


@pytest.mark.parametrize("name", SOFT)
def test_a_mock_with_its_payload_beside_the_place_moves_as_the_columns_say(name: str) -> None:
    machine = load_machine(name)
    plan = RunPlan(
        machine=name, seed=5, poses=12, noise_mm=1e-5, parameters=nominal_parameters(machine),
        profile=Profile(payload_kg=(0.0, 12.0)), delays=True,
        hidden=Hidden({"gravity-sag.c": SOFT[name]}),
    )  # fmt: skip
    there = simulate(plan)
    beside = simulate(replace(plan, hidden=Hidden({"gravity-sag.c": SOFT[name], **OFF})))
    assert run_toml(there) == run_toml(beside)  # what is stated of the load is the same
    moved = (beside.xyz - there.xyz)[there.layout.reading].T
    text = run_toml(there), points_csv(there)
    rows = stack(machine, [parse_run(*text, actuators=len(machine.actuators))])
    fitted = fit_effects(rows, [effect_named("gravity-sag", machine)])
    effect = effect_named("payload-centre", machine)

    columns = columns_at(fitted, effect, ((),)).at(0)
    amounts = np.array([SOFT[name] * OFF[one.name] for one in effect.unknowns(rows)])
    said = rows.in_mm(np.tensordot(amounts, columns, axes=1))
    assert np.abs(moved).max() > 1e-3
    assert np.abs(said - moved).max() < 0.03 * np.abs(moved).max()


def test_it_is_asked_beside_a_compliance_and_needs_a_payload(tmp_path: Path) -> None:
    pkmcal.simulate("tripod", tmp_path / "run", seed=5, poses=8, payload=(0.0, 12.0))
    rows = pkmcal.fit(tmp_path / "run")._fit.model.rows
    effect = effect_named("payload-centre", rows.machine)
    assert effect.beside == ("gravity-sag", "leg-compliance")
    # On a platform that keeps its direction what is off upwards has no moment.
    assert [one.name for one in effect.unknowns(rows)] == ["payload-centre.x", "payload-centre.y"]
    bare = replace(rows, channels={**rows.channels, "payload_kg": np.zeros(rows.count)})
    assert effect.unavailable(bare) == "no payload was on the platform"


@pytest.mark.long
def test_a_payload_beside_its_place_is_found_and_the_compliance_stays_beside_it(
    tmp_path: Path,
) -> None:
    hidden = {"gravity-sag.c": SOFT["ptm"] / 3.0, "payload-centre.y": 25.0}
    pkmcal.simulate(
        "ptm", tmp_path / "run", seed=5, poses=30, noise_um=5.0, effects=hidden,
        payload=(0.0, 12.0),
    )  # fmt: skip
    found = pkmcal.discover(tmp_path / "run")
    assert found.effects == ("gravity-sag", "payload-centre")
    off = next(one for one in found.parameters if one.name == "payload-centre.y")
    assert abs(off.value - 25.0 * SOFT["ptm"] / 3.0) < 4.0 * off.sigma
    assert off.sigma < 8.0 * SOFT["ptm"] / 3.0  # 8 mm


@pytest.mark.parametrize("name", ["delta", "delta-printer"])
def test_a_platform_that_never_turns_cannot_show_it(name: str) -> None:
    assert "never turns" in not_defined(load_machine(name))["payload-centre"]
