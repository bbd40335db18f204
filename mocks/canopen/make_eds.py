"""Write the EDS files in ``drivers/eds``: ``python -m mocks.canopen.make_eds``.

``pkmcal machine eds`` writes the controller's of one's own machine with the same functions. The
layout of a motion controller follows from the machine file alone (its actuators and the nominal
values of its parameters), so that another machine is another file, not another program.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from calib.errors import BadInput
from calib.mechanism.description import Machine
from drivers.canopen.eds import EDS_FOLDER
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
from mocks.physics.truth import machine_file

TABLE_POINTS = 32
MOST_ARRAYS, MOST_ENTRIES = 0xFF, 0xFE
DRIVE_PRODUCT, CONTROLLER_PRODUCT = 0x402, 0x1000


@dataclass(frozen=True)
class DriveUnits:
    """In what a drive counts, and what it does by default.

    ``name``: nm or nrad; ``code``: 0x60A8; ``window``: following error; ``speed`` a second,
    ``acceleration`` a second squared; ``low``, ``high``: software limits; in counts.
    """

    name: str
    code: int
    window: int
    speed: int
    acceleration: int
    low: int
    high: int


LINEAR = DriveUnits("nm", 0xF701_0000, 100_000, 20_000_000, 100_000_000, -36_500_000, 35_100_000)


def drive_units(machine: Machine) -> DriveUnits:
    """Return what the drives of a machine count in: nm and nrad of extension.

    Software limits are the machine file's, with half a percent of the stroke to spare.
    """
    first = machine.actuators[0]
    counts = 1e9 if first.unit == "rad" else 1e6
    low, high = (counts * (limit - float(first.home)) for limit in first.limits)
    spare = 0.005 * (high - low)
    if first.unit == "rad":
        unit = ("nrad", 0xF710_0000, 300_000, 200_000_000, 400_000_000)
    else:
        unit = ("nm", 0xF701_0000, 100_000, 20_000_000, 100_000_000)
    return DriveUnits(*unit, round(low - spare), round(high + spare))


def drive_objects(u: DriveUnits = LINEAR) -> list[Object]:
    """Return the dictionary of a CiA 402 drive; positions in counts of extension."""
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
        (0x6062, Entry("Position demand value", "I32", "ro", 0, u.name)),
        (0x6064, Entry("Position actual value", "I32", "ro", 0, u.name, True)),
        (0x6065, Entry("Following error window", "U32", rw, u.window, u.name)),
        (0x6066, Entry("Following error time out", "U16", rw, 50, "ms machine time")),
        (0x6067, Entry("Position window", "U32", rw, 100, u.name)),
        (0x607A, Entry("Target position", "I32", rw, 0, u.name, True)),
        (0x607C, Entry("Home offset", "I32", rw, 0, u.name)),
        (0x6081, Entry("Profile velocity", "U32", rw, u.speed, f"{u.name}/s")),
        (0x6083, Entry("Profile acceleration", "U32", rw, u.acceleration, f"{u.name}/s^2")),
        (0x6084, Entry("Profile deceleration", "U32", rw, u.acceleration, f"{u.name}/s^2")),
        (0x6085, Entry("Quick stop deceleration", "U32", rw, 10 * u.acceleration, f"{u.name}/s^2")),
        (0x6098, Entry("Homing method", "I8", rw, 34)),
        (0x609A, Entry("Homing acceleration", "U32", rw, u.acceleration, f"{u.name}/s^2")),
        (0x60A8, Entry("SI unit position", "U32", "ro", u.code)),
        (0x6502, Entry("Supported drive modes", "U32", "ro", 1 << 0 | 1 << 5 | 1 << 7)),
    ]
    limits = [
        Entry("Min position limit", "I32", rw, u.low, u.name),
        Entry("Max position limit", "I32", rw, u.high, u.name),
    ]
    speeds = [
        Entry("Speed during search for switch", "U32", rw, u.speed, f"{u.name}/s"),
        Entry("Speed during search for zero", "U32", rw, u.speed // 10, f"{u.name}/s"),
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


def parameter_objects(machine: Machine) -> list[Object]:
    """Return the kinematic parameters: one array a limb from 0x2101 on.

    Raises BadInput for a machine with more of them than there are places.
    """
    limbs: dict[str, list[Entry]] = {}
    for parameter in machine.parameters:
        limb = parameter.name.partition(".")[0]
        entry = Entry(parameter.name, "REAL64", "rw", float(parameter.nominal), parameter.unit)
        limbs.setdefault(limb, []).append(entry)
    if len(limbs) > MOST_ARRAYS or max(map(len, limbs.values()), default=0) > MOST_ENTRIES:
        raise BadInput(
            "the machine has more parameters than the object dictionary has places",
            place=machine.name,
            remedy=f"There are {MOST_ARRAYS} limbs of {MOST_ENTRIES} parameters.",
        )
    return [
        array(0x2101 + n, f"Kinematic parameters {limb}", entries)
        for n, (limb, entries) in enumerate(limbs.items())
    ]


def driven_limbs(machine: Machine) -> list[str]:
    """Return the limb that each actuator drives, in the order of the actuators."""
    drives = {
        term.index: limb.name
        for limb in machine.limbs
        for element in limb.elements
        for term in element.terms
        if term.kind == "actuator"
    }
    return [drives[n] for n in range(len(machine.actuators))]


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


def per_actuator(
    machine: Machine,
    kind: str,
    access: str,
    values: Sequence[float],
    name: str = "",
    pdo: bool = False,
) -> list[Entry]:
    """Return one entry an actuator, in its unit; ``name`` follows the actuator's own."""
    return [
        Entry(f"{a.name}{name}", kind, access, value, a.unit, pdo)
        for a, value in zip(machine.actuators, values, strict=True)
    ]


def motion_objects(machine: Machine) -> list[Object]:
    """Return the objects that command motion and report it; q in the actuator's own unit."""
    home = [float(a.home) for a in machine.actuators]
    low = [float(a.limits[0]) for a in machine.actuators]
    high = [float(a.limits[1]) for a in machine.actuators]
    pose = [
        Entry(name, "REAL64", "rw", 0.0, "mm" if name in "xyz" else "rad", True)
        for name in machine.task.coordinates
    ]
    counts = [Entry(a.name, "I32", "ro", 0, "counts of the drive") for a in machine.actuators]
    command = [
        Entry("Sequence number", "U16", "rw", 0, "", True),
        Entry("Command", "U8", "rw", 0, "", True),
    ]
    status = [
        Entry("Sequence number", "U16", "ro", 0, "", True),
        Entry("Status bits", "U16", "ro", 0, "", True),
        Entry("Result of the last command", "U16", "ro", 0, "", True),
        Entry("Actuators concerned", "U16", "ro", 0, "", True),
    ]
    fast = 0.2 if machine.actuators[0].unit == "rad" else 20.0
    speed = Entry("Largest actuator speed", "REAL64", "rw", fast, f"{machine.actuators[0].unit}/s")
    return [
        array(0x2400, "Commanded pose", pose),
        record(0x2401, "Motion command", command),
        array(0x2402, "Commanded q", per_actuator(machine, "REAL64", "rw", home)),
        array(0x2403, "Drive set-points for commanded q", counts),
        record(0x2410, "Motion status", status),
        array(0x2411, "Targets q", per_actuator(machine, "REAL64", "ro", home, pdo=True)),
        array(0x2412, "Actual q", per_actuator(machine, "REAL64", "ro", home)),
        array(0x2420, "Lower limits of q", per_actuator(machine, "REAL64", "ro", low, " min")),
        array(0x2421, "Upper limits of q", per_actuator(machine, "REAL64", "ro", high, " max")),
        variable(0x2430, speed),
    ]


def controller_pdos(machine: Machine) -> list[Object]:
    """Return the PDOs: command and status first, then one REAL64 each."""
    command = [(0x2401, 1, "U16"), (0x2401, 2, "U8")]
    status = [(0x2410, sub, "U16") for sub in (1, 2, 3, 4)]
    objects = [*pdo_objects(1, True, command), *pdo_objects(1, False, status)]
    for n in range(1, len(machine.task.coordinates) + 1):
        objects += pdo_objects(n + 1, True, [(0x2400, n, "REAL64")])
    for n in range(1, len(machine.actuators) + 1):
        objects += pdo_objects(n + 1, False, [(0x2411, n, "REAL64")])
    return objects


def machine_objects(machine: Machine) -> list[Object]:
    """Return what the controller says of its machine: name, counts, channels."""
    return [
        record(
            0x2000,
            "Machine",
            [
                Entry("Name", "STRING", "const", machine.name),
                Entry("Number of actuators", "U8", "const", len(machine.actuators)),
                Entry("Number of kinematic parameters", "U16", "const", len(machine.parameters)),
            ],
        ),
        array(
            0x2300,
            "Channels",
            [
                Entry("structure_temp_C", "REAL64", "ro", 20.0, "deg C"),
                Entry("payload_kg", "REAL64", "ro", 0.0, "kg"),
            ],
        ),
    ]


def checking_objects() -> list[Object]:
    """Return checksum, reload and the blocks."""
    return [
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


def controller_objects(machine: Machine) -> list[Object]:
    """Return the dictionary of the motion controller of a machine."""
    product = f"pkmcal mock {machine.name} controller"
    return [
        *communication_objects(product, CONTROLLER_PRODUCT, 0, 1001),
        *machine_objects(machine),
        *parameter_objects(machine),
        *compensation_objects(driven_limbs(machine), machine.actuators[0].unit),
        *motion_objects(machine),
        *checking_objects(),
        *controller_pdos(machine),
    ]


def controller_eds(machine: Machine) -> tuple[str, str]:
    """Return file name and text of the EDS file of a machine's controller."""
    name = f"{machine.name}_controller.eds"
    product = f"pkmcal mock {machine.name} controller"
    return name, eds_text(name, product, CONTROLLER_PRODUCT, controller_objects(machine))


def drive_eds(machine: Machine | None = None) -> tuple[str, str]:
    """Return file name and text of the EDS file of a machine's drives (None: of the hexapod's)."""
    if machine is None:
        objects, name = drive_objects(), "drive402.eds"
    else:
        objects, name = drive_objects(drive_units(machine)), f"{machine.name}_drive.eds"
    return name, eds_text(name, "pkmcal mock drive", DRIVE_PRODUCT, objects)


def shipped_eds() -> list[tuple[str, str]]:
    """Return names and texts of the EDS files that ship with the program."""
    ptm = machine_file("ptm")
    return [
        drive_eds(), controller_eds(machine_file("hexapod")), drive_eds(ptm), controller_eds(ptm),
    ]  # fmt: skip


def main() -> None:
    """Write the EDS files that ship with the program."""
    for name, text in shipped_eds():
        (EDS_FOLDER / name).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
