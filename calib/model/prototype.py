"""A virtual prototype: the run that a machine with finite errors would give, solved exactly.

For any machine file, by the engine itself: it shows what a calibration of a new mechanism would
reach before one is built. Physics that the model does not know is not in it; the mock machines
are there for that.
"""

from dataclasses import dataclass

import numpy as np
import tomli_w

from calib.arrays import Array
from calib.errors import BadInput
from calib.frames import Frame
from calib.mechanism.description import Machine
from calib.mechanism.solve import forward
from calib.poses.reach import PoseSet

DWELL_S = 10.0
DISTANCE = 5.0
"""Of the tracker from the base, in sizes of the machine."""


@dataclass(frozen=True, eq=False)
class Prototype:
    """Texts of ``run.toml`` and ``points.csv``, and the true parameters (P,) behind them."""

    run_text: str
    points_text: str
    parameters: Array
    readings: int


def nests_of(machine: Machine) -> tuple[dict[str, list[float]], dict[str, list[float]]]:
    """Three nests on the platform and four around the base, as large as the machine."""
    turns = {"3": np.pi / 2, "4": np.pi * 7 / 6, "5": np.pi * 11 / 6}
    arm, ring = 0.4 * machine.size, 1.1 * machine.size
    platform = {k: [arm * float(np.cos(a)), arm * float(np.sin(a)), 0.0] for k, a in turns.items()}
    base = {
        f"b{k + 1}": [ring * float(np.cos(a)), ring * float(np.sin(a)), -0.1 * machine.size]
        for k, a in enumerate(np.arange(4) * np.pi / 2)
    }
    return platform, base


def prototype_run(
    machine: Machine,
    named: str,
    poses: PoseSet,
    parameters: Array,
    sigma_mm: float,
    generator: np.random.Generator,
    cycles: int = 1,
) -> Prototype:
    """Measure a prototype with one SMR that is carried from nest to nest.

    Parameters
    ----------
    machine : Machine
    named : str
        How ``run.toml`` names the machine.
    poses : PoseSet
        Commanded poses; the controller computes q with nominal parameters.
    parameters : (P,)
        What the prototype really has.
    sigma_mm : float
        Standard uncertainty of a reading per axis.
    generator : numpy Generator
        Draws the tracker's place and the noise.
    cycles : int
        Visits of all poses.

    Raises
    ------
    BadInput
        If the prototype does not close at a commanded pose.
    """
    q = poses.q
    real = forward(machine, machine.extension(q), parameters)
    if not real.converged.all():
        raise BadInput(
            f"with these errors {machine.name} does not close at "
            f"{np.count_nonzero(~real.converged)} of {q.shape[1]} poses",
            remedy="Draw other errors, or ask for poses farther from the limits",
        )
    platform, base = nests_of(machine)
    yaw = generator.uniform(-np.pi, np.pi)
    away = DISTANCE * machine.size
    frame = Frame.of((away * np.cos(yaw), away * np.sin(yaw), -0.3 * away, 0.0, 0.0, yaw))
    rows: list[list[str]] = []

    def add(pose: str, nest: str, command: Array, point: Array | None) -> None:
        cells = [repr(DWELL_S * len(rows)), pose, nest, *(repr(float(v)) for v in command)]
        if point is None:
            cells += [""] * 6
        else:
            seen = frame.apply(point) + sigma_mm * generator.standard_normal(3)
            cells += [*(repr(float(v)) for v in seen), *[repr(sigma_mm)] * 3]
        rows.append(cells)

    def reference() -> None:
        for name, place in base.items():
            add("", name, machine.home_q, np.array(place))

    add("home", "", machine.home_q, None)
    reference()
    for _ in range(cycles):
        for nest, place in platform.items():
            points = real.poses.points(np.array(place)[:, None])
            for k in range(q.shape[1]):
                add(f"{k + 1}", nest, q[:, k], points[:, k])
            reference()
    commands = [f"q{k + 1}" for k in range(len(machine.actuators))]
    header = ["time_s", "pose", "nest", *commands, "x", "y", "z", "sx", "sy", "sz"]
    table = {
        "format": "pkm-run/1",
        "machine": named,
        "title": f"virtual prototype of {machine.name}, {q.shape[1]} poses",
        "nests": {"platform": platform, "base": base},
    }
    text = "\n".join(",".join(cells) for cells in [header, *rows]) + "\n"
    readings = sum(bool(cells[2]) for cells in rows)
    return Prototype(tomli_w.dumps(table), text, parameters, readings)
