"""Effects beside others are found with their sizes; what refines another is asked there alone."""

import pytest

import pkmcal
from app.files.machines import load_machine
from calib.effects import catalogue

RUN = {"poses": 60, "noise_um": 4.0, "seed": 5}
HARMONIC = {
    "screw-cyclic.leg2.sin": 0.02,
    "screw-cyclic.period": 4.0,
    "screw-harmonic.leg2.cos": 0.012,
    "screw-harmonic.period": 2.0,
}
CASES = {
    "a wave and its half": ("hexapod", HARMONIC, ()),
    "a stand under soft legs": (
        "hexapod",
        {"gravity-sag.c": 3e-4, "base-bending.lean": 1.2e-8},
        (0.0, 12.0, 0.0, 12.0),
    ),
    "a stand alone": ("hexapod", {"base-bending.lean": 3e-8}, (0.0, 12.0, 0.0, 12.0)),
    "a lead that bends twice": (
        "hexapod",
        {"screw-pitch.leg3": 1e-3, "lead-cubic.leg3": 2e-6},
        (),
    ),
    "a nest that was pushed": (
        "tripod",
        {"nest-step.p2.x": 0.05, "nest-step.p2.y": -0.03, "nest-step.t0": 700.0},
        (),
    ),
}


@pytest.mark.long
@pytest.mark.parametrize("what", CASES)
def test_what_is_asked_beside_is_found_with_its_size(what, tmp_path):
    machine, hidden, payload = CASES[what]
    pkmcal.simulate(machine, tmp_path / "run", effects=hidden, payload=payload, **RUN)
    found = pkmcal.discover(tmp_path / "run")
    assert set(found.effects) == {name.partition(".")[0] for name in hidden}
    assert found.adequate
    said = {one.name: one for one in found.parameters}
    for name, value in hidden.items():
        if not name.endswith((".t0", ".period")):
            assert abs(said[name].value - value) < 4.0 * said[name].sigma


def test_what_is_asked_beside_names_what_the_machine_may_have():
    for machine in ("hexapod", "tripod", "ptm", "delta", "arm"):
        known = {effect.id for effect in catalogue(load_machine(machine))}
        for effect in catalogue(load_machine(machine)):
            assert not effect.beside or known & set(effect.beside)


def test_nothing_is_asked_beside_what_is_not_there(tmp_path):
    pkmcal.simulate("hexapod", tmp_path / "run", effects={"backlash.leg3": 0.02}, poses=25)
    asked = {one.effect for one in pkmcal.diagnose(tmp_path / "run").candidates}
    with_wave = pkmcal.diagnose(tmp_path / "run", add=["screw-cyclic"])
    beside = {one.effect for one in with_wave.candidates} - asked
    assert "screw-harmonic" not in asked
    assert beside == {"screw-harmonic"}
