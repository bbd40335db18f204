"""The motion controller behind the wire: holds the parameters, and moves the sliders with them.

A commanded position of the platform becomes slider places with the parameters in use, so what is
written to the parameters is what the machine does next. Axes X Y Z are the platform's position
(mm), A B C the sliders of limbs 1, 2, 3 (q in mm).
"""

import math
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

from mocks.canopen.ports import Machine
from mocks.gcs import parameters as par
from mocks.gcs.errors import Code, GcsError
from mocks.gcs.slider import Slider
from mocks.gcs.tripod_kinematics import Unreachable, position_of, slider_places

POSE_AXES, SLIDER_AXES = "XYZ", "ABC"
AXES = POSE_AXES + SLIDER_AXES
LIMITS = {
    **dict.fromkeys(SLIDER_AXES, (280.0, 430.0)),
    "X": (-120.0, 95.0),
    "Y": (-105.0, 105.0),
    "Z": (-250.0, -65.0),
}
FASTEST = 200.0
ADVANCED, ADVANCED_PASSWORD = 1, "advanced"
STORE_PASSWORD = "100"


class Controller:
    """State and motion; not thread-safe, the server holds its lock.

    Parameters
    ----------
    machine : Machine
        Three legs: extension 0 of leg n is slider n at 410.
    defaults : mapping
        Nominal kinematic parameters by name.
    nvm_path : Path, optional
        File of the stored parameters.
    serial : int
    """

    def __init__(
        self, machine: Machine, defaults: Mapping[str, float], nvm_path: Path | None, serial: int
    ) -> None:
        self.machine = machine
        self.serial = serial
        self.parameters = par.ParameterMemory(defaults, nvm_path)
        self.sliders = {
            axis: Slider(n, machine) for n, axis in enumerate(SLIDER_AXES, start=1)
        }  # fmt: skip
        self.level = 0
        self.error = 0
        self.watchdog_ms = 0
        self._heard = time.monotonic()
        self.power_on()

    def power_on(self) -> None:
        """Come up with the stored parameters and without power on the motors."""
        for slider in self.sliders.values():
            slider.power_on()
        self.level, self.error, self.watchdog_ms = 0, 0, 0
        if not self.parameters.start():
            self.error = Code.FLASH_READ

    # ------------------------------------------------------------ state

    @property
    def busy(self) -> bool:
        """Whether a reference move is under way."""
        return any(slider.referencing for slider in self.sliders.values())

    def motion_mask(self) -> int:
        """Bit n of the axes in the order of ``SAI?``: axis n moves."""
        moving = {axis: slider.moving for axis, slider in self.sliders.items()}
        return sum(1 << n for n, axis in enumerate(AXES) if moving.get(axis, any(moving.values())))

    def of_axis(self, axis: str, what: str) -> float | bool:
        """Return ``place``, ``target``, ``on_target``, ``servo`` or ``referenced`` of an axis."""
        if axis in SLIDER_AXES:
            value: float | bool = getattr(self.sliders[axis], what)
            return value
        values = [getattr(slider, what) for slider in self.sliders.values()]
        if what not in ("place", "target"):
            return all(values)
        try:
            return position_of(values, self.parameters.active)[POSE_AXES.index(axis)]
        except Unreachable:
            return math.nan

    # ------------------------------------------------------------ motion

    def move(self, targets: Mapping[str, float]) -> None:
        """Start towards targets, all sliders arriving together; raises GcsError, moving nothing.

        Axes that are not named keep their targets. Pose and slider axes cannot be mixed.
        """
        kinds = {axis in POSE_AXES for axis in targets}
        if len(kinds) != 1:
            raise GcsError(Code.MIXED_AXES)
        self._need_within(targets)
        places = self._places(targets) if kinds == {True} else dict(targets)
        moving = [self.sliders[axis] for axis in places]
        if not all(slider.servo and slider.referenced for slider in moving) or self.busy:
            raise GcsError(Code.NOT_REFERENCED_OR_NO_SERVO)
        self._need_within(places)
        duration = max(self.sliders[axis].duration(place) for axis, place in places.items())
        for axis, place in places.items():
            self.sliders[axis].go(place, duration)

    def _places(self, targets: Mapping[str, float]) -> dict[str, float]:
        position = [
            targets[axis] if axis in targets else self.of_axis(axis, "target") for axis in POSE_AXES
        ]
        try:
            places = slider_places(position, self.parameters.active)
        except Unreachable as error:
            raise GcsError(Code.OUT_OF_LIMITS) from error
        return dict(zip(SLIDER_AXES, places, strict=True))

    def _need_within(self, targets: Mapping[str, float]) -> None:
        for axis, target in targets.items():
            low, high = LIMITS[axis]
            if not low <= target <= high:
                raise GcsError(Code.OUT_OF_LIMITS)

    def stop(self) -> None:
        """Stop everything now; ``ERR?`` answers 10 then."""
        for slider in self.sliders.values():
            slider.halt()
        self.error = Code.STOPPED

    def switch(self, axes: Sequence[str], states: Sequence[bool]) -> None:
        """Switch servos; a pose axis stands for all of them."""
        for axis, on in zip(axes, states, strict=True):
            for slider in self.sliders_of(axis):
                if not slider.switch(on):
                    raise GcsError(Code.MOTION_ERROR)

    def reference(self, axes: Sequence[str]) -> None:
        """Start reference moves."""
        chosen = [slider for axis in axes for slider in self.sliders_of(axis)]
        if not all(slider.servo for slider in chosen):
            raise GcsError(Code.NOT_REFERENCED_OR_NO_SERVO)
        for slider in chosen:
            slider.reference()

    def sliders_of(self, axis: str) -> list[Slider]:
        """Return the sliders that an axis moves."""
        return [self.sliders[axis]] if axis in SLIDER_AXES else list(self.sliders.values())

    def set_velocity(self, axis: str, velocity: float) -> None:
        """Set a slider's velocity, mm/s."""
        if axis not in SLIDER_AXES:
            raise GcsError(Code.NO_SUCH_AXIS)
        if not 0.0 < velocity <= FASTEST:
            raise GcsError(Code.VELOCITY)
        self.sliders[axis].velocity = velocity

    def need_servos_off(self) -> None:
        """Refuse what must not be done under power."""
        if any(slider.moving for slider in self.sliders.values()):
            raise GcsError(Code.IN_MOTION)
        if any(slider.servo for slider in self.sliders.values()):
            raise GcsError(Code.SERVO_ON)

    # ------------------------------------------------------------ what happens by itself

    def heard(self) -> None:
        """Something came from the PC."""
        self._heard = time.monotonic()

    def tick(self) -> None:
        """Look at the sliders and at the PC; called many times a second."""
        if "power-cycle" in self.machine.faults:
            self.power_on()
            self.machine.faults.take("power-cycle")  # only now: the power is back
        failed = [slider for slider in self.sliders.values() if slider.tick()]
        if failed:
            for slider in self.sliders.values():
                slider.halt()
            self.error = Code.MOTION_ERROR
        silent_ms = 1000.0 * (time.monotonic() - self._heard)
        if self.watchdog_ms and silent_ms > self.watchdog_ms:
            self._leave_alone()

    def _leave_alone(self) -> None:
        """Nobody watches: stop and take the power off."""
        for slider in self.sliders.values():
            if slider.servo:
                self.error = Code.STOPPED
            slider.switch(False)
