"""One identification calibrates every shipped machine; errors are as large as predicted."""

from dataclasses import replace

import numpy as np
import pytest

from app.files.machines import load_machine, shipped_machines
from calib.identify import fit
from calib.mechanism.rigid import from_euler
from calib.model import Model
from calib.model.state import State
from calib.model.synthetic import drawn_from_prior, synthetic_rows
from calib.poses import sample_poses
from calib.runs import parse_run
from calib.runs.stack import Rows, stack

SIGMA = 0.005
TRIALS = {"ptm": 8, "hexapod": 12}
OTHERS = 40


def campaign(name: str, poses: int) -> Rows:
    """Readings of three nests at random poses, the tracker 2 m away; positions still to be made."""
    machine = load_machine(name)
    chosen = sample_poses(machine, poses, np.random.default_rng(1))
    size = 0.4 * machine.size
    nests = {"3": [0.0, size, 0.0], "4": [-0.87 * size, -0.5 * size, 0.0],
             "5": [0.87 * size, -0.5 * size, 20.0]}  # fmt: skip
    ring = [[np.cos(a), np.sin(a), -0.1 * k] for k, a in enumerate(np.arange(4) * np.pi / 2)]
    header = [
        'format = "pkm-run/1"', f'machine = "{name}"', 'title = ""', "[nests.platform]",
        *(f'"{key}" = {place}' for key, place in nests.items()), "[nests.base]",
        *(f"b{k} = {[float(1.3 * machine.size * c) for c in p]}" for k, p in enumerate(ring)),
    ]  # fmt: skip
    commands = [f"q{k + 1}" for k in range(len(machine.actuators))]
    lines = [",".join(["time_s", "pose", "nest", *commands, *"xyz", "sx", "sy", "sz"])]
    home = [repr(float(q)) for q in machine.home_q]
    where = chosen.poses
    for key, place in enumerate(ring):
        point = 1.3 * machine.size * np.array(place) + [2000.0, 0.0, 0.0]
        lines.append(_line(0, "", f"b{key}", home, point))
    for nest, place in nests.items():
        points = where.points(np.array(place)[:, None]) + np.array([[2000.0], [0.0], [0.0]])
        for k in range(poses):
            q = [repr(float(v)) for v in chosen.q[:, k]]
            lines.append(_line(10 + k, f"p{k}", nest, q, points[:, k]))
        lines[-poses:] = sorted(lines[-poses:], key=lambda line: float(line.split(",")[0]))
    times = [f"{10.0 * k}," + line.split(",", 1)[1] for k, line in enumerate(lines[1:])]
    run = parse_run("\n".join(header), "\n".join([lines[0], *times]) + "\n",
                    actuators=len(machine.actuators))  # fmt: skip
    return stack(machine, [run])


def _line(time: float, pose: str, nest: str, q: list[str], point: np.ndarray) -> str:
    cells = [str(float(time)), pose, nest, *q, *(repr(float(v)) for v in point)]
    return ",".join([*cells, *[str(SIGMA)] * 3])


def frames_of(model: Model) -> State:
    rotation = from_euler(0.0, 0.0, 0.0)[:, :, None]
    return model.start(rotation, np.array([[2000.0], [0.0], [0.0]]))


@pytest.mark.long
@pytest.mark.parametrize("name", shipped_machines())
def test_errors_are_as_large_as_predicted(name: str) -> None:
    model = Model(campaign(name, 40))
    start = frames_of(model)
    generator = np.random.default_rng(17)
    pulls, quality = [], []
    for _ in range(TRIALS.get(name, OTHERS)):
        truth = drawn_from_prior(model, start, generator)
        found = fit(Model(synthetic_rows(model, truth, generator)))
        count = model.free.size
        pulls.append((found.values[:count] - truth.parameters) / found.sigmas[:count])
        quality.append(found.chi2_per_dof)
    assert np.std(pulls) == pytest.approx(1.0, abs=0.15)
    assert np.mean(quality) == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("name", shipped_machines())
def test_exact_readings_are_explained_to_the_last_digit(name: str) -> None:
    """With next to no noise the priors hold nothing back."""
    model = Model(campaign(name, 40))
    truth = drawn_from_prior(model, frames_of(model), np.random.default_rng(3))
    rows = synthetic_rows(model, truth, None)
    found = fit(Model(replace(rows, covariance=1e-4 * rows.covariance)))
    assert found.rms_mm < 0.3 * 1e-2 * SIGMA
