"""Where a command brings the machine is where it was wanted, whatever the machine does."""

import numpy as np
import pytest
from command_cases import LOAD, MACHINES, around, drawn, machine_of, wanted_of

from calib.command import Identified, commands_for, pose_commands, standpoint
from calib.command.identified import commandable
from calib.command.rows import rows_with_everything
from calib.effects import catalogue
from calib.mechanism.rigid import pose_difference
from calib.mechanism.solve import forward, inverse
from calib.mechanism.task import task_error

NEAR_MM, NEAR_RAD = 1e-6, 1e-9
POSES = 6


def off(machine, wanted, poses):
    """Largest distance to the wanted task coordinates, mm and rad apart."""
    error = np.abs(task_error(machine.task, wanted, poses.position, poses.rotation))
    lengths = np.array([name in "xyz" for name in machine.task.coordinates])
    return error[lengths].max(initial=0.0), error[~lengths].max(initial=0.0)


EVERY = [
    (name, effect)
    for name in MACHINES
    for effect in catalogue(machine_of(name))
    if commandable(effect)
]


@pytest.mark.parametrize(("name", "effect"), EVERY, ids=[f"{m}-{e.id}" for m, e in EVERY])
def test_command_of_every_effect_on_every_machine_brings_the_platform_there(name, effect):
    machine, generator = machine_of(name), np.random.default_rng(11)
    identified = drawn(machine, [effect], generator)
    wanted, here = wanted_of(name), around(generator)
    found = commands_for(identified, wanted, here)
    assert found.refused == ("",) * POSES
    stands = standpoint(identified, found.extension, here)  # begun anew, nothing of the solution
    assert stands.agreed.all()
    mm, rad = off(machine, wanted, stands.poses)
    assert mm < NEAR_MM
    assert rad < NEAR_RAD


@pytest.mark.parametrize("name", MACHINES)
def test_command_with_all_effects_together(name):
    machine, generator = machine_of(name), np.random.default_rng(13)
    effects = [e for e in catalogue(machine) if commandable(e)]
    identified = drawn(machine, effects, generator)
    wanted, here = wanted_of(name), around(generator)
    found = commands_for(identified, wanted, here)
    assert found.refused == ("",) * POSES
    mm, rad = off(machine, wanted, standpoint(identified, found.extension, here).poses)
    assert mm < NEAR_MM
    assert rad < NEAR_RAD


@pytest.mark.parametrize("name", MACHINES)
def test_command_without_effects_is_the_inverse(name):
    machine = machine_of(name)
    every = [e for e in catalogue(machine) if commandable(e) and e.id != "redundancy"]
    unknowns = [u for e in every for u in e.unknowns(rows_with_everything(e, machine, LOAD))]
    resting = {u.name: 1.0 if u.nonlinear else 0.0 for u in unknowns}
    identified = Identified.from_values(machine, resting, every, LOAD)
    found = commands_for(identified, wanted_of(name), around(np.random.default_rng(1)))
    plain = inverse(machine, wanted_of(name))
    assert np.allclose(found.extension, plain.extension, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("name", MACHINES)
def test_command_of_pose_is_what_a_controller_makes_the_actuators_of(name):
    machine, generator = machine_of(name), np.random.default_rng(3)
    effects = [e for e in catalogue(machine) if e.id in ("screw-pitch", "backlash", "gravity-sag")]
    identified = drawn(machine, effects, generator)
    found = commands_for(identified, wanted_of(name), around(generator))
    told = pose_commands(identified, found)
    sent = inverse(machine, told)
    assert np.allclose(machine.coordinates(sent.extension), found.q, rtol=0.0, atol=1e-7)
    moved = pose_difference(
        forward(machine, inverse(machine, wanted_of(name)).extension).poses, told
    )
    assert np.abs(moved).max() > 1e-4  # there was something to correct
