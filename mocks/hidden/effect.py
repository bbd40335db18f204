"""What can be wrong with a mock machine, one effect a file: its numbers, its physics, its draws.

A file of this folder holds a tuple ``EFFECTS``; nothing else needs to know it. An effect of the
catalogue has the catalogue's identifier and names (``backlash.leg3``); what begins with
``unknown.`` is the mock's own. Signs follow the catalogue; the arithmetic is nobody else's.

Physics that every machine shares is here, as functions that the machines call (:class:`Physics`).
What one kind of machine does in a way of its own (how its limbs grow, what a tilted joint does)
stays in that body, which asks the table for the numbers.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mocks.physics.circumstances import MILLIMETRES, Circumstances, Stroke
from mocks.physics.pose import Array

if TYPE_CHECKING:
    from mocks.hidden.table import Hidden

Table = dict[str, float]
LIMB = r"(leg[1-6]|limb[1-3]|q[1-9])"
"""Pattern of a limb's name in the pattern of an effect's numbers."""
EVERYWHERE = ("hexapod", "tripod", "ptm")


@dataclass(frozen=True)
class Site:
    """Where an effect is to be hidden.

    ``limbs`` those that an actuator drives each; ``nests`` of the platform; ``span_s`` how long
    the campaign lasts.
    """

    machine: str
    limbs: tuple[str, ...]
    nests: tuple[str, ...]
    stroke: Stroke = MILLIMETRES
    span_s: float = 1200.0

    @property
    def loaded(self) -> tuple[str, ...]:
        """Limbs that carry the weight: of an arm the shoulder and the elbow."""
        return self.limbs[1:3] if self.machine == "arm" else self.limbs

    @property
    def rotary(self) -> bool:
        """Whether its actuators turn."""
        return self.stroke.per_mm != MILLIMETRES.per_mm


@dataclass(frozen=True, eq=False)
class Nest:
    """A nest at ``centre`` (3,), mm, in the frame that carries it: the platform's, or the base."""

    name: str
    centre: Array
    on_platform: bool


@dataclass(frozen=True)
class Physics:
    """What an effect adds, as functions of the circumstances; None where it adds nothing.

    Attributes
    ----------
    extension
        (N, n), mm or rad, added to what the actuators do; ``play`` holds the effect's own
        elements only.
    compliance
        (N, n), mm/N or rad/(N mm), of each actuator under the load that it carries.
    friction
        (N, n), mm/N or rad/(N mm), with its sign: of each actuator, per size of the load.
    nest
        Displacement (N, 3) of a nest in the frame that carries it, at times (N,) s; ``down``
        (N, 3) is the direction of gravity there.
    stand
        Motion (N, 6) of the machine against the base frame, mm and rad (small), under the weight:
        force (N, 3) in N and moment (N, 3) in N mm about the base origin.
    payload_off
        Where the payload's centre of mass is, less where the load has it, (3,) mm, platform frame.
    base
        Displacement (N, 3) of points (N, 3) of the base frame at times (N,).
    seen
        Displacement (N, 3) of what the tracker reads at points (N, 3) of its frame, at times (N,);
        the campaign lasts ``span_s`` seconds, None if nobody knows.
    """

    extension: Callable[[Circumstances], Array] | None = None
    compliance: Callable[[Circumstances], Array] | None = None
    friction: Callable[[Circumstances], Array] | None = None
    nest: Callable[[Nest, Array, Array], Array] | None = None
    stand: Callable[[Array, Array], Array] | None = None
    payload_off: Array | None = None
    base: Callable[[Array, Array], Array] | None = None
    seen: Callable[[Array, Array, float | None], Array] | None = None


class HiddenEffect:
    """One thing that can be wrong.

    Attributes
    ----------
    id : str
        Identifier of the catalogue, or ``unknown.`` and a name.
    numbers : str
        Regular expression of what follows ``id.`` in the names of its numbers.
    says : str
        What its numbers mean, with their unit.
    machines : tuple of str
        Mock machines that can have it.
    arms : bool
        Whether arms can have it, too: what hangs on no part of a parallel machine.
    unseen : tuple of str
        Those on which it moves no simulated reading: no blind trial draws it there.
    steady : tuple of str
        Last parts of names of numbers that are no amplitudes: periods, moments, choices.
    trial, trial_rotary : float
        Amplitude with which a blind trial begins to look for a size, where actuators push and
        where they turn.
    linear : bool
        Whether readings move in proportion to its amplitudes, small ones.
    """

    id: str
    numbers: str
    says: str
    machines: tuple[str, ...] = EVERYWHERE
    arms: bool = True
    unseen: tuple[str, ...] = ()
    steady: tuple[str, ...] = ()
    trial: float = 0.01
    trial_rotary: float | None = None
    linear: bool = True

    def draw(self, site: Site, rng: np.random.Generator) -> Table:
        """Draw numbers for the blind trial; amplitudes count in units of the trial's."""
        raise NotImplementedError

    def example(self, site: Site) -> Table:
        """Numbers that show the effect clearly: the case in which it must be measured true."""
        raise NotImplementedError

    def widths(self, hidden: "Hidden", limbs: tuple[str, ...], stroke: Stroke) -> Array | None:
        """Full widths (n, K) of the play elements whose state it needs, in the actuators' unit."""
        return None

    def physics(self, hidden: "Hidden", limbs: tuple[str, ...], stroke: Stroke) -> Physics:
        """What it adds on any machine."""
        return Physics()

    def of(self, machine: str) -> bool:
        """Whether a mock machine, or an arm ("arm"), can have it."""
        return machine in self.machines or (machine == "arm" and self.arms)

    def known(self, name: str) -> bool:
        """Whether ``name`` begins with its identifier."""
        return name.startswith(f"{self.id}.")


def of_limbs(stem: str, site: Site, rng: np.random.Generator) -> Table:
    """Draw one limb, or all of them, with equal probability."""
    limbs = site.limbs
    chosen = limbs if rng.random() < 0.5 else (limbs[rng.integers(len(limbs))],)
    return {f"{stem}.{limb}": float(rng.standard_normal()) for limb in chosen}


def of_names(names: list[str], rng: np.random.Generator) -> Table:
    """Draw a number for each name."""
    return dict(zip(names, map(float, rng.standard_normal(len(names))), strict=True))


def either_sign(name: str, rng: np.random.Generator) -> Table:
    """Draw a sign."""
    return {name: float(rng.choice([-1.0, 1.0]))}
