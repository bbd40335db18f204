"""Cables carry tension alone: what force each has where a machine stands, and which hang slack.

The limbs of a redundant machine share what does not fit as springs (calib.mechanism.elastic). The
force in a rope is its strain over its compliance: what commands pull the cables against one
another, and the part of the weight that it carries, which the platform's equilibrium gives. A rope
whose force comes out at or below zero would have to push; the closure, in which it does, is then
not the machine's.
"""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array
from calib.mechanism.closure import Closure, LinearLimbs
from calib.mechanism.compiled import compile_machine
from calib.mechanism.description import Machine
from calib.mechanism.solve import Configuration
from calib.mechanism.sweep import Standing


@dataclass(frozen=True, eq=False)
class Cables:
    """Forces (K, N) in the ropes of a machine, N in tension; ``compliance`` (K,) mm/N."""

    names: tuple[str, ...]
    force: Array
    compliance: Array


def has_cables(machine: Machine) -> bool:
    """Whether limbs are ropes (trait ``pulls``) whose tension the closure knows."""
    return compile_machine(machine).redundant and any(
        limb.traits.pulls is not None for limb in machine.limbs
    )


def cable_forces(
    machine: Machine, closed: Configuration, parameters: Array, force: Array, moment: Array
) -> Cables:
    """What each rope carries.

    Parameters
    ----------
    machine : Machine
        With :func:`has_cables`.
    closed : Configuration
        Where it stands, N poses.
    parameters : (P,) or (P, N)
        With which it was closed, mm or rad.
    force, moment : (3, N)
        Load on the platform in N and N mm about its origin, base axes; zero where none is known.
    """
    values = parameters if parameters.ndim == 2 else parameters[:, None]
    closure = Closure(machine, values, closed.extension, Standing.of(closed))
    rows, _ = closure.rows()
    normal = np.einsum("rin,rjn->nij", rows, rows)
    wrench = np.concatenate([machine.size * force, moment])
    moved = np.linalg.solve(normal, wrench.T[:, :, None])[:, :, 0].T
    names: list[str] = []
    forces, compliances = [], []
    for limb, strain in zip(closure.limbs, closed.strain, strict=True):
        group = limb.group
        given = np.repeat(moved[:, None, :], group.count, axis=1)
        whole = strain + closure.strain(limb, given)[0]
        for i, index in enumerate(group.limbs):
            element = machine.limbs[index].traits.pulls
            if element is None:
                continue
            k = group.compliant.index(element)
            compliance = machine.limbs[index].elements[element].compliance
            names.append(machine.limbs[index].name)
            forces.append(_outward(limb, element, i) * whole[k, i] / compliance)
            compliances.append(compliance)
    return Cables(tuple(names), np.array(forces), np.array(compliances))


def _outward(limb: LinearLimbs, element: int, i: int) -> Array:
    """Sign (N,): 1 where a positive strain of a rope makes its two ends go apart."""
    points = [screw.point[:, i] for screw in limb.screws if screw.point is not None]
    along = np.sum(limb.screws[element].direction[:, i] * (points[-1] - points[0]), axis=0)
    return np.asarray(np.sign(along))
