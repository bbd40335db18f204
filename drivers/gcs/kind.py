"""The kind ``gcs`` of site files."""

from collections.abc import Mapping
from typing import Any

from drivers.interface import MotionController
from drivers.kind import Kind, Setting, Surroundings


async def _open(around: Surroundings) -> MotionController:
    from drivers.gcs.axes import Axes
    from drivers.gcs.controller import GcsController  # slow to import: only when it is opened

    settings = around.settings
    names = [actuator.name for actuator in around.actuators]
    return await GcsController.connect(
        settings["port"],
        settings["baudrate"],
        axes=Axes(dict(zip(names, settings["axes"], strict=True)), settings["pose_axes"]),
        serial=around.serial or None,
        limits={actuator.name: actuator.limits for actuator in around.actuators},
        level=f"CCL 1 {settings['level_password']}",
        store_password=settings["store_password"],
        silence_s=settings["silence_s"],
        parameters=around.parameters,
    )


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
