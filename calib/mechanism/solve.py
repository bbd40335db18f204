"""Exact kinematics: Newton on the closure, vectorised over poses.

Forward: the platform pose for given extensions. Inverse: the extensions for given task
coordinates. Both take one parameter vector, or one for each pose; both carry their result as a
:class:`Configuration`, which starts the next solution nearby.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from calib.arrays import Array, BoolArray, IntArray, Numbers, Selection
from calib.errors import BadInput
from calib.mechanism.closure import Closure, State
from calib.mechanism.compiled import compile_machine
from calib.mechanism.description import Machine
from calib.mechanism.extrapolate import Extrapolation, probe_steps
from calib.mechanism.householder import Reflectors, factorise
from calib.mechanism.rigid import Poses, exponential, from_euler, product
from calib.mechanism.task import task_error, task_rows, task_values

CHUNK = 1024
"""Poses solved together: small enough that the working set stays in the cache."""
MAX_ITERATIONS = 60
MAX_STEP = 0.4
"""Largest step, in rad for turns and as a part of the machine's size for lengths."""
SETTLING = 12
"""Steps in which limbs settle at the stated home before the machine is closed."""
TOLERANCE = 1e-10
"""A step this small is the last: what is left after it is its square."""
STAGNATION = 1e-8
"""Steps that no longer shrink are rounding if they are smaller than this."""


@dataclass(frozen=True, eq=False)
class Configuration:
    """A machine closed at N poses.

    Attributes
    ----------
    poses : Poses
        Platform in the base frame.
    extension : (n, N)
        Actuator extensions s, mm or rad.
    passive : (n_joints, N)
        Passive coordinates, limb after limb, mm or rad.
    strain : tuple of (n_compliant, L, N)
        Elastic deflections, by group of limbs; empty for a rigid machine.
    converged : (N,) bool
    iterations : (N,) int
        Newton steps taken.
    conditioning : (N,)
        Smallest over largest diagonal of the triangle of the stacked rows: near zero at a
        singularity.
    """

    poses: Poses
    extension: Array
    passive: Array
    strain: tuple[Array, ...]
    converged: BoolArray
    iterations: IntArray
    conditioning: Array

    @property
    def count(self) -> int:
        """Number of poses N."""
        return self.poses.count

    def take(self, which: Selection) -> "Configuration":
        """Configurations selected by index, slice or mask."""
        return Configuration(
            self.poses.take(which),
            self.extension[:, which],
            self.passive[:, which],
            tuple(e[:, :, which] for e in self.strain),
            self.converged[which],
            self.iterations[which],
            self.conditioning[which],
        )


def _joined(parts: list[Configuration]) -> Configuration:
    if len(parts) == 1:
        return parts[0]
    return Configuration(
        Poses(
            np.concatenate([p.poses.position for p in parts], axis=-1),
            np.concatenate([p.poses.rotation for p in parts], axis=-1),
        ),
        np.concatenate([p.extension for p in parts], axis=-1),
        np.concatenate([p.passive for p in parts], axis=-1),
        tuple(
            np.concatenate([p.strain[g] for p in parts], axis=-1)
            for g in range(len(parts[0].strain))
        ),
        np.concatenate([p.converged for p in parts]),
        np.concatenate([p.iterations for p in parts]),
        np.concatenate([p.conditioning for p in parts]),
    )


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
class _Newton:
    """One batch of poses on its way to closure. Solves for the pose, or for the extensions."""

    machine: Machine
    parameters: Numbers
    extension: Numbers
    state: State
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
        inner = factorise(np.einsum("tin,ian->tan", T, D))
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
            units = np.array(
                [self.machine.size if a.unit == "mm" else 1.0 for a in self.machine.actuators]
            )
            size = np.maximum(size, np.max(np.abs(ds) / units[:, None], axis=0))
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
        state = self.state
        if self.parameters.shape[1] > 1:
            self.parameters = self.parameters[:, which]
        self.extension = self.extension[:, which]
        if self.target is not None:
            self.target = self.target[:, which]
        self.state = State(
            state.position[:, which],
            state.rotation[:, :, which],
            state.passive[:, which],
            [e[:, :, which] for e in state.strain],
        )


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

    def put(self, where: IntArray, newton: _Newton, which: BoolArray) -> None:
        """Store the poses ``which`` of the batch at the places ``where[which]``."""
        to, state = where[which], newton.state
        self.position[:, to] = state.position[:, which]
        self.rotation[:, :, to] = state.rotation[:, :, which]
        self.extension[:, to] = newton.extension[:, which]
        self.passive[:, to] = state.passive[:, which]
        for mine, theirs in zip(self.strain, state.strain, strict=True):
            mine[:, :, to] = theirs[:, :, which]
        self.conditioning[to] = newton.conditioning[which]


def _run(newton: _Newton) -> Configuration:
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


def _start_state(machine: Machine, count: int, dtype: np.dtype[np.generic]) -> State:
    """Home pose and rough joint values of the machine file, for ``count`` poses."""
    compiled = compile_machine(machine)
    rotation = from_euler(*np.array(machine.home[3:]))
    return State(
        np.repeat(np.array(machine.home[:3], dtype=dtype)[:, None], count, axis=1),
        np.repeat(rotation.astype(dtype)[:, :, None], count, axis=2),
        np.repeat(compiled.joint_start.astype(dtype)[:, None], count, axis=1),
        [np.zeros((len(g.compliant), g.count, count), dtype=dtype) for g in compiled.groups],
    )


def settle_limbs(machine: Machine, extension: Array, state: State) -> None:
    """Bring every limb's end as near to the platform as its passive joints can, platform held.

    Rough joint angles (all zero, say) may be singular for the limbs together; after this they are
    those of the stated pose. Changes ``state.passive``.
    """
    with np.errstate(all="ignore"):
        for _ in range(SETTLING):
            closure = Closure(machine, machine.nominal[:, None], extension, state)
            for limb in closure.limbs:
                step = limb.factors.solve_triangle(limb.factors.apply_transposed(limb.gap))
                largest = np.max(np.abs(step) / limb.group.unit, axis=0, initial=1e-300)
                step = step * np.minimum(1.0, MAX_STEP / largest)
                state.passive[limb.group.passive] += np.where(np.isfinite(step), step, 0.0)


@lru_cache(maxsize=64)
def home_configuration(machine: Machine) -> Configuration:
    """The nominal machine closed at its home extensions; not converged if it cannot close."""
    extension = machine.extension(machine.home_q[:, None])
    state = _start_state(machine, 1, np.dtype(float))
    settle_limbs(machine, extension, state)
    return _run(_Newton(machine, machine.nominal[:, None], extension, state, None, np.zeros(1)))


@lru_cache(maxsize=64)
def _extrapolation(machine: Machine) -> Extrapolation | None:
    """Series of the nominal machine about home; None where its neighbourhood does not close."""
    home = home_configuration(machine)
    near = _solve(machine, home.extension + probe_steps(machine), None, None, home)
    if not (np.all(home.converged) and np.all(near.converged)):
        return None
    return Extrapolation.fit(machine, _places(home), _places(near))


def _places(at: Configuration) -> tuple[Array, Array, Array]:
    return at.poses.position, at.poses.rotation, at.passive


def _guess(machine: Machine, extension: Array) -> Configuration:
    """Where to start for ``extension`` (n, N): extrapolated from home, or home itself."""
    home, series = home_configuration(machine), _extrapolation(machine)
    if series is None:
        return home
    with np.errstate(all="ignore"):
        position, rotation, passive = series.guess(extension - home.extension)
    count = extension.shape[1]
    return Configuration(
        Poses(position, rotation),
        extension,
        passive,
        tuple(np.repeat(strain, count, axis=2) for strain in home.strain),
        np.repeat(home.converged, count),
        np.zeros(count, dtype=np.intp),
        np.repeat(home.conditioning, count),
    )


def _state_from(
    start: Configuration, count: int, dtype: np.dtype[np.generic], part: slice
) -> State:
    def spread(a: Numbers) -> Numbers:
        if a.shape[-1] == 1:
            return np.repeat(a.astype(dtype), count, axis=-1)
        return a[..., part].astype(dtype)

    return State(
        spread(start.poses.position),
        spread(start.poses.rotation),
        spread(start.passive),
        [spread(e) for e in start.strain],
    )


def _columns(parameters: Numbers | None, machine: Machine) -> Numbers:
    values = machine.nominal if parameters is None else np.asarray(parameters)
    return values[:, None] if values.ndim == 1 else values


def forward(
    machine: Machine,
    extension: Numbers,
    parameters: Numbers | None = None,
    start: Configuration | None = None,
) -> Configuration:
    """Platform poses for given actuator extensions, exactly.

    Parameters
    ----------
    machine : Machine
    extension : array, shape (n, N)
        Actuator extensions s = q - reference, mm or rad.
    parameters : array, shape (P,) or (P, N), optional
        Geometric parameters; nominal if not given.
    start : Configuration of N poses, or of one, optional
        Where Newton starts; extrapolated from home if not given.

    Returns
    -------
    Configuration
        Poses that did not close have ``converged`` False; they never disturb the others.

    Raises
    ------
    BadInput
        If the limbs do not hold the platform.
    """
    extension = np.asarray(extension)
    return _solve(machine, extension, None, parameters, start)


def inverse(
    machine: Machine,
    target: Poses | Numbers,
    parameters: Numbers | None = None,
    start: Configuration | None = None,
) -> Configuration:
    """Extensions that bring the platform to given task coordinates, exactly.

    For a machine that commands fewer than six coordinates the others are what its closure makes
    of them.

    Parameters
    ----------
    machine : Machine
    target : Poses, or array of shape (n, N)
        Task coordinates in the order of ``machine.task``, mm and rad.
    parameters, start
        As for :func:`forward`.
    """
    values = task_values(machine.task, target) if isinstance(target, Poses) else np.asarray(target)
    return _solve(machine, None, values, parameters, start)


def _solve(
    machine: Machine,
    extension: Numbers | None,
    target: Numbers | None,
    parameters: Numbers | None,
    start: Configuration | None,
) -> Configuration:
    held = _columns(parameters, machine)
    if start is None and extension is not None:
        start = _guess(machine, np.real(extension))
    start = start or home_configuration(machine)
    asked = extension if extension is not None else target
    assert asked is not None
    count = asked.shape[1]
    dtype = np.result_type(asked, held, start.poses.position)
    parts = []
    for first in range(0, max(count, 1), CHUNK):
        part = slice(first, min(first + CHUNK, count))
        n = part.stop - part.start
        if extension is not None:
            own = extension[:, part].astype(dtype)
        elif start.count == 1:
            own = np.repeat(start.extension.astype(dtype), n, axis=1)
        else:
            own = start.extension[:, part].astype(dtype)
        newton = _Newton(
            machine,
            held if held.shape[1] == 1 else held[:, part],
            own,
            _state_from(start, n, dtype, part),
            None if target is None else target[:, part],
            np.zeros(n),
        )
        parts.append(_run(newton))
    return _joined(parts)
