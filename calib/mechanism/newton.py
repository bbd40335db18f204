"""Newton's method on the closure of a batch of poses, each with its own progress."""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, BoolArray, IntArray, Numbers
from calib.errors import BadInput
from calib.mechanism.closure import Closure
from calib.mechanism.configuration import Configuration
from calib.mechanism.description import Machine
from calib.mechanism.householder import Reflectors, factorise
from calib.mechanism.redundant import extension_steps
from calib.mechanism.rigid import Poses, exponential, product
from calib.mechanism.sweep import Standing
from calib.mechanism.tables import actuator_units
from calib.mechanism.task import task_error, task_rows

MAX_ITERATIONS = 60
MAX_STEP = 0.4
"""Largest step, in rad for turns and as a part of the machine's size for lengths."""
TOLERANCE = 1e-10
"""A step this small is the last: what is left after it is its square."""
STAGNATION = 1e-8
"""Steps that no longer shrink are rounding if they are smaller than this."""


def platform_solver(rows: Numbers, machine: Machine) -> Reflectors:
    """Factorised rows of the closure; raises :class:`BadInput` for a mobile platform."""
    if rows.shape[0] < 6:
        raise BadInput(
            f'the limbs of "{machine.name}" constrain {rows.shape[0]} of 6 freedoms',
            place=machine.source,
            remedy="It moves with all actuators held: remove passive joints or add limbs.",
        )
    return factorise(np.array(rows))


@dataclass(eq=False)
class Newton:
    """One batch of poses on its way to closure. Solves for the pose, or for the extensions."""

    machine: Machine
    parameters: Numbers
    extension: Numbers
    state: Standing
    target: Numbers | None
    """Task coordinates (n, N) of an inverse problem; None for a forward one."""
    conditioning: Array

    def step(self) -> Array:
        """Take one step; size of the step of each pose, (N,), scaled to rad."""
        closure = Closure(self.machine, self.parameters, self.extension, self.state)
        rows, gaps = closure.rows()
        solver = platform_solver(rows, self.machine)
        self.conditioning = np.real(solver.diagonal_ratio())
        dx = -solver.solve_triangle(solver.apply_transposed(gaps))
        ds = None
        if self.target is not None:
            dx, ds = self._towards_target(closure, solver, rows.shape[0], dx)
        passive, strain = self._limb_steps(closure, dx, ds)
        scale, size = self._scale(closure, dx, ds, passive)
        self._apply(closure, scale, dx, ds, passive, strain)
        return size

    def _towards_target(
        self, closure: Closure, solver: Reflectors, row_count: int, dx: Numbers
    ) -> tuple[Numbers, Numbers]:
        """Pose and extension steps that close the limbs and remove the task error together."""
        assert self.target is not None
        task, size = self.machine.task, self.machine.size
        answers = np.zeros((row_count, *self.extension.shape), dtype=dx.dtype)
        for actuator, rows, coefficient in closure.columns("actuator"):
            answers[rows, actuator] += coefficient
        D = solver.solve_triangle(solver.apply_transposed(answers))
        T = task_rows(task, self.state.rotation)
        T[:, :3] *= size
        error = task_error(task, self.target, self.state.position, self.state.rotation)
        error = error - np.einsum("tin,in->tn", T, dx)
        answer = np.einsum("tin,ian->tan", T, D)
        if answer.shape[0] < answer.shape[1]:
            held, gaps = closure.rows()
            strained = np.einsum("rin,in->rn", held, dx) + gaps
            straining = np.einsum("rin,ian->ran", held, D) - answers
            ds = extension_steps(answer, error, strained, straining, actuator_units(self.machine))
        else:
            inner = factorise(answer)
            ds = inner.solve_triangle(inner.apply_transposed(error))
        return dx + np.einsum("ian,an->in", D, ds), ds

    def _limb_steps(
        self, closure: Closure, dx: Numbers, ds: Numbers | None
    ) -> tuple[list[Numbers], list[Numbers]]:
        """Passive steps (n_passive, L, N) and new strains, by group of limbs."""
        passive, strains = [], []
        for limb in closure.limbs:
            twist = limb.gap + dx[:, None]
            if ds is not None:
                twist = twist - closure.actuator_twist(limb, ds)
            strain, yielded = closure.strain(limb, twist)
            if yielded is not None:
                twist = twist - yielded
            passive.append(limb.factors.solve_triangle(limb.factors.apply_transposed(twist)))
            strains.append(strain)
        return passive, strains

    def _scale(
        self, closure: Closure, dx: Numbers, ds: Numbers | None, passive: list[Numbers]
    ) -> tuple[Array, Array]:
        """Damping (N,) that bounds the step, and the size of the undamped step (N,)."""
        size = np.max(np.abs(dx), axis=0)
        if ds is not None:
            size = np.maximum(
                size, np.max(np.abs(ds) / actuator_units(self.machine)[:, None], axis=0)
            )
        for limb, step in zip(closure.limbs, passive, strict=True):
            if step.size:
                size = np.maximum(size, np.max(np.abs(step) / limb.group.unit, axis=(0, 1)))
        scale = np.where(size > MAX_STEP, MAX_STEP / size, 1.0)
        return np.where(np.isfinite(size), scale, 0.0), size

    def _apply(
        self,
        closure: Closure,
        scale: Array,
        dx: Numbers,
        ds: Numbers | None,
        passive: list[Numbers],
        strain: list[Numbers],
    ) -> None:
        state, fine = self.state, scale > 0.0
        dx = np.where(fine, dx, 0.0) * scale
        state.position = state.position + dx[:3] * self.machine.size
        state.rotation = product(exponential(dx[3:]), state.rotation)
        if ds is not None:
            self.extension = self.extension + np.where(fine, ds, 0.0) * scale
        for limb, step in zip(closure.limbs, passive, strict=True):
            state.passive[limb.group.passive] += np.where(fine, step, 0.0) * scale
        state.strain = strain

    def keep(self, which: BoolArray) -> None:
        """Go on with some of the poses only."""
        if self.parameters.shape[1] > 1:
            self.parameters = self.parameters[:, which]
        self.extension = self.extension[:, which]
        if self.target is not None:
            self.target = self.target[:, which]
        self.state = self.state.take(which)


@dataclass(eq=False)
class _Result:
    """Where finished poses are gathered, in the order in which they were asked."""

    position: Numbers
    rotation: Numbers
    extension: Numbers
    passive: Numbers
    strain: list[Numbers]
    converged: BoolArray
    iterations: IntArray
    conditioning: Array

    def put(self, where: IntArray, newton: Newton, which: BoolArray) -> None:
        """Store the poses ``which`` of the batch at the places ``where[which]``."""
        to, state = where[which], newton.state
        self.position[:, to] = state.position[:, which]
        self.rotation[:, :, to] = state.rotation[:, :, which]
        self.extension[:, to] = newton.extension[:, which]
        self.passive[:, to] = state.passive[:, which]
        for mine, theirs in zip(self.strain, state.strain, strict=True):
            mine[:, :, to] = theirs[:, :, which]
        self.conditioning[to] = newton.conditioning[which]


def run(newton: Newton) -> Configuration:
    """Iterate until every pose has closed or has failed."""
    count = newton.extension.shape[1]
    result = _Result(
        np.array(newton.state.position),
        np.array(newton.state.rotation),
        np.array(newton.extension),
        np.array(newton.state.passive),
        [np.array(e) for e in newton.state.strain],
        np.zeros(count, dtype=bool),
        np.zeros(count, dtype=np.intp),
        np.zeros(count),
    )
    where = np.arange(count)
    previous = np.full(count, np.inf)
    closed = np.zeros(count, dtype=bool)
    with np.errstate(all="ignore"):
        for iteration in range(1, MAX_ITERATIONS + 1):
            size = newton.step()
            closed = (size < TOLERANCE) | ((size < STAGNATION) & (size > 0.5 * previous))
            ended = closed | ~np.isfinite(size)
            result.iterations[where[~result.converged[where]]] = iteration
            result.converged[where] |= closed
            if np.all(ended) or iteration == MAX_ITERATIONS:
                result.put(where, newton, np.ones(len(where), dtype=bool))
                break
            if 2 * np.count_nonzero(ended) > len(ended):
                result.put(where, newton, ended)
                newton.keep(~ended)
                where, size = where[~ended], size[~ended]
            previous = size
    return Configuration(
        Poses(result.position, result.rotation),
        result.extension,
        result.passive,
        tuple(result.strain),
        result.converged,
        result.iterations,
        result.conditioning,
    )
