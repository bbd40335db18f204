"""A run of any machine with everything in it that an effect may need; exact, of the nominal one."""

from functools import cache

import numpy as np

from app.files.machines import load_machine, shipped_machines
from calib.mechanism.description import Machine
from calib.model.prototype import nests_of
from calib.poses import sample_poses
from calib.runs import parse_run
from calib.runs.stack import Rows, stack

POSES = 4
SIGMA_MM = 0.005
MACHINES = shipped_machines()


@cache
def machine_of(name: str) -> Machine:
    return load_machine(name)


@cache
def rows_of(name: str) -> Rows:
    """Three nests at random poses, from either side; warm, loaded, read after a while."""
    machine = machine_of(name)
    generator = np.random.default_rng(3)
    chosen = sample_poses(machine, POSES, generator)
    platform, base = nests_of(machine)
    commands = [f"q{k + 1}" for k in range(len(machine.actuators))]
    columns = ["structure_temp_C", "air_temp_C", "payload_kg", "delay_s"]
    lines = [["time_s", "pose", "nest", *commands, *"xyz", "sx", "sy", "sz", *columns]]

    def add(pose: str, nest: str, q: np.ndarray, point: np.ndarray | None) -> None:
        row = len(lines)
        away = [""] * 6 if point is None else [*map(repr, map(float, point)), *3 * [str(SIGMA_MM)]]
        state = [20.0 + row, 21.0, 12.0 * (row % 2), round(float(generator.uniform(0.2, 8.0)), 2)]
        cells = [f"{30.0 * row}", pose, nest, *(repr(float(v)) for v in q), *away]
        lines.append([*cells, *map(str, state)])

    far = np.array([0.7 * machine.size, 4.0 * machine.size, -0.4 * machine.size])
    add("home", "", machine.home_q, None)
    for key, place in base.items():
        add("", key, machine.home_q, np.array(place) + far)
    for key, place in platform.items():
        points = chosen.poses.points(np.array(place)[:, None]) + far[:, None]
        for k in range(POSES):
            add(f"p{k}", key, chosen.q[:, k], points[:, k])
    header = [
        'format = "pkm-run/1"', f'machine = "{name}"', "[nests.platform]",
        *(f'"{key}" = {[float(c) for c in place]}' for key, place in platform.items()),
        "[nests.base]", *(f"{key} = {[float(c) for c in place]}" for key, place in base.items()),
        "[load]", "platform_mass_kg = 6.0", "platform_com = [10.0, -5.0, 20.0]",
        "payload_com = [0.0, 25.0, 60.0]", "gravity = [0.0, 0.0, -9.80665]",
    ]  # fmt: skip
    text = "\n".join(",".join(line) for line in lines) + "\n"
    run = parse_run("\n".join(header), text, actuators=len(machine.actuators))
    return stack(machine, [run])
