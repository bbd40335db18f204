"""Readings of any machine, warm and loaded, that every effect can be asked of."""

import re
from dataclasses import replace
from functools import cache
from importlib.resources import files

import numpy as np

from calib.mechanism.description import Machine
from calib.mechanism.parse import parse_machine
from calib.mechanism.solve import Configuration
from calib.model import Model
from calib.model.prediction import State
from calib.model.prototype import prototype_run
from calib.poses import sample_poses
from calib.runs.header import Load
from calib.runs.stack import Rows, stack

LOAD = Load(
    gravity=np.array([0.4, -0.3, -9.7]),
    platform_mass_kg=8.0,
    platform_com=np.array([3.0, -2.0, 15.0]),
    payload_com=np.array([5.0, 4.0, 60.0]),
)


def text_of(name: str) -> str:
    """A shipped machine file."""
    return files("calib.machines").joinpath(f"{name}.toml").read_text(encoding="utf-8")


def machine_of(text: str) -> Machine:
    return parse_machine(text, "mine.toml")


def without_traits(text: str) -> str:
    """The file as it would have been before traits were stated."""
    return re.sub(r"\[(?:limb_types|limbs)\.\w+\.traits\]\n(?:\w.*\n)+", "", text)


def rows_of(machine: Machine, poses: int = 10, seed: int = 1) -> Rows:
    """Readings of the nominal machine with all channels, from a tracker at the base frame."""
    generator = np.random.default_rng(seed)
    chosen = sample_poses(machine, poses, generator)
    run = prototype_run(machine, machine.name, chosen, machine.nominal, 0.005, generator).run
    count = np.arange(run.time_s.size)
    channels = {
        "structure_temp_C": 20.0 + 0.1 * count + 2.0 * np.sin(count),
        "payload_kg": 12.0 * (count // 5 % 2),
        "delay_s": 1.0 + count % 4,
    }
    run = replace(run, header=replace(run.header, load=LOAD), channels=channels)
    return stack(machine, [run])


@cache
def readings_of(name: str) -> Rows:
    """The same of a shipped machine."""
    return rows_of(machine_of(text_of(name)))


def start_of(model: Model, values: np.ndarray | None = None) -> State:
    """The nominal machine seen from its base frame, with these values of its effect."""
    start = model.start(np.eye(3)[:, :, None], np.zeros((3, 1)))
    return start if values is None else replace(start, effects=(values,))


def predicted(rows: Rows, effect: object, values: np.ndarray) -> np.ndarray:
    """Displacement (3, N) of the readings by an effect, mm."""
    with_it, without = Model(rows, [effect]), Model(rows)  # type: ignore[list-item]
    return with_it.predict(start_of(with_it, values)) - without.predict(start_of(without))


def moved(rows: Rows, plain: Configuration, real: Configuration) -> np.ndarray:
    """Displacement (3, N) of the readings between two closures, mm."""
    assert plain.converged.all()
    assert real.converged.all()
    points = [
        c.poses.position + np.einsum("ijn,jn->in", c.poses.rotation, rows.nest)
        for c in (plain, real)
    ]
    return np.where(rows.on_platform, points[1] - points[0], 0.0)
