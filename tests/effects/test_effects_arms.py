"""Arms: what links weigh, gears, joints that follow one another; found in runs of a UR5e."""

import re
from pathlib import Path

import numpy as np
import pytest

import pkmcal
from app.cli import run
from app.files.machines import load_machine
from app.jobs.urdf import machine_of_urdf
from calib.effects import not_defined
from calib.effects.link_weight import link_forces, link_mass_kg
from calib.errors import BadInput
from calib.mechanism.parse import parse_machine
from calib.runs import parse_run
from calib.runs.stack import stack
from tests.urdf import public_arms

WIDE = {
    "x": [-600, -250], "y": [-600, -250], "z": [0, 400], "rx": [-1.5, 0.0], "ry": [-0.6, 0.7],
    "rz": [-3.7, -2.5],
}  # fmt: skip


def widened(text: str) -> str:
    """An imported arm with a workspace as large as a laboratory uses."""
    for name, box in WIDE.items():
        text = re.sub(rf"(?m)^{name} = \[.*$", f"{name} = {box}", text)
    return text


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("arms")
    found = {}
    for name, text in (("heavy", public_arms.heavy_ur5e()), ("plain", public_arms.urdf_of("ur5e"))):
        (folder / f"{name}.urdf").write_text(text)
        found[name] = folder / f"{name}.toml"
        found[name].write_text(widened(machine_of_urdf(folder / f"{name}.urdf")))
    return found


def test_masses_and_gears_come_with_the_urdf(files: dict[str, Path]) -> None:
    machine = load_machine(str(files["heavy"]))
    assert link_mass_kg(machine) == pytest.approx(sum(public_arms.UR5E_KG))
    assert {actuator.gear for actuator in machine.actuators} == {public_arms.GEAR}
    assert "leg-compliance" in not_defined(machine)["joint-sag"]
    assert "gear = 101" in not_defined(load_machine(str(files["plain"])))["gear-cyclic"]


def test_a_centre_of_mass_where_no_link_reaches_is_left_out_and_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """As in a published URDF, whose first line is empty as well."""
    whole = public_arms.heavy_ur5e()
    place = next(iter(re.findall(r'<inertial>.*?xyz="(.*?)"', whole, re.DOTALL)))
    text = "\n" + whole.replace(f'xyz="{place}"', 'xyz="500.2 0.002 0.0"', 1)
    (tmp_path / "arm.urdf").write_text(text)
    code = run(["machine", "import", f"{tmp_path / 'arm.urdf'}", "--out", f"{tmp_path / 'a.toml'}"])
    said = capsys.readouterr().out
    machine = load_machine(str(tmp_path / "a.toml"))
    assert code == 0
    assert "Left out: the mass of" in said
    assert "500 m" in said
    assert 0.0 < link_mass_kg(machine) < sum(public_arms.UR5E_KG)


def test_links_pull_at_the_joints_as_their_centres_of_mass_say(
    files: dict[str, Path], tmp_path: Path
) -> None:
    pkmcal.simulate(str(files["heavy"]), tmp_path / "run", poses=6, delays=True)
    header, points = ((tmp_path / "run" / name).read_text() for name in ("run.toml", "points.csv"))
    rows = stack(load_machine(str(files["heavy"])), [parse_run(header, points, actuators=6)])
    expected = np.array([public_arms.torques_of_ur5e(q) for q in rows.q.T]).T
    assert np.allclose(link_forces(rows), expected, atol=1e-6)


HIDDEN = {
    "a shoulder that yields": ("heavy", {"leg-compliance.q2": 2e-8}),
    "a gear": ("heavy", {"gear-cyclic.q3.cos2": 1e-4}),
    "a wrist that is carried along": ("plain", {"joint-coupling.q6.q5": 8e-4}),
    "a forearm that hangs": ("plain", {"joint-sag.q3.x": 6e-4, "joint-sag.q3.y": 4e-4}),
}


@pytest.mark.long
@pytest.mark.parametrize("what", HIDDEN)
def test_what_is_hidden_in_an_arm_is_found_by_name_and_size(
    what: str, files: dict[str, Path], tmp_path: Path
) -> None:
    machine, effects = HIDDEN[what]
    pkmcal.simulate(
        str(files[machine]), tmp_path / "run", poses=40, noise_um=10, seed=3, effects=effects
    )
    found = pkmcal.discover(tmp_path / "run")
    (name,) = {one.partition(".")[0] for one in effects}
    assert found.effects == (name,)
    assert found.adequate
    said = {one.name: one for one in found.parameters}
    for unknown, value in effects.items():
        assert abs(said[unknown].value - value) < 4.0 * said[unknown].sigma


MASS = {
    'behind = "link9"': "holds nothing named",
    "mass_kg = -1.0": "mass_kg",
    "com = [1.0]": "com",
    "kilos = 1.0": "kilos",
}


@pytest.mark.parametrize("spoilt", MASS)
def test_a_mass_that_cannot_be_is_named(spoilt: str, files: dict[str, Path]) -> None:
    good = {"behind": '"link3"', "mass_kg": "1.0", "com": "[0.0, 0.0, 0.0]"}
    key, _, value = spoilt.partition(" = ")
    words = ", ".join(f"{name} = {one}" for name, one in {**good, key: value}.items())
    text = files["heavy"].read_text()
    text = re.sub(r"(?m)^m3 = .*$", f"m3 = {{ {words} }}", text)
    with pytest.raises(BadInput) as told:
        parse_machine(text, "heavy.toml")
    assert MASS[spoilt] in str(told.value)


def test_gears_and_masses_are_of_driven_joints_alone() -> None:
    text = _shipped("hexapod").replace("limits =", "gear = 10, limits =", 1)
    with pytest.raises(BadInput, match="a gear stands before a joint that turns"):
        parse_machine(text, "hexapod.toml")
    mass = '[limb_types.leg.traits.masses]\nm = { behind = "L0", mass_kg = 1.0, com = [0, 0, 0] }\n'
    with pytest.raises(BadInput, match="joints without an actuator"):
        parse_machine(f"{_shipped('hexapod')}\n{mass}", "hexapod.toml")


def _shipped(name: str) -> str:
    return (Path(pkmcal.__file__).parents[1] / "calib" / "machines" / f"{name}.toml").read_text()
