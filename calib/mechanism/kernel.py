"""The compiled core, where it was built: the kinematics of the numpy arrays, many times faster.

The core (``core/*.c``) is built when pkmcal is installed and a C compiler is there. Without it,
with complex numbers, or for a machine with rows that somebody published, the numpy code of
:mod:`calib.mechanism.newton` and :mod:`calib.mechanism.closure` does the work. It is the reference:
laws compare the two.
A process that is started with ``PKMCAL_COMPILED=off`` in its environment goes without the core.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from calib.arrays import Array, Numbers
from calib.mechanism import tables
from calib.mechanism.compiled import compile_machine
from calib.mechanism.configuration import Configuration
from calib.mechanism.description import Machine
from calib.mechanism.rigid import Poses

try:
    from calib.mechanism import _core
except ImportError:
    _built = False
else:
    _built = _core.VERSION == tables.VERSION

_FLOAT = np.dtype(float)
_wanted = True


def available() -> bool:
    """Whether the core was built, for this version of the tables."""
    return _built


def processor() -> str:
    """Which compilation of the core runs here; empty without the core."""
    return _core.processor() if _built else ""


def use(compiled: bool) -> None:
    """Whether the core may be used from now on; without it, it makes no difference."""
    global _wanted
    _wanted = compiled


def wanted() -> bool:
    """Whether what is compiled may be used: not within :func:`reference`."""
    return _wanted


@contextmanager
def reference() -> Iterator[None]:
    """Within it numpy alone does the work."""
    before = _wanted
    use(False)
    try:
        yield
    finally:
        use(before)


def kernel_of(machine: Machine, *numbers: Numbers) -> "Kernel | None":
    """The compiled kinematics of a machine; None where numpy has to do it.

    ``numbers`` are what it shall work on: complex ones are not for it.
    """
    if not (_built and _wanted) or any(a.dtype.kind == "c" for a in numbers):
        return None
    return _kernel(machine)


@lru_cache(maxsize=64)
def _kernel(machine: Machine) -> "Kernel | None":
    if not tables.fits(machine):
        return None
    groups = compile_machine(machine).groups
    ints, reals = tables.flat_tables(machine)
    return Kernel(
        _core.prepare(ints, reals),
        len(machine.joints),
        len(machine.actuators),
        tuple((len(g.compliant), g.count) for g in groups),
        sum(g.rows * g.count for g in groups),
        len(machine.parameters),
        len(machine.task.coordinates),
        bool(ints[tables.INDEPENDENT]),
    )


@dataclass(frozen=True, eq=False)
class Kernel:
    """One machine's tables, and how to call the core with them; arrays as in :mod:`solve`."""

    machine: "_core.Tables"
    joints: int
    actuators: int
    strained: tuple[tuple[int, int], ...]
    """(n_compliant, L) of every group of limbs."""
    row_count: int
    parameters: int
    tasks: int
    independent: bool
    """Whether its inverse is solved limb by limb."""

    @property
    def inverts(self) -> bool:
        """Whether it solves the inverse: not where actuators outnumber what is commanded."""
        return self.tasks >= self.actuators

    def solve(
        self,
        parameters: Numbers,
        extension: Numbers | None,
        target: Numbers | None,
        goal: Numbers | None,
        start: "Configuration | Array",
    ) -> Configuration:
        """Close the machine at ``extension``, or so that it reaches ``target`` (and ``goal``).

        ``start`` is a configuration, or the numbers of a series about home.
        """
        asked = extension if extension is not None else target
        assert asked is not None
        count = asked.shape[1]
        strains = sum(c * limbs for c, limbs in self.strained)
        out = np.empty((15 + self.joints + self.actuators + strains, count))
        begin: tuple[Array | None, ...]
        if isinstance(start, Configuration):
            series, begin = None, self.place(start)
        else:
            series, begin = start, (None,)
        _core.solve(
            self.machine,
            count,
            _real(parameters),
            None if extension is None else _real(extension),
            None if target is None else _real(target),
            None if goal is None else _real(goal),
            series,
            out,
            *begin,
        )
        return self._configuration(out)

    def _configuration(self, out: Array) -> Configuration:
        passive = 12 + self.joints
        strain = passive + self.actuators
        strains = []
        count = out.shape[1]
        first = strain
        for compliant, limbs in self.strained:
            rows = out[first : first + compliant * limbs]
            strains.append(rows.reshape(compliant, limbs, count))
            first += compliant * limbs
        return Configuration(
            Poses(out[:3], out[3:12].reshape(3, 3, count)),
            out[passive:strain],
            out[12:passive],
            tuple(strains),
            out[first + 1] > 0.5,
            out[first + 2].astype(np.intp),
            out[first],
        )

    def jacobians(self, parameters: Numbers, at: Configuration) -> tuple[Array, Array]:
        """Twists per unit of each parameter (P, 6, N) and each actuator (n, 6, N)."""
        by_parameter = np.empty((self.parameters, 6, at.count))
        by_actuator = np.empty((self.actuators, 6, at.count))
        _core.differentiate(
            self.machine, at.count, _real(parameters), *self.place(at), by_parameter, by_actuator
        )
        return by_parameter, by_actuator

    def element_twists(
        self, parameters: Numbers, at: Configuration, places: Sequence[tuple[int, int]]
    ) -> Array:
        """Twists (len(places), 6, N) per unit of single elements, (limb, element)."""
        pairs = np.array(places, dtype=np.intc).reshape(-1, 2)
        out = np.zeros((len(pairs), 6, at.count))
        _core.lock(self.machine, at.count, _real(parameters), *self.place(at), pairs, out)
        return out

    def rows(self, parameters: Numbers, at: Configuration) -> tuple[Array, Array]:
        """Rows A (m, 6, N) and gaps b (m, N) of the closure, limb after limb."""
        out = np.empty(7 * self.row_count * at.count)
        _core.rows(self.machine, at.count, _real(parameters), *self.place(at), out)
        split = 6 * self.row_count * at.count
        return out[:split].reshape(-1, 6, at.count), out[split:].reshape(-1, at.count)

    def place(self, at: Configuration) -> tuple[Array, Array, Array, Array, Array]:
        """Position, rotation, passive, extension and strain as the core takes them."""
        strain = [_real(s).reshape(-1) for s in at.strain if s.size]
        return (
            _real(at.poses.position),
            _real(at.poses.rotation),
            _real(at.passive),
            _real(at.extension),
            np.concatenate(strain) if strain else _NOTHING,
        )


_NOTHING = np.empty(0)


def _real(values: Numbers) -> Array:
    return np.ascontiguousarray(values, dtype=_FLOAT)
