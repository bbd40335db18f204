"""What a physical effect is to the model: named unknowns and an analytic signature.

An effect changes one or several of five things, and is linear in its unknowns but for those that
it declares nonlinear (a period, a time constant, a moment):

    extension of the actuators      (n, N)   mm or rad
    parameters of the machine       (P, N)   mm or rad
    nest where the SMR sits         (3, N)   mm, platform frame
    point that the tracker reads    (3, N)   mm, tracker frame

It answers with the derivative of those changes by each unknown (:class:`Signature`); the change
itself is the sum of unknown times derivative over the linear unknowns. An effect is one module in
``calib/effects`` with a tuple ``EFFECTS``; nothing else needs to know it.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from calib.arrays import Array, BoolArray, IntArray
from calib.effects.lever import lever_of, through, whitened_frame
from calib.mechanism.description import Machine
from calib.mechanism.jacobian import element_twists
from calib.mechanism.solve import Configuration
from calib.runs.stack import Rows
from calib.unknown import Unknown

Kind = Literal["machine", "measurement"]


@dataclass(frozen=True, eq=False)
class Situation:
    """Where the machine stood at each of N readings, as the model sees it now.

    Attributes
    ----------
    passive_home : (n_joints,)
        Passive coordinates at home.
    actuator_twists : (n, 6, N)
        Derivative of the platform's twist by each extension, base axes.
    state_twists : (P, 6, M)
        The same by each parameter, at each of the distinct states of ``state_of``.
    base_point, point : (3, N)
        SMR centre in the base frame and in the tracker frame, mm.
    frame_rotation : (3, 3, N)
        Base frame in the tracker frame.
    closed, state_of, parameters : Configuration of M, (N,), (P,) or (P, M)
        The machine closed at its M distinct states, the state of each reading, and the parameters
        with which it was closed; ``closing`` is the machine that was closed (see Effect.closure).
    slope, turner : (3, 3, N), optional
        Derivative of each reading's components by the point, in mm or rad per mm; whitened
        derivative by a rotation of the platform about the axes of the reading's frame. None where
        all readings are points.
    read : (3, N), optional
        What should be read, in the components that are; None where all readings are points.
    """

    rows: Rows
    passive_home: Array
    actuator_twists: Array
    state_twists: Array
    base_point: Array
    point: Array
    frame_rotation: Array
    closed: Configuration
    state_of: IntArray
    parameters: Array
    closing: Machine
    slope: Array | None = None
    turner: Array | None = None
    read: Array | None = None

    @cached_property
    def whitener(self) -> Array:
        """Whitened derivative (3, 3, N) of the readings by the point, in the tracker frame."""
        if self.slope is None:
            return self.rows.whitener
        return np.asarray(np.einsum("ijn,jkn->ikn", self.rows.whitener, self.slope))

    @property
    def machine(self) -> Machine:
        """The machine."""
        return self.rows.machine

    def twists_of(self, parameters: IntArray) -> Array:
        """Derivative (k, 6, N) of the platform's twist by some parameters, base axes."""
        return np.take(self.state_twists[parameters], self.state_of, axis=2)

    @cached_property
    def position(self) -> Array:
        """Platform in the base frame, (3, N)."""
        return self.closed.poses.position[:, self.state_of]

    @cached_property
    def rotation(self) -> Array:
        """The same: its axes, (3, 3, N)."""
        return self.closed.poses.rotation[:, :, self.state_of]

    @cached_property
    def passive(self) -> Array:
        """Passive coordinates, (n_joints, N)."""
        return self.closed.passive[:, self.state_of]

    @cached_property
    def whitened_frame(self) -> Array:
        """Whitener times frame rotation, (3, 3, N)."""
        return whitened_frame(self.whitener, self.frame_rotation)

    @cached_property
    def lever(self) -> Array:
        """Matrix (3, 6, N) from the platform's twist to the whitened reading."""
        arm = self.base_point - self.position
        lever = lever_of(self.whitened_frame, arm, self.rows.on_platform)
        if self.turner is not None:
            turned = whitened_frame(self.turner, self.frame_rotation)
            lever[:, 3:] += turned * self.rows.on_platform
        return lever

    @cached_property
    def actuator_columns(self) -> Array:
        """Whitened derivative (n, 3, N) of the readings by each extension."""
        return self.rows.folded(through(self.lever, self.actuator_twists))

    def element_twists(self, places: Sequence[tuple[int, int]]) -> Array:
        """Twist (len(places), 6, N) of the platform per mm or rad of (limb, element) each."""
        twists: Array = element_twists(self.closing, self.closed, self.parameters, places)
        return twists[:, :, self.state_of]


@dataclass(frozen=True, eq=False)
class Signature:
    """Derivatives by each of U unknowns; None where the effect leaves a thing alone."""

    extension: Array | None = None
    """(U, n, N)"""
    parameters: Array | None = None
    """(U, P, N)"""
    nest: Array | None = None
    """(U, 3, N), platform frame"""
    point: Array | None = None
    """(U, 3, N), tracker frame"""
    twist: Array | None = None
    """(U, 6, N), base axes, velocity of the platform's origin first"""


@dataclass(frozen=True, eq=False)
class Scan:
    """Signatures of k linear unknowns at T trials that differ by a factor of each reading alone.

    Attributes
    ----------
    steady : tuple of Signature
        Of the k unknowns; what the trials have in common.
    which : (T,)
        Which of them each trial goes by.
    factors : (T, k, N) or (T, 1, N)
    """

    steady: tuple[Signature, ...]
    which: IntArray
    factors: Array


class Effect(ABC):
    """A physical effect that the plain geometric model misses.

    Attributes
    ----------
    id : str
        Stable identifier for command line, JSON and reports.
    kind : "machine" or "measurement"
        Measurement effects explain residuals and are never written to a machine.
    says : str
        One sentence for the operator.
    channels : tuple of str
        Channels that a reading must have; readings without are left out for this effect.
    depends : tuple of str
        Columns of :class:`Rows` on which the extensions depend beside the pose: readings that
        agree in them share one closure. An effect that remembers names ``path`` (and ``time_s``
        if it matters how long the machine stood): it reads ``situation.rows.path``.
    ends_with_run : bool
        Whether what happened at some moment is over when its run ends: no follow-up sees it.
    beside : tuple of str
        Effects of which one must be in the model before this one is asked: what they explain in
        the main, and this one to the end. Empty for what is asked at once.
    wrong_sign : str
        What a negative value most likely says of the record; empty where both signs can be.
    wrong_size : str
        What a value that is no machine's most likely says of it.
    """

    id: str
    kind: Kind
    says: str
    channels: tuple[str, ...] = ()
    depends: tuple[str, ...] = ()
    ends_with_run: bool = False
    beside: tuple[str, ...] = ()
    wrong_sign: str = ""
    wrong_size: str = ""

    @property
    def of_its_run(self) -> bool:
        """Whether what it was in one run says nothing of how large it is in another."""
        return self.ends_with_run or {"run", "time_s"} <= set(self.depends)

    def lacking(self, machine: Machine) -> str:
        """Say what the machine file lacks for the effect to be defined; empty if it is."""
        return ""

    def applies(self, machine: Machine) -> bool:
        """Tell whether the effect is defined for this machine."""
        return not self.lacking(machine)

    def unavailable(self, rows: Rows) -> str:
        """Say why these readings cannot show the effect; empty if they can."""
        for name in self.channels:
            if name not in rows.channels:
                return f"the run has no column {name}"
            values = rows.channels[name][rows.on_platform & np.isfinite(rows.channels[name])]
            if values.size == 0:
                return f"the column {name} is empty"
            if name.endswith("_C") and not -40.0 < float(np.median(values)) < 60.0:
                return f"{name} reads {np.median(values):.4g}, which is no room in deg C"
        return ""

    def told(self, rows: Rows) -> BoolArray:
        """Readings (N,) of whose runs it is known what the effect needs; others are left out."""
        return np.ones(rows.count, dtype=bool)

    def hard_to_see(self, machine: Machine, extension: Array) -> str:
        """Say why poses with extensions (n, N) show little of it; empty if they do not say so."""
        return ""

    @abstractmethod
    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """Name the unknowns."""

    def parts(self, rows: Rows) -> tuple[tuple[int, ...], ...]:
        """Groups of linear unknowns that may act alone (one leg); tested beside the whole."""
        return ()

    def trials(self, rows: Rows) -> Iterator[tuple[float, ...]]:
        """Values of the nonlinear unknowns to be searched, in the order of the unknowns."""
        yield ()

    def trials_beside(self, rows: Rows, held: Mapping[str, Array]) -> Iterator[tuple[float, ...]]:
        """The same once effects are in the model, by their values (U,); all of them if not said."""
        yield from self.trials(rows)

    def closure(self, machine: Machine, values: Array) -> Machine:
        """Machine that is closed while the effect is in the model, if not the plain one."""
        return machine

    def rest(self, rows: Rows) -> Array:
        """Values (U,) at which the effect adds nothing to what its closure does by itself."""
        return np.zeros(len(self.unknowns(rows)))

    def refined(self, rows: Rows, trial: tuple[float, ...]) -> Iterator[tuple[float, ...]]:
        """Values closer about the best trial, for unknowns that the fit cannot move itself."""
        yield trial

    def scan(self, situation: Situation, trials: Sequence[tuple[float, ...]]) -> Scan | None:
        """All :attr:`trials` at once, the effect doing nothing yet; None: signature by signature.

        For effects with many trials, as it is many times as fast.
        """
        return None

    @abstractmethod
    def signature(self, situation: Situation, values: Array) -> Signature:
        """Derivatives at ``values`` (U,)."""


def alone(count: int, each: int = 1) -> tuple[tuple[int, ...], ...]:
    """Parts of ``each`` successive unknowns: one leg, one nest or one axis alone."""
    return tuple(tuple(range(each * k, each * k + each)) for k in range(count))


def per_actuator(shape: Array) -> Array:
    """One unknown for each actuator: (n, N) -> (n, n, N) with ``shape`` on the diagonal."""
    count = shape.shape[0]
    spread = np.zeros((count * count, shape.shape[1]))
    spread[:: count + 1] = shape
    return spread.reshape(count, count, -1)
