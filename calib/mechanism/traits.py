"""What the parts of a limb are, beside how they move: the traits that a machine file states.

Physical effects hang on these and on nothing else (docs/machine-files.md). Elements are given by
their place in the limb's chain, which is the same for the machine with its hidden error sources
and for every other closure of it.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Part:
    """An element of a chain, and how far it moves per unit of what the file names."""

    element: int
    factor: float


@dataclass(frozen=True)
class UniversalJoint:
    """Two passive turns: ``first`` about an axis fixed to the body, ``second`` next to the leg."""

    first: int
    second: int


@dataclass(frozen=True)
class LinkMass:
    """A mass that rides on a chain: ``kg``, its centre in the frame behind an element, mm."""

    element: int
    kg: float
    centre: tuple[float, float, float]


@dataclass(frozen=True)
class Traits:
    """Traits of one chain.

    Attributes
    ----------
    grows : tuple of int
        Translations that are legs, rods or links: they grow with the temperature.
    base_joint, platform_joint : UniversalJoint or None
        The universal joints at the two ends of the leg; what they stand on may be a carriage.
    screw : int or None
        Passive turn of a leg that is a screw without a guide, about the screw's own axis.
    sides : tuple of Part
        Long sides of a parallelogram: half of side 1 less side 2, each in the direction in which
        the difference grows.
    platform_azimuth : tuple of Part
        Turn of the platform joint's frame about the platform's z axis.
    yields : int or None
        The compliant element that is a spring under the weight of the platform.
    pulls : int or None
        The compliant element of a rope: it carries tension alone.
    masses : tuple of LinkMass
        Links of a chain whose joints are all driven, as far as they have a weight.
    """

    grows: tuple[int, ...] = ()
    base_joint: UniversalJoint | None = None
    platform_joint: UniversalJoint | None = None
    screw: int | None = None
    sides: tuple[Part, ...] = ()
    platform_azimuth: tuple[Part, ...] = ()
    yields: int | None = None
    pulls: int | None = None
    masses: tuple[LinkMass, ...] = ()


NO_TRAITS = Traits()
