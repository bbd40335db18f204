"""A virtual prototype: the run that a machine with finite errors would give, solved exactly.

For any machine file, by the engine itself: it shows what a calibration of a new mechanism would
reach before one is built. Physics that the model does not know is not in it; the mock machines
are there for that.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from calib.arrays import Array
from calib.errors import BadInput
from calib.frames import Frame
from calib.mechanism.description import Machine
from calib.mechanism.solve import forward
from calib.poses.reach import PoseSet
from calib.runs import Header, Run

Visit = tuple[str, str, Array, Array | None]
"""Label of the pose, nest, commanded q (n,), where the SMR is (3,); None: a move only."""

DWELL_S = 10.0
DISTANCE = 5.0
"""Of the tracker from the base, in sizes of the machine."""


@dataclass(frozen=True, eq=False)
class Prototype:
    """A run, and the true parameters (P,) behind it."""

    run: Run
    parameters: Array


def nests_of(machine: Machine) -> tuple[dict[str, Array], dict[str, Array]]:
    """Three nests on the platform and four around the base, (3,) mm, as large as the machine."""
    turns = {"3": np.pi / 2, "4": np.pi * 7 / 6, "5": np.pi * 11 / 6}
    arm, ring = 0.4 * machine.size, 1.1 * machine.size
    platform = {k: arm * np.array([np.cos(a), np.sin(a), 0.0]) for k, a in turns.items()}
    base = {
        f"b{k + 1}": np.array([ring * np.cos(a), ring * np.sin(a), -0.1 * machine.size])
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
    *,
    header: Header | None = None,
    noise: float = 1.0,
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
    header : Header, optional
        Nests and load of a site; nests as large as the machine if missing.
    noise : float
        How large it is, in units of what the readings state.

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
    if header is None:
        title = f"virtual prototype of {machine.name}, {q.shape[1]} poses"
        platform, base = nests_of(machine)
        header = Header(named, title, platform_nests=platform, base_nests=base)
    platform, base = dict(header.platform_nests), dict(header.base_nests)
    yaw = generator.uniform(-np.pi, np.pi)
    away = DISTANCE * machine.size
    frame = Frame.of((away * np.cos(yaw), away * np.sin(yaw), -0.3 * away, 0.0, 0.0, yaw))
    visits = [("home", "", machine.home_q, None), *_references(machine, base)]
    for _ in range(cycles):
        for nest, place in platform.items():
            points = real.poses.points(place[:, None])
            visits += [(f"{k + 1}", nest, q[:, k], points[:, k]) for k in range(q.shape[1])]
            visits += _references(machine, base)
    return Prototype(_measured(header, visits, frame, sigma_mm, generator, noise), parameters)


def _references(machine: Machine, base: Mapping[str, Array]) -> list[Visit]:
    return [("", name, machine.home_q, place) for name, place in base.items()]


def _measured(
    header: Header,
    visits: Sequence[Visit],
    frame: Frame,
    sigma_mm: float,
    generator: np.random.Generator,
    noise: float,
) -> Run:
    """Read what is visited, in the tracker's ``frame``, with equal noise in all directions."""
    position = np.full((len(visits), 3), np.nan)
    for row, (_, _, _, point) in enumerate(visits):
        if point is not None:
            position[row] = frame.apply(point) + noise * sigma_mm * generator.standard_normal(3)
    measured = np.array([point is not None for _, _, _, point in visits])
    covariance = np.where(measured, sigma_mm**2 * np.eye(3)[:, :, None], np.nan)
    return Run(
        header=header,
        source="prototype",
        line=np.arange(len(visits)) + 2,
        time_s=DWELL_S * np.arange(len(visits), dtype=np.float64),
        pose=tuple(pose for pose, _, _, _ in visits),
        nest=tuple(nest for _, nest, _, _ in visits),
        q=np.array([command for _, _, command, _ in visits]).T,
        measured=measured,
        position=position.T,
        covariance=covariance,
        channels={},
        left_aside={},
    )
