"""URDF written for two public arms, read by Pinocchio: the same pose at the same joint values.

Wanted: 1,000 poses of a UR5e and of a Panda whose every error is drawn, within 1 nm and 1e-12 of
the rotation matrix. The arms are those of tests/urdf, by their makers' published parameters.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import tempfile
from pathlib import Path

import numpy as np
import pinocchio as pin

from app.jobs.urdf import machine_of_urdf, urdf_of
from calib.mechanism.parse import parse_machine
from calib.mechanism.solve import forward
from tests.urdf import public_arms

POSES = 1000


def main() -> None:
    for name in ("ur5e", "panda"):
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / f"{name}.urdf"
            file.write_text(public_arms.urdf_of(name), encoding="utf-8")
            machine = parse_machine(machine_of_urdf(file), f"{name}.toml")
        rng = np.random.default_rng(1)
        draw = machine.nominal + machine.prior_sigma * rng.standard_normal(machine.nominal.size)
        values = dict(zip((p.name for p in machine.parameters), draw, strict=True))
        q = rng.uniform(-2.5, 2.5, (len(machine.actuators), POSES))
        ours = forward(machine, q, machine.vector(values)).poses
        model = pin.buildModelFromXML(urdf_of(machine, values, {}, "drawn errors"))
        data, tip = model.createData(), model.getFrameId("tip")
        place = turn = 0.0
        for k in range(POSES):
            pin.framesForwardKinematics(model, data, q[:, k])
            there = data.oMf[tip]
            place = max(
                place, float(np.abs(1000.0 * there.translation - ours.position[:, k]).max())
            )
            turn = max(turn, float(np.abs(there.rotation - ours.rotation[:, :, k]).max()))
        print(
            f"{name}: {len(machine.parameters)} drawn errors, {POSES} poses: Pinocchio is at most "
            f"{1e6 * place:.2g} nm and {turn:.1g} of the rotation matrix elsewhere"
        )


if __name__ == "__main__":
    main()
