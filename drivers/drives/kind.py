"""The kind ``drives`` of site files."""

from collections.abc import Mapping
from typing import Any

from drivers.canopen.kind import BUS_SETTINGS, HEARTBEAT_SETTINGS, different_nodes
from drivers.interface import Motors
from drivers.kind import REQUIRED, Kind, Setting, Surroundings


async def _open(around: Surroundings) -> Motors:
    from drivers.drives.motors import DriveMotors  # slow to import: only when it is opened
    from drivers.drives.plan import plan_of

    return await DriveMotors.connect(plan_of(around))


def _address(settings: Mapping[str, Any]) -> str:
    return str(settings["channel"])


def _signs(values: Any) -> str:
    return "" if all(value in (1.0, -1.0) for value in values) else "a sign is neither 1 nor -1"


def _positive(values: Any) -> str:
    return "" if all(value > 0.0 for value in values) else "a number is not greater than 0"


def _methods(values: Any) -> str:
    good = all(value == int(value) and -128 <= value <= 127 for value in values)
    return "" if good else "homing methods are whole numbers from -128 to 127"


def _referenced(text: Any) -> str:
    from drivers.drives.plan import Referenced

    if Referenced.parse(text) is not None:
        return ""
    return f'"{text}" is neither "homing" nor "always" nor like "0x6041 bit 15"'


def _each(
    name: str, says: str, default: Any = (), check: Any = None, most: float | None = None
) -> Setting:
    return Setting(name, "numbers", says, default, count="actuators", check=check, most=most)


KIND: Kind[Motors] = Kind(
    says="CiA 402 drives alone on CANopen, each with its maker's EDS; the host computes the legs",
    settings=(
        *BUS_SETTINGS,
        *HEARTBEAT_SETTINGS,
        Setting(
            "eds", "files", "EDS file of the drives: one for all, or one for each actuator",
            count="actuators",
        ),
        _each("nodes", "node numbers; left out, 1, 2, ...", check=different_nodes),
        _each(
            "counts_per_unit", "counts of a drive's position in 1 mm or rad; left out, by the "
            "drive's 0x60A8, or 0x608F, 0x6091 and 0x6092", check=_positive,
        ),
        Setting(
            "feed_unit", "number", "size of one unit of 0x6092, mm or rad; 0: nobody knows", 0.0,
            least=0.0,
        ),
        Setting(
            "factors", "text", "whether the drive's own 0x60A8, 0x608F, 0x6091 and 0x6092 must "
            "agree with counts_per_unit", "believe", choices=("believe", "ignore"),
        ),
        _each("sign", "1, or -1 where the drive counts down as q grows", check=_signs),
        _each("offset", "q at the drive's zero, mm or rad; left out, q at home"),
        _each("homing_method", "0x6098; left out, as it stands in the drive", check=_methods),
        _each("lower", "lowest q; left out, the machine file's; never wider than that"),
        _each("upper", "highest q, likewise"),
        _each("speed", "largest speed of each actuator, mm/s or rad/s", REQUIRED, _positive),
        _each(
            "acceleration", "largest acceleration of each actuator, mm/s^2 or rad/s^2", REQUIRED,
            _positive,
        ),
        _each(
            "speed_counts", "counts of 0x6081 in 1 mm/s or rad/s; left out, as of the position",
            check=_positive,
        ),
        _each(
            "acceleration_counts", "counts of 0x6083 in 1 mm/s^2 or rad/s^2; left out, likewise",
            check=_positive,
        ),
        Setting(
            "window", "number", "how near to its target a drive has arrived, mm or rad; 0: 0x6067",
            0.0, least=0.0,
        ),
        Setting(
            "referenced", "text", 'where a drive says that it knows its reference: a bit as '
            '"0x6041 bit 15", "always", or "homing": only after this program has homed it',
            "homing", check=_referenced,
        ),
        Setting(
            "quick_stop", "whole", "0x605A: how a drive brakes at a stop; it is read back", 2,
            least=1, most=7,
        ),
        Setting(
            "on_silence", "whole", "0x6007: what a drive does when it no longer hears the PC; 1 "
            "fault, 2 power off, 3 quick stop; it is read back", 1, least=1, most=3,
        ),
        Setting(
            "mode", "text", "profile position, or cyclic synchronous position under SYNC",
            "profile", choices=("profile", "cyclic"),
        ),
        Setting(
            "sync_s", "number", "cyclic: period of SYNC, s, in whole ms", 0.01, least=0.001,
            most=0.25,
        ),
    ),
    open=_open,
    address=_address,
    takes="actuators",
)  # fmt: skip
