"""What another reading would buy: nests, base nests, a wider stroke, more poses, compared."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from calib.analysis.coverage import workspace_poses
from calib.analysis.identifiability import identifiability
from calib.analysis.observation import Sights, judge, observe
from calib.arrays import Array
from calib.errors import BadInput
from calib.mechanism.description import Machine
from calib.poses.reach import PoseSet
from calib.poses.readings import PoseNoise

WIDER = 1.25
NARROWER = 0.5


@dataclass(frozen=True)
class Option:
    """One way of measuring, and what it gives.

    ``identified`` counts parameters of the machine whose prior is more than halved; the RMS is
    that predicted at fresh poses, with priors, in the frame of the fit.
    """

    says: str
    unknowns: int
    rank: int
    parameters: int
    identified: int
    position_um: float
    orientation_mdeg: float


def options(
    machine: Machine, poses: PoseSet, fresh: PoseSet, sights: Sights, generator: np.random.Generator
) -> list[Option]:
    """The readings as they are, and with one thing changed at a time."""
    out = []
    for says, changed, where in _changes(machine, poses, sights, generator):
        observation = observe(where, changed)
        found = identifiability(observation)
        accuracy = judge(fresh, observation).accuracy(found.covariance)
        seen = sum(found.identified[: observation.geometry])
        out.append(
            Option(
                says,
                len(observation.names),
                found.rank,
                observation.geometry,
                seen,
                accuracy.position_um,
                accuracy.orientation_mdeg,
            )
        )
    return out


def _changes(
    machine: Machine, poses: PoseSet, sights: Sights, generator: np.random.Generator
) -> Iterator[tuple[str, Sights, PoseSet]]:
    yield "as asked", sights, poses
    count = sights.nests.shape[1]
    for fewer in range(1, count):
        says = f"{fewer} platform nest{'s' * (fewer > 1)} only"
        yield says, replace(sights, nests=sights.nests[:, :fewer]), poses
    if count:
        extra = _another_nest(sights)
        yield f"{count + 1} platform nests", replace(sights, nests=extra), poses
    whole = sights.pose_noise
    if isinstance(whole, PoseNoise) and whole.angle_sigma is not None:
        blind = PoseNoise(whole.position_sigma, None)
        yield "positions only", replace(sights, pose_noise=blind), poses
    if sights.frame_free and sights.base.shape[1]:
        yield "no base nests", replace(sights, base=np.zeros((3, 0))), poses
    if sights.base.shape[1]:
        tied = replace(sights, frame_free=not sights.frame_free)
        says = "base frame known exactly" if sights.frame_free else "base frame to be found as well"
        yield says, tied, poses
    if count:
        says = "nests known exactly" if sights.nests_free else "nests to be found as well"
        yield says, replace(sights, nests_free=not sights.nests_free), poses
    yield "twice as many poses", sights, workspace_poses_again(machine, 2 * poses.count, generator)
    for factor, says in ((NARROWER, "half the strokes"), (WIDER, "strokes 25 % wider")):
        try:
            found = workspace_poses(wider_stroke(machine, factor), poses.count, generator)
        except BadInput:
            # Nothing can be reached with so little stroke: there is nothing to compare.
            continue
        yield says, sights, found


def workspace_poses_again(machine: Machine, count: int, generator: np.random.Generator) -> PoseSet:
    """More poses: new random ones, or a pointing machine's grid twice."""
    found = workspace_poses(machine, count, generator)
    return found.take(np.arange(count) % found.count)


def wider_stroke(machine: Machine, factor: float) -> Machine:
    """The same machine with strokes and workspace scaled about their home and centre."""
    actuators = tuple(
        replace(
            a,
            limits=(
                a.home + factor * (a.limits[0] - a.home),
                a.home + factor * (a.limits[1] - a.home),
            ),
        )
        for a in machine.actuators
    )
    workspace = {
        name: _scaled(name, low, high, factor) for name, (low, high) in machine.workspace.items()
    }
    return replace(machine, actuators=actuators, workspace=workspace)


def _scaled(name: str, low: float, high: float, factor: float) -> tuple[float, float]:
    if name == "azimuth":
        return low, high
    if name == "tilt":
        return low, factor * high
    middle, half = 0.5 * (low + high), 0.5 * factor * (high - low)
    return middle - half, middle + half


def _another_nest(sights: Sights) -> Array:
    """The nests and one more, above their middle by as much as they are apart."""
    middle = sights.nests.mean(axis=1)
    apart = np.max(np.linalg.norm(sights.nests - middle[:, None], axis=0))
    middle[2] += max(float(apart), 50.0)
    return np.column_stack([sights.nests, middle])
