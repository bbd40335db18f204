"""A mock of one's own machine: its machine file, and the EDS file of its controller."""

from dataclasses import dataclass
from pathlib import Path

from calib.mechanism.description import Machine
from calib.mechanism.parse import parse_machine
from drivers.canopen.layout import read_layout
from drivers.errors import DeviceError
from mocks.physics.bodies import BODIES
from mocks.physics.truth import nominal_parameters

CONTROLLER_NODE = 10


@dataclass(frozen=True)
class OwnFiles:
    """Machine file and EDS file of one's own machine; drives alone have no controller's."""

    machine: Path
    eds: Path | None


def own_files(machine: str, eds: Path | None, bare: bool) -> OwnFiles | None:
    """The files of one's own machine, None for a shipped one; ValueError for half of them."""
    if machine in BODIES:
        if eds is not None:
            raise ValueError("--eds belongs to a machine file of one's own")
        return None
    file = Path(machine)
    if file.suffix != ".toml":
        raise ValueError(
            f'there is no mock of "{machine}"; there are mocks of {", ".join(BODIES)}, '
            "or name a machine file (.toml)"
        )
    if bare != (eds is None):
        raise ValueError(
            "drives alone (--bare) have no controller, and no --eds"
            if bare
            else f"{file}: a machine of one's own needs --eds FILE, which "
            f"pkmcal machine eds {file} writes"
        )
    return OwnFiles(file.resolve(), None if eds is None else eds.resolve())


def own_machine(own: OwnFiles) -> Machine:
    """Read both files; raises BadInput, ValueError or OSError where they are not of a machine."""
    machine = parse_machine(own.machine.read_text(encoding="utf-8"), str(own.machine))
    if own.eds is None:
        return machine
    try:
        layout = read_layout(own.eds, CONTROLLER_NODE)
    except DeviceError as error:
        raise ValueError(str(error)) from error
    names = list(nominal_parameters(machine))
    if layout.machine != machine.name or list(layout.kinematic) != names:
        raise ValueError(f"{own.eds} is not the EDS file of {own.machine}")
    return machine
