"""What a kind of device is: its name in the site file, its settings, and how it is opened.

A driver is a package that offers a :class:`Kind` by an entry point of one of three groups; those
that ship with the program are found the same way::

    [project.entry-points."pkmcal.trackers"]
    line-stream = "my_tracker:KIND"

The name of the entry point is what ``kind = "..."`` says in the site file. Each setting is
declared once: the reader of site files checks it with line and remedy, ``pkmcal site kinds NAME``
lists it. docs/write-a-driver.md goes through an example.
"""

from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final, Generic, Literal, TypeVar

from drivers.interface import Gauge, MotionController, Motors, PoseMover, Tracker

CONTROLLERS: Final = "pkmcal.controllers"
TRACKERS: Final = "pkmcal.trackers"
GAUGES: Final = "pkmcal.gauges"

Form = Literal[
    "text", "whole", "number", "numbers", "flag", "words", "address", "file", "files", "table"
]
"""Forms of a setting.

``text``, ``whole`` (an int), ``number``, ``flag`` (a bool); ``numbers`` (a list of ``count``);
``words`` (a text of words apart by spaces, a list of str); ``address`` (``host:port``); ``file``
(a path, made absolute from the folder of the site file); ``files`` (one path for all of ``count``,
or a list of so many; a list of str); ``table`` (any keys: what they are is
another program's business).
"""


class _Required:
    def __repr__(self) -> str:
        return "REQUIRED"


REQUIRED: Final = _Required()


@dataclass(frozen=True)
class Setting:
    """One key of a device's table in the site file.

    Attributes
    ----------
    name : str
    form : str
        One of :data:`Form`.
    says : str
        One sentence for who writes the site file, with the unit.
    default : object
        Value where the key is left out; :data:`REQUIRED` where it may not be.
    choices : tuple of str
        Of a text: the only ones.
    least, most : float
        Range of a number, or of each of several.
    count : int or "actuators"
        How many numbers or words there must be: so many, or one for each actuator of the machine;
        None for any number of them.
    port : int
        Of an address: the port where only the host is written; 0 where it must be written.
    check : function
        Of a value that has the right form: what is wrong with it, in words; empty if nothing.
    """

    name: str
    form: Form
    says: str
    default: Any = REQUIRED
    choices: tuple[str, ...] = ()
    least: float | None = None
    most: float | None = None
    count: int | Literal["actuators"] | None = None
    port: int = 0
    check: Callable[[Any], str] | None = None

    @property
    def required(self) -> bool:
        """Whether the site file must have it."""
        return self.default is REQUIRED


@dataclass(frozen=True)
class ActuatorFacts:
    """An actuator as the machine file has it; home and limits are values of q, in ``unit``."""

    name: str
    unit: str
    home: float
    limits: tuple[float, float]


@dataclass(frozen=True)
class Strut:
    """A leg that is a screw without a guide, between two universal joints.

    Attributes
    ----------
    limb : str
    base_normal, platform_normal : tuple of float
        Unit vectors of the first axes of its joints, base and platform frame.
    home_turn : float
        Turn about the strut, right-handed from base to platform, from the second axis of the base
        joint to that of the platform joint, in the drawing at home; rad.
    """

    limb: str
    base_normal: tuple[float, float, float]
    platform_normal: tuple[float, float, float]
    home_turn: float


@dataclass(frozen=True)
class Surroundings:
    """What a driver is told when it is opened.

    Attributes
    ----------
    settings : mapping
        Every setting of the kind by its name, checked, defaults filled in.
    serial : str
        Serial number that the site file expects; empty for any.
    machine : str
        Name of the machine.
    actuators : tuple of ActuatorFacts
        In the order of the machine file.
    parameters : mapping of str to float
        Names and nominal values of the machine's parameters, mm or rad.
    time_scale : float
        Machine seconds per wall second; 1 but with a mock.
    description : object
        The machine as the program has read it, for kinds whose host computes the motion.
    struts : tuple of Strut
        Where every limb is one, in the order of the limbs; else empty.
    """

    settings: Mapping[str, Any]
    serial: str
    machine: str
    actuators: tuple[ActuatorFacts, ...]
    parameters: Mapping[str, float]
    time_scale: float = 1.0
    description: object = None
    struts: tuple[Strut, ...] = ()


DeviceT = TypeVar("DeviceT", MotionController, Motors, PoseMover, Tracker, Gauge)

Takes = Literal["parameters", "actuators", "poses"]
"""What a controller takes: parameters and poses, or actuator values alone, or poses alone."""
Tells = Literal["number", "contact"]
"""What a gauge tells: a number, or only whether it touches."""


@dataclass(frozen=True)
class Kind(Generic[DeviceT]):
    """A kind of device.

    Attributes
    ----------
    says : str
        One sentence: which devices these are.
    settings : tuple of Setting
    open : coroutine function
        Connects; raises a :class:`drivers.errors.DeviceError` within a deadline of its own.
    address : function
        From the settings, what names this very device: it is shown, and locks the machine.
    takes : str
        Of a controller: "parameters" if it opens a :class:`~drivers.interface.MotionController`,
        "actuators" for :class:`~drivers.interface.Motors`, "poses" for a
        :class:`~drivers.interface.PoseMover`; for these two the host computes the motion.
    tells : str
        Of a gauge: "number", or "contact" if it only says whether it touches.
    """

    says: str
    settings: tuple[Setting, ...]
    open: Callable[[Surroundings], Awaitable[DeviceT]]
    address: Callable[[Mapping[str, Any]], str]
    takes: Takes = "parameters"
    tells: Tells = "number"
