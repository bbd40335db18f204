"""The kind ``linuxcnc`` of site files."""

from collections.abc import Mapping
from typing import Any

from drivers.interface import MotionController
from drivers.kind import Kind, Setting, Surroundings


async def _open(around: Surroundings) -> MotionController:
    from drivers.linuxcnc.controller import LinuxCncController  # only when it is opened

    return await LinuxCncController.connect(around)


def _address(settings: Mapping[str, Any]) -> str:
    return str(settings["ini"])


def _texts(table: Any) -> str:
    odd = [key for key, value in table.items() if not isinstance(value, str)]
    return f"{odd[0]} is no text" if odd else ""


KIND: Kind[MotionController] = Kind(
    says="LinuxCNC on this computer, with the kinematics genhexkins: hexapods of six struts",
    settings=(
        Setting("ini", "file", "INI file with which LinuxCNC was started"),
        Setting(
            "hal", "file", "HAL file that sets the pins of genhexkins, rewritten when parameters "
            "are stored; by default the one of the INI file that sets them", "",
        ),
        Setting(
            "python", "text", "Python that has LinuxCNC's modules linuxcnc and hal",
            "/usr/bin/python3",
        ),
        Setting(
            "env", "table", "environment in which LinuxCNC was started, where it is not the usual "
            "one (RTAPI_UID, RTAPI_FIFO_PATH)", {}, check=_texts,
        ),
        Setting(
            "restart", "words", "command that starts LinuxCNC again, so that what was stored is "
            "loaded; without one the stored files are read back and loaded here", [],
        ),
        Setting("restart_s", "number", "seconds that this may take", 60.0, least=1.0, most=600.0),
        Setting(
            "speed_mm_s", "number", "speed of the platform; 0 for as fast as the INI file allows",
            0.0, least=0.0, most=1e4,
        ),
        Setting(
            "silence_s", "number", "seconds without an answer after which it counts as lost", 10.0,
            least=1.0, most=60.0,
        ),
        Setting("home_s", "number", "seconds that homing one joint may take", 120.0, least=1.0),
    ),
    open=_open,
    address=_address,
)  # fmt: skip
