"""What the routines ask of any motion controller and any laser tracker.

A device that moves is one of three: a :class:`MotionController` with kinematic parameters of its
own; :class:`Motors`, which take actuator values; a :class:`PoseMover`, which takes poses. For the
last two the host holds the parameters and computes the motion.

Units: mm, rad, s, kg, deg C. Every coroutine here ends before a deadline of its own, with an
answer or with a :class:`drivers.errors.DeviceError`. Deadlines run on wall time.
"""

from collections.abc import AsyncIterator, Callable, Mapping
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable


@dataclass(frozen=True)
class Identity:
    """Who answers: compared with the site file at connect and written to every journal."""

    kind: str
    vendor: str = ""
    product: str = ""
    serial: str = ""
    firmware: str = ""


@dataclass(frozen=True)
class Alarm:
    """Something that a device said unasked (EMCY, tracker event, heartbeat lost)."""

    device: str
    what: str
    remedy: str = ""
    fault: bool = False


@dataclass(frozen=True)
class ActuatorState:
    """One actuator as its drive reports it; ``position`` and ``target`` in q units."""

    name: str
    position: float
    target: float
    state: str
    moving: bool
    homed: bool
    fault: str = ""


@dataclass(frozen=True)
class ControllerState:
    """A snapshot of the machine for the screens and the journal."""

    actuators: tuple[ActuatorState, ...]
    moving: bool
    enabled: bool
    channels: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class ControllerCan:
    """What a controller offers; routines ask before they rely on it.

    ``parameters``: it holds kinematic parameters that can be read, written and stored. ``homes``:
    its actuators have reference moves. ``channels``: names of its state readings.
    """

    parameters: bool = True
    homes: bool = True
    channels: tuple[str, ...] = ()


class Moving(Protocol):
    """What everything that moves a machine has, whatever it takes as a command."""

    identity: Identity
    can: ControllerCan

    def on_alarm(self, callback: Callable[[Alarm], None]) -> None:
        """Call ``callback`` in the event loop for everything said unasked."""

    def check(self) -> None:
        """Raise the fault that is standing (link lost, heartbeat lost, drive fault), if any."""

    async def state(self) -> ControllerState:
        """Read a snapshot."""

    async def enable(self) -> None:
        """Bring all drives to operation enabled."""

    async def disable(self) -> None:
        """Take the power off all drives."""

    async def clear_faults(self) -> None:
        """Reset standing faults; motion stays disabled until :meth:`enable`."""

    async def home(self, actuator: str) -> None:
        """Run one actuator's homing."""

    async def wait_arrived(self, timeout: float) -> None:
        """Wait until everything that moves reports its target reached; ``timeout`` in wall s."""

    async def stop(self) -> None:
        """Quick stop, at any moment and from any state; never raises for a second call."""

    async def channels(self) -> dict[str, float]:
        """State readings of the machine: ``structure_temp_C``, ``payload_kg`` and others."""

    async def close(self) -> None:
        """Release the link; never raises."""


@runtime_checkable
class StopsAtOnce(Protocol):
    """A controller whose stop needs no event loop; what moves a machine may be one.

    The stop key is heard in a thread of its own: while a picture is drawn or a fit takes the
    processor the event loop comes to its turn late.
    """

    def stop_at_once(self) -> None:
        """Send a quick stop from any thread and wait for nothing; never raises.

        :meth:`Moving.stop` follows, and tells what came of it.
        """


class Motors(Moving, Protocol):
    """Drives that take actuator values and know no kinematics: the host computes the legs.

    ``can.parameters`` is False: parameters live with the host.
    """

    async def move_actuators(self, q: tuple[float, ...]) -> None:
        """Start moving every actuator to ``q``, in the order and units of the machine file.

        All start together and arrive together, so that the way is straight in actuator space.
        Raises Refused for a value outside a drive's limits, before any of them moves.
        """


class PoseMover(Moving, Protocol):
    """A closed controller that takes poses and shows no parameters: the host corrects them.

    ``can.parameters`` is False. The actuators of its state are its pose axes where it tells no
    others.
    """

    async def move_pose(self, pose: tuple[float, ...]) -> None:
        """Start moving to a pose as the controller understands it: x, y, z in mm; rx, ry, rz in
        rad, R = Rz(rz) Ry(ry) Rx(rx), about its own pivot. Raises Refused if it refuses it.
        """

    async def commanded_pose(self) -> tuple[float, ...]:
        """The pose that it was last told to go to, bit for bit where it can say so."""

    async def frame(self) -> dict[str, str]:
        """What its poses refer to, in its own words: pivot, coordinate system, rotation order."""


class MotionController(Moving, Protocol):
    """A controller that holds kinematic parameters and moves the machine with them.

    Parameter names are those of the machine file (``leg1.B_x``); compensation values carry the
    names of the effects that they compensate (``screw-pitch.leg1``, ``backlash.leg1``).
    """

    async def move_to_pose(self, pose: tuple[float, ...]) -> tuple[float, ...]:
        """Command a pose and start moving: x, y, z in mm; rx, ry, rz in rad.

        R = Rz(rz) Ry(ry) Rx(rx). Returns the actuator targets q that the controller
        computed with the parameters that it holds. Raises Refused if outside its limits.
        """

    async def read_parameters(self) -> dict[str, float]:
        """Read every kinematic and compensation parameter that the controller uses now."""

    async def write_parameters(self, values: Mapping[str, float]) -> None:
        """Write to volatile memory; the controller uses them at once. Motion must be disabled."""

    async def parameter_checksum(self) -> int:
        """CRC-32 that the controller computes over the parameters that it uses now."""

    async def store_parameters(self) -> None:
        """Make the volatile parameters survive a power cycle."""

    async def reload_parameters(self) -> None:
        """Bring the stored parameters back into use."""


@dataclass(frozen=True)
class TrackerReading:
    """The mean of one dwell: SMR centre in the tracker frame (mm), with its uncertainty.

    ``covariance`` holds xx, yy, zz, xy, xz, yz of the mean in mm^2. The weather (deg C, hPa,
    relative humidity in %) is None where the tracker has no station for it.
    """

    xyz: tuple[float, float, float]
    covariance: tuple[float, float, float, float, float, float]
    temperature_C: float | None = None
    pressure_hPa: float | None = None
    humidity: float | None = None


@dataclass(frozen=True)
class TrackSample:
    """One sample of the continuous mode: device time in s, SMR centre in mm."""

    time_s: float
    xyz: tuple[float, float, float]
    valid: bool


@dataclass(frozen=True)
class TrackerState:
    """What the tracker says of itself; ``face`` is 0 where it has no two faces."""

    initialized: bool
    ready: bool
    locked: bool
    laser_warm: bool
    reflector: str
    face: int


@dataclass(frozen=True)
class TrackerCan:
    """What a tracker offers; routines ask before they rely on it, and say what was not done.

    ``points``: it drives its beam to a place. ``searches``: it looks for a lost reflector.
    ``faces``: it has two, and changes them. ``streams``: it has a continuous mode. ``reflectors``:
    the type of reflector is chosen by name. ``weather``, ``object_temperature``: it measures them.
    """

    points: bool = False
    searches: bool = False
    faces: bool = False
    streams: bool = False
    reflectors: bool = False
    weather: bool = False
    object_temperature: bool = False


class Tracker(Protocol):
    """A laser tracker that follows an SMR.

    What ``can`` denies is never called; it may raise Refused.
    """

    identity: Identity
    can: TrackerCan

    def on_alarm(self, callback: Callable[[Alarm], None]) -> None:
        """Call ``callback`` in the event loop for everything said unasked."""

    def check(self) -> None:
        """Raise the fault that is standing, if any."""

    async def state(self) -> TrackerState:
        """Read a snapshot."""

    async def initialize(self) -> None:
        """Set units (mm, rad, deg C, hPa), right-handed xyz, environment; initialise if needed."""

    async def select_reflector(self, name: str) -> None:
        """Choose the reflector type; raises Refused if the tracker does not know it."""

    async def point_at(self, xyz: tuple[float, float, float]) -> None:
        """Drive the beam to a point and lock on the SMR there; raises NoTarget."""

    async def find_reflector(self, distance_mm: float) -> None:
        """Search around the present direction; raises NoTarget."""

    async def measure(self, dwell_s: float) -> TrackerReading:
        """Measure stationary for ``dwell_s`` of device time; raises BeamBroken, NotReady."""

    def stream(self, separation_s: float) -> AsyncIterator[TrackSample]:
        """Yield continuous-mode samples until the iterator is closed; raises BeamBroken."""

    async def channels(self) -> dict[str, float]:
        """What it measures of object temperature (``structure_temp_C``) and air.

        ``air_temp_C``, ``pressure_hPa``, ``humidity``; what has no sensor has no channel.
        """

    async def change_face(self) -> None:
        """Turn to the other face, for the two-face check."""

    async def stop(self) -> None:
        """End any measurement; never raises for a second call."""

    async def close(self) -> None:
        """Release the link; never raises."""


@dataclass(frozen=True)
class GaugeReading:
    """One number (mm, or rad where it measures an angle), and what was sent or typed for it."""

    value: float
    said: str = ""


@dataclass(frozen=True)
class GaugeState:
    """What is known of an instrument of one number: whether it says any, and what it said last."""

    ready: bool
    last: str = ""


@dataclass(frozen=True)
class GaugeCan:
    """What an instrument of one number offers.

    ``repeats``: it can be read as often as one likes, so that several readings show whether it
    rests; else somebody makes each, by a key or by typing. ``by_hand``: a person reads it off.
    ``contacts``: it shows no number, only whether it touches: 1 where it does, 0 where not.
    """

    repeats: bool = True
    by_hand: bool = False
    contacts: bool = False


class Gauge(Protocol):
    """An instrument that gives one number: dial gauge, touch probe, ball bar, inclinometer."""

    identity: Identity
    can: GaugeCan

    def on_alarm(self, callback: Callable[[Alarm], None]) -> None:
        """Call ``callback`` in the event loop for everything said unasked."""

    def check(self) -> None:
        """Raise the fault that is standing, if any."""

    async def state(self) -> GaugeState:
        """Read a snapshot."""

    async def read(self, dwell_s: float) -> GaugeReading:
        """Read the number, of a stream the mean over ``dwell_s``.

        Raises NoNumber where it shows none, and LinkError where nothing comes.
        """

    async def stop(self) -> None:
        """End a reading that is waited for; never raises for a second call."""

    async def close(self) -> None:
        """Release the link; never raises."""
