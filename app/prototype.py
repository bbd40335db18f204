"""Simulated runs of machines that have no mock: virtual prototypes, written to the disk."""

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from app.files.machines import load_machine, shipped_machines
from app.files.poses import read_any_poses
from app.files.runs import write_run
from calib.errors import BadInput
from calib.mechanism.rigid import Poses
from calib.mechanism.task import task_values
from calib.model.prototype import prototype_run
from calib.poses.reach import sample_poses, solve_poses

ONLY_MOCKS = {
    "hidden": None, "effect": (), "parameters": None, "controller": None, "payload": (),
    "delays": False, "strays": 0,
}  # fmt: skip
"""Options that need the physics of a mock machine, and their resting values."""
NOISE_UM = 5.0


def simulate_prototype(
    name: str, out: Path, truth: Path | None, options: Mapping[str, Any]
) -> dict[str, Any]:
    """Simulate a run of any machine; answers ``pkm-simulated/1``.

    Raises
    ------
    BadInput
        For an unknown machine, an option that needs a mock, and poses out of reach.
    """
    machine = load_machine(name)
    asked = [key for key, rest in ONLY_MOCKS.items() if options[key] != rest]
    if asked:
        raise BadInput(
            f"--{asked[0]} needs the physics of a mock machine, {name} is a virtual prototype",
            remedy="Leave it out, or simulate hexapod, tripod, ptm or an arm that turns",
        )
    noise = NOISE_UM if options["noise_um"] is None else float(options["noise_um"])
    if noise <= 0.0 or options["cycles"] < 1:
        raise BadInput("--noise-um and --cycles must be positive", remedy="Correct the options")
    draw, room = np.random.default_rng([options["seed"], 1]), np.random.default_rng(options["seed"])
    parameters = machine.nominal + machine.tolerance * draw.uniform(-1, 1, machine.nominal.size)
    asked_poses = str(options["poses"])
    if asked_poses.isdigit() and int(asked_poses) > 0:
        poses = sample_poses(machine, int(asked_poses), draw)
    else:
        rows = np.array(list(read_any_poses(Path(asked_poses), machine).values()))
        poses = solve_poses(machine, task_values(machine.task, Poses.from_xyz_rpy(rows.T)))
    named = name if name in shipped_machines() else os.path.relpath(name, out)
    made = prototype_run(machine, named, poses, parameters, 1e-3 * noise, room, options["cycles"])
    write_run(out, made.run)
    place = truth or out / "truth.json"
    values = {p.name: float(v) for p, v in zip(machine.parameters, parameters, strict=True)}
    said = {"hidden": {}, "sigma_mm": 1e-3 * noise, "parameters": values}
    place.write_text(json.dumps(said, indent=1), encoding="utf-8")
    return {
        "format": "pkm-simulated/1",
        "machine": machine.name,
        "run": str(out),
        "truth": str(place),
        "seed": options["seed"],
        "poses": poses.q.shape[1],
        "readings": made.run.readings,
        "hidden": {},
    }
