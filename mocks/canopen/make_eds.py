"""Write the EDS files in ``drivers/eds``: ``python -m mocks.canopen.make_eds``.

The layout of a motion controller follows from the machine file alone (its actuators and the
nominal values of its parameters), so that another machine is another file, not another program.
"""

import sys
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from mocks.canopen.eds_text import (
    Entry,
    Object,
    array,
    communication_objects,
    eds_text,
    pdo_objects,
    record,
    variable,
)

ROOT = Path(__file__).resolve().parents[2]
EDS_FOLDER = ROOT / "drivers" / "eds"
TABLE_POINTS = 32
DRIVE_PRODUCT, CONTROLLER_PRODUCT = 0x402, 0x1000
POSE_NAMES = {6: ("x", "y", "z", "alpha", "beta", "gamma"), 2: ("tilt", "azimuth")}


def drive_objects() -> list[Object]:
    """Return the dictionary of a CiA 402 drive; positions in nm (nrad) of extension."""
    rw = "rw"
    single = [
        (0x6007, Entry("Abort connection option code", "I16", rw, 2)),
        (0x603F, Entry("Error code", "U16", "ro", 0, "", True)),
        (0x6040, Entry("Controlword", "U16", rw, 0, "", True)),
        (0x6041, Entry("Statusword", "U16", "ro", 0, "", True)),
        (0x605A, Entry("Quick stop option code", "I16", rw, 2)),
        (0x605E, Entry("Fault reaction option code", "I16", rw, 2)),
        (0x6060, Entry("Modes of operation", "I8", rw, 0, "", True)),
        (0x6061, Entry("Modes of operation display", "I8", "ro", 0, "", True)),
        (0x6062, Entry("Position demand value", "I32", "ro", 0, "nm")),
        (0x6064, Entry("Position actual value", "I32", "ro", 0, "nm", True)),
        (0x6065, Entry("Following error window", "U32", rw, 100_000, "nm")),
        (0x6066, Entry("Following error time out", "U16", rw, 50, "ms machine time")),
        (0x6067, Entry("Position window", "U32", rw, 100, "nm")),
        (0x607A, Entry("Target position", "I32", rw, 0, "nm", True)),
        (0x607C, Entry("Home offset", "I32", rw, 0, "nm")),
        (0x6081, Entry("Profile velocity", "U32", rw, 20_000_000, "nm/s")),
        (0x6083, Entry("Profile acceleration", "U32", rw, 100_000_000, "nm/s^2")),
        (0x6084, Entry("Profile deceleration", "U32", rw, 100_000_000, "nm/s^2")),
        (0x6085, Entry("Quick stop deceleration", "U32", rw, 1_000_000_000, "nm/s^2")),
        (0x6098, Entry("Homing method", "I8", rw, 34)),
        (0x609A, Entry("Homing acceleration", "U32", rw, 100_000_000, "nm/s^2")),
        (0x60A8, Entry("SI unit position", "U32", "ro", 0xF701_0000)),
        (0x6502, Entry("Supported drive modes", "U32", "ro", 1 << 0 | 1 << 5 | 1 << 7)),
    ]
    limits = [
        Entry("Min position limit", "I32", rw, -36_500_000, "nm"),
        Entry("Max position limit", "I32", rw, 35_100_000, "nm"),
    ]
    speeds = [
        Entry("Speed during search for switch", "U32", rw, 20_000_000, "nm/s"),
        Entry("Speed during search for zero", "U32", rw, 2_000_000, "nm/s"),
    ]
    return [
        *(
            obj
            for obj in communication_objects("pkmcal mock drive", DRIVE_PRODUCT, 0x0002_0192, 4020)
            if obj.index not in (0x1010, 0x1011)
        ),
        *(variable(index, entry) for index, entry in single),
        array(0x607D, "Software position limit", limits),
        array(0x6099, "Homing speeds", speeds),
        *pdo_objects(1, True, [(0x6040, 0, "U16")]),
        *pdo_objects(1, False, [(0x6041, 0, "U16"), (0x6061, 0, "I8")]),
    ]


def nominal_parameters(machine: Mapping[str, Any]) -> dict[str, dict[str, tuple[float, str]]]:
    """Return limb -> parameter -> (nominal value, unit) from a parsed machine file."""
    found = {}
    for limb, limb_table in machine["limbs"].items():
        declared = machine["limb_types"][limb_table["type"]]["parameters"]
        found[limb] = {
            name: (float(limb_table.get(name, table.get("nominal", 0.0))), table["unit"])
            for name, table in declared.items()
        }
    return found


def parameter_objects(machine: Mapping[str, Any]) -> list[Object]:
    """Return the kinematic parameters: one array a limb from 0x2101 on."""
    return [
        array(
            0x2101 + n,
            f"Kinematic parameters {limb}",
            [
                Entry(f"{limb}.{name}", "REAL64", "rw", value, unit)
                for name, (value, unit) in values.items()
            ],
        )
        for n, (limb, values) in enumerate(nominal_parameters(machine).items())
    ]


def compensation_objects(legs: list[str], unit: str) -> list[Object]:
    """Return the compensation values: pitch, backlash and cyclic table of each actuated limb."""
    pitch = [Entry(f"screw-pitch.{leg}", "REAL64", "rw", 0.0, "ratio") for leg in legs]
    backlash = [Entry(f"backlash.{leg}", "REAL64", "rw", 0.0, unit) for leg in legs]
    tables = [
        array(
            0x2211 + n,
            f"Cyclic table {leg}",
            [
                Entry(f"screw-cyclic-table.{leg}.period", "REAL64", "rw", 0.0, unit),
                *(
                    Entry(f"screw-cyclic-table.{leg}.{k}", "REAL64", "rw", 0.0, unit)
                    for k in range(TABLE_POINTS)
                ),
            ],
        )
        for n, leg in enumerate(legs)
    ]
    return [
        array(0x2201, "Compensation of screw pitch", pitch),
        array(0x2202, "Compensation of backlash", backlash),
        *tables,
    ]


def motion_objects(actuators: Mapping[str, Any], pose_unit: tuple[str, ...]) -> list[Object]:
    """Return the objects that command motion and report it; q in the actuator's own unit."""
    count = len(actuators)
    unit = next(iter(actuators.values()))["unit"]
    low = [Entry(f"{q} min", "REAL64", "ro", float(a["limits"][0]), unit)
           for q, a in actuators.items()]  # fmt: skip
    high = [Entry(f"{q} max", "REAL64", "ro", float(a["limits"][1]), unit)
            for q, a in actuators.items()]  # fmt: skip
    home = [float(a["home"]) for a in actuators.values()]
    pose = zip(POSE_NAMES[count], pose_unit, strict=True)
    per_q = list(zip(actuators, home, strict=True))
    return [
        array(
            0x2400,
            "Commanded pose",
            [Entry(n, "REAL64", "rw", 0.0, u, True) for n, u in pose],
        ),
        record(
            0x2401,
            "Motion command",
            [
                Entry("Sequence number", "U16", "rw", 0, "", True),
                Entry("Command", "U8", "rw", 0, "", True),
            ],
        ),
        array(0x2402, "Commanded q", [Entry(q, "REAL64", "rw", h, unit) for q, h in per_q]),
        array(
            0x2403,
            "Drive set-points for commanded q",
            [Entry(q, "I32", "ro", 0, f"n{unit[-1] if unit == 'mm' else unit}") for q in actuators],
        ),
        record(
            0x2410,
            "Motion status",
            [
                Entry("Sequence number", "U16", "ro", 0, "", True),
                Entry("Status bits", "U16", "ro", 0, "", True),
                Entry("Result of the last command", "U16", "ro", 0, "", True),
                Entry("Actuators concerned", "U16", "ro", 0, "", True),
            ],
        ),
        array(
            0x2411, "Targets q", [Entry(q, "REAL64", "ro", h, unit, True) for q, h in per_q]
        ),
        array(0x2412, "Actual q", [Entry(q, "REAL64", "ro", h, unit) for q, h in per_q]),
        array(0x2420, "Lower limits of q", low),
        array(0x2421, "Upper limits of q", high),
        variable(0x2430, Entry("Largest actuator speed", "REAL64", "rw", 20.0, f"{unit}/s")),
    ]  # fmt: skip


def controller_objects(machine: Mapping[str, Any]) -> list[Object]:
    """Return the dictionary of the motion controller of a parsed machine file."""
    actuators = machine["actuators"]
    count = len(actuators)
    unit = next(iter(actuators.values()))["unit"]
    legs = [limb for limb, table in machine["limbs"].items() if "q" in table]
    name = str(machine["name"])
    pose_unit = ("mm",) * 3 + ("rad",) * 3 if count == 6 else ("rad",) * count
    kinematic = parameter_objects(machine)
    p_count = sum(len(obj.entries) for obj in kinematic)
    objects = [
        *communication_objects(f"pkmcal mock {name} controller", CONTROLLER_PRODUCT, 0, 1001),
        record(
            0x2000,
            "Machine",
            [
                Entry("Name", "STRING", "const", name),
                Entry("Number of actuators", "U8", "const", count),
                Entry("Number of kinematic parameters", "U16", "const", p_count),
            ],
        ),
        *kinematic,
        *compensation_objects(legs, unit),
        array(
            0x2300,
            "Channels",
            [
                Entry("structure_temp_C", "REAL64", "ro", 20.0, "deg C"),
                Entry("payload_kg", "REAL64", "ro", 0.0, "kg"),
            ],
        ),
        *motion_objects(actuators, pose_unit),
        record(
            0x2500,
            "Parameter checksum",
            [
                Entry("CRC-32 of the active parameters", "U32", "ro", 0),
                Entry("CRC-32 of the stored parameters", "U32", "ro", 0),
            ],
        ),
        array(0x2501, "Reload stored parameters", [Entry("Reload all", "U32", "rw", 1)]),
        variable(0x2502, Entry("Block of active kinematic parameters", "DOMAIN", "ro")),
        variable(0x2503, Entry("Block of active compensation values", "DOMAIN", "ro")),
    ]
    command = [(0x2401, 1, "U16"), (0x2401, 2, "U8")]
    status = [(0x2410, sub, "U16") for sub in (1, 2, 3, 4)]
    objects += [*pdo_objects(1, True, command), *pdo_objects(1, False, status)]
    for n in range(1, count + 1):
        objects += pdo_objects(n + 1, True, [(0x2400, n, "REAL64")])
        objects += pdo_objects(n + 1, False, [(0x2411, n, "REAL64")])
    return objects


def main(machine_files: list[str]) -> None:
    """Write the drive's EDS file and one for the controller of each machine file."""
    drive = EDS_FOLDER / "drive402.eds"
    drive.write_text(
        eds_text(drive.name, "pkmcal mock drive", DRIVE_PRODUCT, drive_objects()), encoding="utf-8"
    )
    for machine_file in machine_files:
        machine = tomllib.loads(Path(machine_file).read_text(encoding="utf-8"))
        path = EDS_FOLDER / f"{machine['name']}_controller.eds"
        product = f"pkmcal mock {machine['name']} controller"
        text = eds_text(path.name, product, CONTROLLER_PRODUCT, controller_objects(machine))
        path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:] or [str(ROOT / "calib" / "machines" / "hexapod.toml")])
