"""The kind ``gcs`` of site files."""

from collections.abc import Mapping
from typing import Any

from drivers.errors import Refused
from drivers.gcs.conventions import ORDERS, ROTATION, Convention
from drivers.interface import MotionController
from drivers.kind import Kind, Setting, Surroundings


async def _open(around: Surroundings) -> MotionController:
    from drivers.gcs.axes import Axes
    from drivers.gcs.controller import GcsController  # slow to import: only when it is opened

    settings = around.settings
    names = [actuator.name for actuator in around.actuators]
    actuators = dict(zip(names, settings["axes"], strict=True))
    return await GcsController.connect(
        settings["port"],
        settings["baudrate"],
        axes=Axes(actuators, settings["pose_axes"], _convention(settings)),
        serial=around.serial or None,
        limits={actuator.name: actuator.limits for actuator in around.actuators},
        level=f"CCL 1 {settings['level_password']}",
        store_password=settings["store_password"],
        silence_s=settings["silence_s"],
        parameters=around.parameters,
    )


def _convention(settings: Mapping[str, Any]) -> Convention | None:
    """How angles are written; None where the platform does not turn.

    Raises Refused where that is not stated: a controller that counts in degrees would make 0.1 deg
    of 0.1 rad, and say nothing.
    """
    count = len(settings["pose_axes"])
    if count == 3:
        return None
    if count != 6:
        raise Refused(
            f"pose_axes names {count} axes; a platform has 3, or 6 where it turns",
            device="controller",
            remedy="Correct pose_axes under [controller] of the site file",
        )
    missing = [name for name in ("angle_unit", "rotation") if not settings[name]]
    if missing:
        raise Refused(
            f"pose_axes names angles, and {' and '.join(missing)} is not stated",
            device="controller",
            remedy="Write angle_unit and rotation under [controller] of the site file",
        )
    return Convention(settings["rotation"], settings["angle_unit"] == "deg")


def _address(settings: Mapping[str, Any]) -> str:
    return str(settings["port"])


KIND: Kind[MotionController] = Kind(
    says="Controllers that speak GCS 2.0 and hold kinematic parameters, on a serial line or TCP",
    settings=(
        Setting("port", "text", 'serial port, or "socket://host:port"'),
        Setting("baudrate", "whole", "of a serial port", 115200, least=300),
        Setting(
            "axes", "words", "what it calls the actuators, in their order", ["A", "B", "C"],
            count="actuators",
        ),
        Setting("pose_axes", "words", "and the coordinates of the platform", ["X", "Y", "Z"]),
        Setting(
            "angle_unit", "text", "where pose_axes names angles too: their unit", "",
            choices=("deg", "rad"),
        ),
        Setting("rotation", "text", f"then also the {ROTATION}", "", choices=ORDERS),
        Setting("level_password", "text", "of its command level 1", "advanced"),
        Setting("store_password", "text", "of storing parameters", "100"),
        Setting(
            "silence_s", "number", "seconds without an answer after which it counts as lost", 1.0,
            least=0.1, most=60.0,
        ),
    ),
    open=_open,
    address=_address,
)  # fmt: skip
