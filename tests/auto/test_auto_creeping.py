"""What a warming machine is still to creep, by its model: against the exact kinematics."""

from pathlib import Path

import numpy as np
import pytest

from app.auto.creeping import creep_of
from app.auto.findings import fresh_poses
from app.files.machines import load_machine
from app.files.runs import read_run
from app.jobs.simulating import simulate
from calib.effects import effect_named
from calib.identify import Fit
from calib.identify.staged import fit_effects
from calib.mechanism.rigid import Poses
from calib.mechanism.solve import forward, inverse
from calib.runs.stack import stack

LONG = {"leg1": 0.12, "leg6": -0.06}
TAU_S = 300.0


def fitted(folder: Path, number: int, hidden: dict[str, float], effect: str) -> Fit:
    run = folder / f"run-{number}"
    simulate("hexapod", run, poses=24, seed=number, noise_um=3.0, effects=hidden)
    machine = load_machine("hexapod")
    return fit_effects(stack(machine, [read_run(run).run]), [effect_named(effect, machine)])


def test_creep_is_what_the_platform_has_still_to_go(tmp_path: Path) -> None:
    hidden = {f"leg-warm-up.{leg}": long for leg, long in LONG.items()}
    found = fitted(tmp_path, 1, {**hidden, "leg-warm-up.tau": TAU_S}, "leg-warm-up")
    machine, last_s = found.model.machine, float(found.model.rows.time_s.max())
    poses = np.array(list(fresh_poses(machine).values())).T
    cold = inverse(machine, Poses.from_xyz_rpy(poses)).extension.copy()
    warm = forward(machine, cold).poses.position
    for leg, long in LONG.items():
        cold[int(leg[-1]) - 1] += long * np.exp(-last_s / TAU_S)
    moved = forward(machine, cold).poses.position - warm
    true_um = 1e3 * float(np.sqrt(np.mean(np.sum(moved**2, axis=0))))
    creep = creep_of(found, poses)
    assert creep is not None
    assert creep.left_um == pytest.approx(true_um, rel=0.2)
    assert creep.tau_min == pytest.approx(TAU_S / 60.0, rel=0.2)


def test_what_is_no_more_than_noise_is_no_creep(tmp_path: Path) -> None:
    found = fitted(tmp_path, 2, {}, "warm-up")
    poses = np.array(list(fresh_poses(found.model.machine).values())).T
    creep = creep_of(found, poses)
    assert creep is not None
    assert creep.left_um == 0.0
