"""What a machine is: limbs as chains of elements, with named parameters and actuators.

An element is a translation along, or a rotation about, one local axis. Its value is a linear map
of *variables*: a constant, named parameters (geometry), actuators (extension s) and passive
joints. A parameter is thus a locked joint: its error twist is the column that a joint would have
at that place (docs/derivation.md: one Newton step of the closure is the linear error model).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from calib.arrays import Array, BoolArray, IntArray
from calib.errors import BadInput
from calib.mechanism.axes import Axis, axes_of, units_of
from calib.mechanism.traits import NO_TRAITS, Traits

Kind = Literal["parameter", "actuator", "passive"]


@dataclass(frozen=True)
class Parameter:
    """A named geometric parameter.

    ``tolerance`` is the uniform half-width of manufacture and ``sigma`` the standard deviation of
    the Gaussian prior, both in ``unit`` (mm or rad).
    """

    name: str
    nominal: float
    unit: str
    tolerance: float
    sigma: float
    says: str = ""
    hidden: bool = False
    """An error source that is not calibrated: only the detailed machine has it."""


@dataclass(frozen=True)
class Actuator:
    """A driven coordinate q; the mechanism is extended by s = q - reference.

    ``reference`` is a number, or the name of the parameter whose value *in the controller* is the
    reference (hexapod: L0). ``home`` and ``limits`` are values of q, in ``unit``. ``gear``: turns
    of the motor for one of the joint; 0 where the file does not say.
    """

    name: str
    unit: str
    home: float
    limits: tuple[float, float]
    reference: float | str
    gear: float = 0.0


@dataclass(frozen=True)
class Term:
    """One term of an element's value: ``factor`` times a variable."""

    kind: Kind
    index: int
    factor: float


@dataclass(frozen=True)
class Element:
    """A translation along (``turns`` False) or rotation about (True) local ``axis`` 0, 1 or 2.

    Value = ``constant`` + sum of ``terms``. ``compliance`` > 0 makes it a virtual joint that
    yields under load, in mm/N or rad/(N mm).
    """

    turns: bool
    axis: int
    constant: float = 0.0
    terms: tuple[Term, ...] = ()
    compliance: float = 0.0


@dataclass(frozen=True)
class PassiveJoint:
    """A passive coordinate of a limb: name, rough value at home and limits, in mm or rad."""

    name: str
    start: float
    limits: tuple[float, float]
    turns: bool


@dataclass(frozen=True)
class PublishedRow:
    """A row of the closure whose weight is nobody's compliance: a unit force of the limb.

    It does no work on the element ``idle`` (None: the limb carries this wrench alone). With
    ``spans`` = (i, j, k) it is scaled by the area that the velocities of the joints i and j span
    at the axis of joint k, in units of the machine's size squared (Zhang et al. 2018, eq. 2).
    """

    idle: int | None
    spans: tuple[int, int, int] | None


@dataclass(frozen=True)
class Limb:
    """A chain from the base frame to the platform frame."""

    name: str
    elements: tuple[Element, ...]
    joints: tuple[PassiveJoint, ...]
    first_joint: int
    """Index of this limb's first passive coordinate among those of the machine."""
    released: bool = False
    """Whether its constraint is dropped: only what its actuators hold reaches the platform."""
    published_rows: tuple[PublishedRow, ...] | None = None
    """Rows weighted as somebody published them; None for the weights that follow from the
    compliances."""
    traits: Traits = NO_TRAITS
    """What its parts are: legs, universal joints, screws, sides of a parallelogram."""


@dataclass(frozen=True)
class Task:
    """Which coordinates of the pose the machine commands.

    ``coordinates`` from x, y, z (mm), rx, ry, rz (rad) or, for pointing machines, tilt and azimuth
    (rad) of the platform's z axis.
    """

    coordinates: tuple[str, ...]

    @property
    def pointing(self) -> bool:
        """Whether the machine commands the direction of the platform's z axis."""
        return "tilt" in self.coordinates


@dataclass(frozen=True, eq=False)
class Machine:
    """A machine as data. Everything else is derived from it.

    Attributes
    ----------
    home : tuple of 6 float
        Rough home pose x, y, z, rx, ry, rz; it selects the assembly branch.
    workspace : mapping
        Box of the task coordinates in which poses are sought: name -> (low, high).
    size : float
        Characteristic length in mm; it scales rotations against translations in the solver.
    """

    name: str
    says: str
    source: str
    limbs: tuple[Limb, ...]
    parameters: tuple[Parameter, ...]
    actuators: tuple[Actuator, ...]
    task: Task
    home: tuple[float, float, float, float, float, float]
    workspace: Mapping[str, tuple[float, float]]
    size: float
    extra: Mapping[str, object]
    """Tables of the file that the mechanism does not need (effects' settings and the like)."""
    detailed: "Machine | None" = None
    """The same machine with its hidden parameters, after those of this one; None without any.
    The two have the same joints: a configuration of one is a configuration of the other."""
    traits_stated: bool = True
    """Whether the file says what its parts are; else it was told by their names, if at all."""

    @cached_property
    def nominal(self) -> Array:
        """Nominal values, shape (P,), mm or rad."""
        return np.array([p.nominal for p in self.parameters])

    @cached_property
    def prior_sigma(self) -> Array:
        """Standard deviations of the priors, shape (P,), mm or rad."""
        return np.array([p.sigma for p in self.parameters])

    @cached_property
    def tolerance(self) -> Array:
        """Uniform half-widths of manufacture, shape (P,), mm or rad."""
        return np.array([p.tolerance for p in self.parameters])

    @cached_property
    def parameter_index(self) -> Mapping[str, int]:
        """Name -> position in ``parameters``."""
        return {p.name: i for i, p in enumerate(self.parameters)}

    @cached_property
    def joints(self) -> tuple[PassiveJoint, ...]:
        """All passive coordinates, limb after limb."""
        return tuple(joint for limb in self.limbs for joint in limb.joints)

    @cached_property
    def axes(self) -> tuple[Axis, ...]:
        """The actuators as errors along them are spoken of: unique name, unit, what is usual."""
        return axes_of(self.actuators, self.limbs)

    @cached_property
    def axes_by_unit(self) -> Mapping[str, IntArray]:
        """Unit -> indices of the axes in it, linear ones first."""
        return units_of(self.axes)

    @cached_property
    def home_q(self) -> Array:
        """Actuator coordinates at home, shape (n,)."""
        return np.array([a.home for a in self.actuators])

    @cached_property
    def q_limits(self) -> Array:
        """Actuator limits, shape (n, 2)."""
        return np.array([a.limits for a in self.actuators]).reshape(-1, 2)

    @cached_property
    def joint_limits(self) -> Array:
        """Limits of the passive coordinates, shape (n_joints, 2)."""
        return np.array([joint.limits for joint in self.joints]).reshape(-1, 2)

    @cached_property
    def limits(self) -> tuple[Array, Array]:
        """Lower and upper ends of actuators and passive coordinates together, (n + n_joints, 1)."""
        ends = np.concatenate([self.q_limits, self.joint_limits])
        return ends[:, :1].copy(), ends[:, 1:].copy()

    def index(self, name: str) -> int:
        """Position of a parameter; raises :class:`BadInput` for an unknown name."""
        try:
            return self.parameter_index[name]
        except KeyError:
            raise BadInput(
                f'machine "{self.name}" has no parameter "{name}"',
                remedy=f"Its parameters are {self._some_names()}.",
            ) from None

    def _some_names(self) -> str:
        names = [p.name for p in self.parameters]
        return ", ".join(names if len(names) <= 12 else [*names[:9], "...", names[-1]])

    def vector(self, values: Mapping[str, float]) -> Array:
        """Parameter vector (P,): nominal, but for the ``values`` given by name."""
        vector = self.nominal.copy()
        for name, value in values.items():
            vector[self.index(name)] = value
        return vector

    def reference(self, controller: Mapping[str, float] | None = None) -> Array:
        """Reference of every actuator, shape (n,), with the controller's own parameter values."""
        reference = self._references.copy()
        for k, a in enumerate(self.actuators if controller else ()):
            if isinstance(a.reference, str) and controller and a.reference in controller:
                reference[k] = controller[a.reference]
        return reference

    @cached_property
    def _references(self) -> Array:
        """References by nominal parameters (n,)."""
        return np.array(
            [
                self.nominal[self.index(a.reference)]
                if isinstance(a.reference, str)
                else a.reference
                for a in self.actuators
            ],
            dtype=np.float64,
        )

    def extension(self, q: Array, controller: Mapping[str, float] | None = None) -> Array:
        """Extension s = q - reference, shape (n, N), from actuator coordinates q (n, N)."""
        return q - self.reference(controller)[:, None]

    def coordinates(self, s: Array, controller: Mapping[str, float] | None = None) -> Array:
        """Actuator coordinates q = s + reference, shape (n, N)."""
        return s + self.reference(controller)[:, None]

    def within_stroke(self, q: Array) -> BoolArray:
        """Whether every actuator is within its limits, shape (N,); q is (n, N)."""
        low, high = self.q_limits.T
        inside: BoolArray = np.all((q >= low[:, None]) & (q <= high[:, None]), axis=0)
        return inside
