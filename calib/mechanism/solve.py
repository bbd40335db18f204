"""Exact kinematics: Newton on the closure, vectorised over poses.

Forward: the platform pose for given extensions. Inverse: the extensions for given task
coordinates. Both take one parameter vector, or one for each pose; both carry their result as a
:class:`Configuration`, which starts the next solution nearby.
"""

from dataclasses import replace
from functools import lru_cache

import numpy as np

from calib.arrays import Array, Numbers
from calib.mechanism.closure import Closure
from calib.mechanism.compiled import compile_machine
from calib.mechanism.configuration import Configuration, joined
from calib.mechanism.description import Machine
from calib.mechanism.extrapolate import Extrapolation, probe_steps
from calib.mechanism.kernel import Kernel, kernel_of
from calib.mechanism.newton import MAX_STEP, Newton, run
from calib.mechanism.rigid import Poses, from_euler
from calib.mechanism.series import forward_numbers, inverse_numbers
from calib.mechanism.sweep import Standing
from calib.mechanism.task import FULL, task_values

__all__ = [
    "CHUNK",
    "Configuration",
    "begun_at",
    "forward",
    "home_configuration",
    "inverse",
    "settle_limbs",
]

CHUNK = 1024
"""Poses solved together: small enough that the working set stays in the cache."""
LATE = 12
"""Newton steps from home after which a closure is sought again, along the way there,"""
STRIDES = 16
"""in so many strides;"""
FEW = 0.1
"""but not where a larger part of the poses would take it: they belong to no such machine."""
SETTLING = 12
"""Steps in which limbs settle at the stated home before the machine is closed."""


def _start_state(machine: Machine, count: int, dtype: np.dtype[np.generic]) -> Standing:
    """Home pose and rough joint values of the machine file, for ``count`` poses."""
    compiled = compile_machine(machine)
    rotation = from_euler(*np.array(machine.home[3:]))
    return Standing(
        np.repeat(np.array(machine.home[:3], dtype=dtype)[:, None], count, axis=1),
        np.repeat(rotation.astype(dtype)[:, :, None], count, axis=2),
        np.repeat(compiled.joint_start.astype(dtype)[:, None], count, axis=1),
        [np.zeros((len(g.compliant), g.count, count), dtype=dtype) for g in compiled.groups],
    )


def settle_limbs(machine: Machine, extension: Array, state: Standing) -> None:
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
    return run(Newton(machine, machine.nominal[:, None], extension, state, None, np.zeros(1)))


@lru_cache(maxsize=64)
def _extrapolation(machine: Machine) -> Extrapolation | None:
    """Series of the nominal machine about home; None where its neighbourhood does not close."""
    home = home_configuration(machine)
    near = forward(machine, home.extension + probe_steps(machine), None, home)
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


@lru_cache(maxsize=64)
def _series(machine: Machine, inverse: bool) -> Array | None:
    """Where the compiled core begins if nobody says where; None: at home."""
    home, kernel = home_configuration(machine), kernel_of(machine)
    if not inverse:
        series = _extrapolation(machine)
        return None if series is None else forward_numbers(home, series)
    if kernel is None or not kernel.independent:
        return None
    return inverse_numbers(machine, kernel, home)


def _start(machine: Machine, inverse: bool, start: Configuration | None) -> Configuration | Array:
    if start is not None:
        return start
    series = _series(machine, inverse)
    return home_configuration(machine) if series is None else series


def _kernel(
    machine: Machine, asked: Numbers, held: Numbers, start: Configuration | None
) -> Kernel | None:
    """The compiled core, where it knows the machine and all is real."""
    return kernel_of(machine, asked, held, *([start.poses.position] if start else []))


def _state_from(
    start: Configuration, count: int, dtype: np.dtype[np.generic], part: slice
) -> Standing:
    def spread(a: Numbers) -> Numbers:
        if a.shape[-1] == 1:
            return np.repeat(a.astype(dtype), count, axis=-1)
        return a[..., part].astype(dtype)

    return Standing(
        spread(start.poses.position),
        spread(start.poses.rotation),
        spread(start.passive),
        [spread(e) for e in start.strain],
    )


def begun_at(machine: Machine, at: Configuration) -> Configuration:
    """Start for another closure of the same limbs: pose and joints as they are, nothing strained.

    Parameters
    ----------
    machine : Machine
        With the joints of the machine that was closed; other limbs may be rigid or released.
    at : Configuration of N poses
    """
    groups = compile_machine(machine).groups
    strain = tuple(np.zeros((len(g.compliant), g.count, at.count)) for g in groups)
    return replace(at, strain=strain)


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
    extension, held = np.asarray(extension), _columns(parameters, machine)
    closed = _closed(machine, extension, held, start)
    if start is not None:
        return closed
    late = np.flatnonzero(~closed.converged | (closed.iterations > LATE))
    if not 0 < late.size <= max(1.0, FEW * closed.count):
        return closed
    own = held if held.shape[1] == 1 else held[:, late]
    along = _followed(machine, extension[:, late], own)
    reached = along.converged
    order = np.arange(closed.count)
    order[late[reached]] = closed.count + np.flatnonzero(reached)
    return joined([closed, along]).take(order)


def _closed(
    machine: Machine, extension: Numbers, held: Numbers, start: Configuration | None
) -> Configuration:
    kernel = _kernel(machine, extension, held, start)
    if kernel is None:
        return _solve(machine, extension, None, held, start)
    return kernel.solve(held, extension, None, None, _start(machine, False, start))


def _followed(machine: Machine, extension: Numbers, held: Numbers) -> Configuration:
    """Close at ``extension`` (n, N) by strides from home: assembled as it is there."""
    at = home_configuration(machine)
    begin = at.extension
    for part in np.linspace(0.0, 1.0, STRIDES + 1)[1:]:
        at = _closed(machine, begin + part * (extension - begin), held, at)
    return at


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
    held, goal = _columns(parameters, machine), None
    if not isinstance(target, Poses):
        values = np.asarray(target)
    elif machine.task.coordinates == FULL:
        values, goal = target.position, target.rotation
    else:
        values = task_values(machine.task, target)
    kernel = _kernel(machine, values, held, start)
    if kernel is not None and kernel.inverts:
        return kernel.solve(held, None, values, goal, _start(machine, True, start))
    if isinstance(target, Poses):
        values = task_values(machine.task, target)
    return _solve(machine, None, values, held, start)


def _solve(
    machine: Machine,
    extension: Numbers | None,
    target: Numbers | None,
    held: Numbers,
    start: Configuration | None,
) -> Configuration:
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
        newton = Newton(
            machine,
            held if held.shape[1] == 1 else held[:, part],
            own,
            _state_from(start, n, dtype, part),
            None if target is None else target[:, part],
            np.zeros(n),
        )
        parts.append(run(newton))
    return joined(parts)
