"""Derivatives of the pose with respect to every parameter and every actuator.

Implicit differentiation of the closure: A dx = W^T a_v dv, so one factorisation gives all columns.
For a machine without redundancy this is exact; an elastic closure neglects the turn of the
wrenches with the strain, of relative order strain / length.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from calib.arrays import Numbers
from calib.mechanism.closure import Closure
from calib.mechanism.description import Kind, Machine
from calib.mechanism.householder import Reflectors
from calib.mechanism.kernel import kernel_of
from calib.mechanism.newton import platform_solver
from calib.mechanism.solve import CHUNK, Configuration
from calib.mechanism.sweep import Standing


@dataclass(frozen=True, eq=False)
class PoseJacobians:
    """Twist of the platform [v at its origin (mm); omega (rad)], base axes, per unit of ...

    ``parameters`` (P, 6, N): each named parameter; ``actuators`` (n, 6, N): each extension.
    """

    parameters: Numbers
    actuators: Numbers


def pose_jacobians(
    machine: Machine, configuration: Configuration, parameters: Numbers | None = None
) -> PoseJacobians:
    """Differentiate the pose at closed configurations.

    Parameters
    ----------
    machine : Machine
    configuration : Configuration of N poses
        From :func:`calib.mechanism.solve.forward` with the same parameters.
    parameters : array, shape (P,) or (P, N), optional
        Nominal if not given.
    """
    count, held = configuration.count, _held(machine, parameters)
    kernel = kernel_of(machine, held, configuration.poses.position)
    if kernel is not None:
        return PoseJacobians(*kernel.jacobians(held, configuration))
    dtype = np.result_type(held, configuration.poses.position)
    by_parameter = np.zeros((len(machine.parameters), 6, count), dtype=dtype)
    by_actuator = np.zeros((len(machine.actuators), 6, count), dtype=dtype)
    for part, closure, inverse_rows in _linearised(machine, configuration, held):
        _fill(closure, "parameter", inverse_rows, by_parameter[:, :, part])
        _fill(closure, "actuator", inverse_rows, by_actuator[:, :, part])
    return PoseJacobians(by_parameter, by_actuator)


def element_twists(
    machine: Machine,
    configuration: Configuration,
    parameters: Numbers | None,
    places: Sequence[tuple[int, int]],
) -> Numbers:
    """Twist (len(places), 6, N) of the platform per mm or rad of single elements.

    As :func:`pose_jacobians`, but of elements that need hold no variable: what a locked joint
    would do that stood there.

    Parameters
    ----------
    places : sequence of (limb, element)
        Indices in ``machine.limbs`` and in that limb's chain.
    """
    held = _held(machine, parameters)
    kernel = kernel_of(machine, held, configuration.poses.position)
    if kernel is not None:
        return kernel.element_twists(held, configuration, places)
    dtype = np.result_type(held, configuration.poses.position)
    twists = np.zeros((len(places), 6, configuration.count), dtype=dtype)
    for part, closure, inverse_rows in _linearised(machine, configuration, held):
        for own, (limb, element) in zip(twists, places, strict=True):
            rows, answer = closure.column(limb, element)
            own[:, part] = np.einsum("irn,rn->in", inverse_rows[:, rows], answer)
    return twists


def _held(machine: Machine, parameters: Numbers | None) -> Numbers:
    values = machine.nominal if parameters is None else np.asarray(parameters)
    return values[:, None] if values.ndim == 1 else values


def _linearised(
    machine: Machine, configuration: Configuration, held: Numbers
) -> Iterator[tuple[slice, Closure, Numbers]]:
    """Poses a chunk at a time: closure, and twist (6, m, N) per unit of each of its rows."""
    standing = Standing.of(configuration)
    for first in range(0, configuration.count, CHUNK):
        part = slice(first, min(first + CHUNK, configuration.count))
        own = held if held.shape[1] == 1 else held[:, part]
        closure = Closure(machine, own, configuration.extension[:, part], standing.take(part))
        rows, _ = closure.rows()
        solver = platform_solver(rows, machine)
        yield part, closure, _pseudo_inverse(solver, rows.shape[0], machine.size)


def _pseudo_inverse(solver: Reflectors, row_count: int, size: float) -> Numbers:
    """Twist (6, m, N) of the platform, in mm and rad, per unit of each row of the closure."""
    trailing = solver.triangle.shape[2:]
    unit = np.zeros((row_count, row_count, *trailing), dtype=solver.triangle.dtype)
    for k in range(row_count):
        unit[k, k] = 1.0
    answer = solver.solve_triangle(solver.apply_transposed(unit))
    answer[:3] *= size
    return answer


def _fill(closure: Closure, kind: Kind, inverse_rows: Numbers, out: Numbers) -> None:
    """Add every variable's column to ``out`` (variables, 6, N)."""
    for variable, rows, coefficient in closure.columns(kind):
        if coefficient.shape[0] == 1:
            out[variable] += inverse_rows[:, rows.start] * coefficient[0]
        else:
            out[variable] += np.einsum("irn,rn->in", inverse_rows[:, rows], coefficient)
