"""Identified machines and ways over turning points, for the laws of commands."""

from functools import cache
from importlib.resources import files

import numpy as np

from calib.command import Identified, Surroundings
from calib.command.rows import rows_with_everything
from calib.mechanism.description import Machine
from calib.mechanism.parse import parse_machine
from calib.poses import sample_poses
from calib.runs.header import Load
from calib.unknown import linear_among

MACHINES = sorted(
    entry.name.removesuffix(".toml")
    for entry in files("calib.machines").iterdir()
    if entry.name.endswith(".toml")
)
LOAD = Load(
    gravity=np.array([0.4, -0.3, -9.7]),
    platform_mass_kg=8.0,
    platform_com=np.array([3.0, -2.0, 15.0]),
    payload_com=np.array([5.0, 4.0, 60.0]),
)


@cache
def machine_of(name: str) -> Machine:
    return parse_machine(
        files("calib.machines").joinpath(f"{name}.toml").read_text(encoding="utf-8"), name
    )


@cache
def wanted_of(name: str, poses: int = 6) -> np.ndarray:
    """Task coordinates (k, N), away from every limit."""
    task = sample_poses(machine_of(name), poses, np.random.default_rng(7)).task
    middle = task.mean(axis=1, keepdims=True)
    return middle + 0.7 * (task - middle)


def around(generator: np.random.Generator, poses: int = 6) -> Surroundings:
    """Load, temperature, delays and times of every pose."""
    return Surroundings(
        {
            "structure_temp_C": 20.0 + generator.uniform(-4.0, 6.0, poses),
            "payload_kg": generator.uniform(0.0, 10.0, poses),
            "delay_s": generator.uniform(0.5, 4.0, poses),
        },
        30.0 * np.arange(1, poses + 1),
    )


def drawn(machine: Machine, effects: list, generator: np.random.Generator) -> Identified:
    """Geometry within its tolerances, effects of about half their usual size."""
    values = {
        p.name: p.nominal + 0.3 * p.tolerance * float(generator.uniform(-1, 1))
        for p in machine.parameters
    }
    for effect in effects:
        rows = rows_with_everything(effect, machine, LOAD)
        unknowns = effect.unknowns(rows)
        trials = list(effect.trials(rows))
        trial = iter(trials[int(generator.integers(len(trials)))])
        for unknown, linear in zip(unknowns, linear_among(unknowns), strict=True):
            size = 0.5 * unknown.size * float(abs(generator.standard_normal()))
            values[unknown.name] = size if linear else next(trial)
    return Identified.from_values(machine, values, effects, LOAD)
