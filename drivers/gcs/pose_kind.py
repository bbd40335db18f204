"""The kind ``pose`` of site files."""

from collections.abc import Mapping
from typing import Any

from drivers.gcs.conventions import ORDERS, ROTATION, Convention, Vector
from drivers.interface import PoseMover
from drivers.kind import Kind, Setting, Surroundings


async def _open(around: Surroundings) -> PoseMover:
    # slow to import: only when it is opened
    from drivers.gcs.hexapod import GcsHexapod, Wishes
    from drivers.gcs.pose_frame import PoseFrame, chosen

    settings = around.settings
    pivot = _three(settings["pivot"])
    wishes = Wishes(
        axes=settings["axes"],
        convention=Convention(
            order=settings["rotation"],
            degrees=settings["angle_unit"] == "deg",
            origin=_three(settings["origin"]),
            pivot=pivot,
        ),
        frame=PoseFrame(chosen(settings["system"]), pivot),
        set_frame=settings["set_frame"],
        velocity_mm_s=settings["velocity_mm_s"],
        keep_servo=settings["keep_servo"],
    )
    return await GcsHexapod.connect(
        settings["port"],
        settings["baudrate"],
        wishes,
        serial=around.serial,
        silence_s=settings["silence_s"],
    )


def _three(values: Any) -> Vector:
    return float(values[0]), float(values[1]), float(values[2])


def _address(settings: Mapping[str, Any]) -> str:
    return str(settings["port"])


KIND: Kind[PoseMover] = Kind(
    says="Closed hexapods that speak GCS 2.0 and take poses: the host corrects them",
    settings=(
        Setting("port", "text", 'serial port, or "socket://host:port"'),
        Setting("baudrate", "whole", "of a serial port", 115200, least=300),
        Setting(
            "axes", "words", "what it calls x, y, z and the turns about them",
            ["X", "Y", "Z", "U", "V", "W"], count=6,
        ),
        Setting("angle_unit", "text", "of those turns", "deg", choices=("deg", "rad")),
        Setting("rotation", "text", ROTATION, choices=ORDERS),
        Setting(
            "origin", "numbers",
            "mm, where the platform's origin stands in the base frame at its zero", count=3,
        ),
        Setting("pivot", "numbers", "mm, its centre of rotation (SPI)", (0.0, 0.0, 0.0), count=3),
        Setting("system", "words", "its active coordinate systems (KEN)", ["ZERO"]),
        Setting(
            "set_frame", "flag", "whether to set pivot and systems where they are otherwise", False
        ),
        Setting(
            "velocity_mm_s", "number", "of the platform (VLS), mm/s; 0 leaves it as it is", 0.0,
            least=0.0,
        ),
        Setting(
            "keep_servo", "flag", "whether its servos stay on when the program ends", False
        ),
        Setting(
            "silence_s", "number", "seconds without an answer after which it counts as lost", 1.0,
            least=0.1, most=60.0,
        ),
    ),
    open=_open,
    address=_address,
    takes="poses",
)  # fmt: skip
